"""A drawing that takes long says so before, and ends in time."""

from __future__ import annotations

import itertools
import logging
import math
import time

import numpy as np
import pytest

import warpsplat
from tests.drawing.drawings import RED, WHITE, disc, drawing
from tests.drawing.trace.drawings import LOGO, draw
from warpsplat.drawing import draft
from warpsplat.drawing.draw import announce_fit, announce_trace
from warpsplat.drawing.picture import Picture
from warpsplat.drawing.trace.trace import trace
from warpsplat.fit.problem import Run
from warpsplat.fit.settings import Settings
from warpsplat.portable.filters import boxed
from warpsplat.scene import Canvas


@pytest.mark.parametrize(("discs", "is_long"), [(20, False), (3000, True)])
def test_it_says_how_many_nodes_take_how_long(
    discs: int, is_long: bool, caplog: pytest.LogCaptureFixture
) -> None:
    made = drawing(Canvas(64, 64, WHITE), (RED, [disc(32, 32, 9)] * discs))
    with caplog.at_level(logging.WARNING):
        announce_fit(len(made.joints) // 3, Settings())
    assert ["12,000 nodes takes about 7 s" in message for message in caplog.messages] == [True] * is_long


def test_it_says_how_many_pixels_take_how_long_to_trace(caplog: pytest.LogCaptureFixture) -> None:
    image = np.random.default_rng(0).random((1500, 1500, 3), np.float32)
    with caplog.at_level(logging.WARNING):
        announce_trace(Picture.of(image), Settings())
        announce_trace(Picture.of(image), Settings(time_budget=9.0))
    assert ["tracing its 2.2 megapixels takes about 9 s" in message for message in caplog.messages] == [True]


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


def test_a_trace_that_is_stopped_is_one_of_few_pixels(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(draft, "QUICK_PIXELS", 1000)
    image, stops = draw(LOGO), itertools.count()
    run = Run(lambda: pytest.fail("a trace needs no device"), stop=lambda: next(stops) >= 4)
    made = draft.trace_in_time(image, None, None, 1.0, Settings(), run).scene
    assert (made.points == 4 * trace(boxed(image, 4)).scene.points).all()


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
