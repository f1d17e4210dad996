from __future__ import annotations

import math
from dataclasses import replace

import pytest

from warpsplat.fit.schedule import (
    phase_at,
    phases,
    shapes_at,
)
from warpsplat.fit.settings import QUALITIES, Quality, Settings, make_settings


def test_phases() -> None:
    settings = make_settings(iterations=100, coarse=0.4)
    coarse, fine = plan = phases(settings, 768, 512)
    assert coarse.width * coarse.height <= 1.01 * settings.coarse_pixels
    assert (fine.width, fine.height) == (768, 512)
    tolerances = [phase.slack / phase.width for phase in plan]
    assert tolerances[0] > tolerances[1] > 0, "the last steps see the curves of the file more closely"
    assert [plan.index(phase_at(settings, plan, step)) for step in range(100)] == [0] * 40 + [1] * 60
    assert len(phases(settings, 100, 80)) == 1
    large = phases(settings, 8000, 6000)[-1]
    assert large.width * large.height <= 1.01 * settings.fine_pixels


@pytest.mark.parametrize(
    ("width", "height"),
    [(1080, 2400), (3000, 4000), (2480, 3508), (1920, 1080), (1200, 1600), (600, 8000), (8, 40000)],
)
@pytest.mark.parametrize("quality", QUALITIES)
def test_one_scale_serves_both_sides(width: int, height: int, quality: Quality) -> None:
    for phase in phases(make_settings(quality), width, height):
        scale = phase.width / width
        assert abs(height * scale - phase.height) < 0.5
        assert phase.width * phase.height <= width * height


def densification_steps(settings: Settings) -> list[int]:
    """Return the steps after which there is densification; 0 for the start."""
    density = settings.density
    return list(range(0, math.ceil(density.stop * settings.iterations), density.interval))


@pytest.mark.parametrize("quality", QUALITIES)
@pytest.mark.parametrize("iterations", [1, 26, 30, 60, 100, 101, 333, 1000])
def test_all_shapes_and_no_more_are_there_in_the_end(quality: Quality, iterations: int) -> None:
    settings = make_settings(quality, curves=90, iterations=iterations)
    assert shapes_at(settings, densification_steps(settings)[-1]) == 90
    without = replace(settings, density=replace(settings.density, interval=0))
    assert shapes_at(without, 0) == 90
