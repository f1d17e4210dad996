from __future__ import annotations

import pytest

from warpsplat.fit.schedule import fold_weight, opacity_threshold, phase_at, phases, shapes_at
from warpsplat.fit.settings import QUALITIES, Density, make_settings

DENSITY = Density()


def test_phases() -> None:
    settings = make_settings(iterations=100)
    coarse, fine = phases(settings, 768, 512)
    assert coarse.width * coarse.height <= 1.01 * settings.coarse_pixels
    assert (fine.width, fine.height) == (768, 512)
    assert coarse.slack > fine.slack == 1, "the last steps see the curves of the file"
    assert len(phases(settings, 100, 80)) == 1
    large = phases(settings, 8000, 6000)[-1]
    assert large.width * large.height <= 1.01 * settings.fine_pixels


@pytest.mark.parametrize(
    ("width", "height"),
    [(1080, 2400), (3000, 4000), (2480, 3508), (1920, 1080), (1200, 1600), (600, 8000), (8, 40000)],
)
def test_one_scale_serves_both_sides(width: int, height: int) -> None:
    for quality in QUALITIES:
        for phase in phases(make_settings(quality), width, height):
            scale = phase.width / width
            assert abs(height * scale - phase.height) < 0.5
            assert phase.width * phase.height <= width * height


def test_threshold_falls() -> None:
    values = [opacity_threshold(DENSITY, t) for t in (0, 0.3, DENSITY.stop, 1)]
    assert values[0] == DENSITY.opacity_start
    assert values[0] > values[1] > values[2]
    assert values[2] == values[3] == pytest.approx(DENSITY.opacity_end)


def test_the_number_of_curves_grows_to_all() -> None:
    settings = make_settings(curves=90, iterations=1000)
    counts = [shapes_at(settings, step) for step in range(0, 1000, 25)]
    assert counts[0] == 30
    assert counts == sorted(counts)
    assert counts[19] < 90
    assert set(counts[20:]) == {90}


@pytest.mark.parametrize("iterations", [1, 30, 60, 100])
def test_short_runs_have_all_shapes_at_the_last_turn(iterations: int) -> None:
    settings = make_settings(curves=90, iterations=iterations)
    turns = [s for s in range(25, iterations + 1, 25) if s < settings.density.stop * iterations]
    assert shapes_at(settings, turns[-1] if turns else 0) == 90


def test_coarse_first_then_fine() -> None:
    settings = make_settings(iterations=100, coarse=0.4)
    plan = phases(settings, 768, 512)
    found = [plan.index(phase_at(settings, plan, step)) for step in range(100)]
    assert found == [0] * 40 + [1] * 60


def test_the_fold_weight_grows_geometrically() -> None:
    settings = make_settings(iterations=100, fold_start=0.1, fold_end=10.0)
    assert [fold_weight(settings, n) for n in (0, 50, 100)] == pytest.approx([0.1, 1.0, 10.0])
