"""A drawing that takes long says so before, and ends in time."""

from __future__ import annotations

import itertools
import logging
import math
import time

import numpy as np
import pytest

import warpsplat
from tests.drawing.trace.drawings import LOGO, draw
from warpsplat.drawing import draft
from warpsplat.drawing.draw import announce_fit, announce_trace
from warpsplat.drawing.picture import Picture
from warpsplat.drawing.trace.trace import trace
from warpsplat.fit.problem import Run
from warpsplat.fit.settings import Settings
from warpsplat.portable.filters import boxed


def test_it_says_how_long_it_takes(caplog: pytest.LogCaptureFixture) -> None:
    image = Picture.of(np.random.default_rng(0).random((1500, 1500, 3), np.float32))
    with caplog.at_level(logging.WARNING):
        announce_fit(80, Settings())
        announce_trace(image, Settings(time_budget=9.0))
        assert not caplog.messages
        announce_fit(12_000, Settings())
        announce_trace(image, Settings())
    nodes, pixels = caplog.messages
    assert "12,000 nodes takes about 7 s" in nodes
    assert "tracing its 2.2 megapixels takes about 9 s" in pixels


@pytest.mark.parametrize(("time_left", "factor"), [(math.inf, 1), (400, 1), (40, 2), (10, 4)])
def test_a_trace_ends_in_time_by_fewer_pixels(
    time_left: float, factor: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The first four looks at the clock take 8 s each."""
    clock = itertools.count()
    monkeypatch.setattr(time, "monotonic", lambda: 8.0 * min(next(clock), 4))
    monkeypatch.setattr(draft, "QUICK_PIXELS", 1000)
    image = draw(LOGO)
    run = Run(lambda: pytest.fail("a trace needs no device"), deadline=time_left)
    made = draft.trace_in_time(image, None, None, 1.0, Settings(), run).scene
    small = trace(boxed(image, factor) if factor > 1 else image).scene
    assert (made.points == factor * small.points).all()
    assert (made.canvas.width, made.canvas.height) == image.shape[1::-1]


@pytest.mark.parametrize("budget", [1, 12, 30, 60, 120])
def test_a_drawing_is_what_it_is_when_time_is_up(budget: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each look at the clock takes a second; few are missed."""
    clock = itertools.count()
    monkeypatch.setattr(time, "monotonic", lambda: float(next(clock)))
    image = np.round(255 * draw(LOGO)).astype(np.uint8)
    made = warpsplat.vectorize(image, subject="drawing", time_budget=budget, device="cpu", threads=1)
    assert not made.stopped
    assert made.seconds < budget + 12
    assert made.score is not None
    assert made.score.psnr > 30
