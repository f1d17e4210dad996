"""Quality by the number of shapes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.fit.pictures import picture
from warpsplat.fit.problem import Problem, Run
from warpsplat.fit.settings import make_settings
from warpsplat.rendering.backend import Backend
from warpsplat.search.survey import BEND, STEEPEST, expected, lost_detail, survey


def test_it_goes_through_what_was_measured() -> None:
    """The gains of longer runs are added."""
    worth = expected(1024, (256, 30.0), (64, 25.0), 0.4, 30_000)
    there = float(worth.psnr(256))
    assert there == pytest.approx(30.4)
    assert there - float(worth.psnr(64)) == pytest.approx(2 * 0.79 * 2.5)
    gains = [float(worth.psnr(2 * n) - worth.psnr(n)) for n in (16, 32, 64, 128, 256, 512)]
    assert np.diff(gains) == pytest.approx(2 * BEND)
    assert float(worth.size(512)) == pytest.approx(2 * 0.93 * 30_000)


@pytest.mark.parametrize("few", [10.0, 29.9, 31.0])
def test_more_shapes_are_never_worse(few: float) -> None:
    worth = expected(1024, (256, 30.0), (64, few), 0.0, 30_000)
    decibels = worth.psnr(np.geomspace(16, 1024, 50))
    assert (np.diff(decibels) >= -1e-9).all()
    assert float(decibels[-1] - decibels[0]) < 6 * STEEPEST + 16 * BEND


def test_detail_that_the_finest_size_lacks() -> None:
    image = np.random.default_rng(0).random((32, 32, 3), dtype=np.float32)
    assert lost_detail(image, make_settings()) == 0
    lost = lost_detail(image, make_settings(fine_pixels=256, coarse_pixels=256))
    assert lost > 0.03
    worth = expected(1024, (256, 40.0), (64, 35.0), 0.0, 30_000)
    assert float(worth.psnr(256)) == pytest.approx(40)
    assert float(replace(worth, detail=lost).psnr(256)) < -10 * np.log10(lost)


def test_survey(monkeypatch: pytest.MonkeyPatch) -> None:
    """More shapes are better and larger; what is asked to stop stops."""
    monkeypatch.setattr("warpsplat.search.survey.SHORT_STEPS", 60)
    monkeypatch.setattr("warpsplat.search.survey.SHORT_INTERVAL", 10)
    backend = Backend.on("cpu", 1)
    work: list[float] = []
    problem = Problem(picture(), make_settings())
    worth = survey(problem, Run(backend, lambda now: work.append(now.work)))
    assert worth is not None
    assert worth.most == 64 * 48 // 8
    assert float(worth.psnr(200)) > float(worth.psnr(50))
    assert float(worth.size(200)) > 2 * float(worth.size(50))
    assert work == sorted(work) and work[-1] == 1
    assert survey(problem, Run(backend, stop=lambda: True)) is None
