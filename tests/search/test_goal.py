"""The search for a file that meets a goal, and fits that continue from each other."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.fit.pictures import picture
from tests.scenes import disc, random_scene
from warpsplat.fit.loop import fit
from warpsplat.fit.problem import Fit, Problem, Run
from warpsplat.fit.progress import Progress
from warpsplat.fit.schedule import shapes_at
from warpsplat.fit.settings import Settings, make_settings
from warpsplat.rendering.backend import Backend
from warpsplat.rendering.renderer import render
from warpsplat.scene import Basis, Kind, Scene
from warpsplat.search.candidate import (
    Candidate,
    Change,
    fit_background,
    smaller,
)
from warpsplat.search.goal import AIM_FULL, next_change
from warpsplat.search.series import Series, begin_of
from warpsplat.svg.write import path_sizes


@pytest.fixture(scope="module")
def scene() -> Scene:
    return fit(Problem(picture(), make_settings(curves=8, iterations=10)), Run(Backend.on("cpu"))).scene


def made(scene: Scene, size: int, psnr: float, per_pixel: float = 2.0) -> Candidate:
    return Candidate(Fit(scene, per_pixel, psnr, psnr, 10, interrupted=False), size, psnr)


def goal(**given: object) -> Settings:
    return make_settings(curves=100, **given)


def size_of(change: Change | None) -> float:
    assert change
    return change.size


def test_a_file_better_than_its_goal_shrinks_and_a_worse_one_grows(scene: Scene) -> None:
    settings = goal(target_psnr=27.0)
    small = size_of(next_change([made(scene, 10_000, 27.1)], settings))
    smaller = size_of(next_change([made(scene, 10_000, 27.2)], settings))
    assert smaller < small < 10_000
    assert size_of(next_change([made(scene, 10_000, 26.9)], settings)) > 10_000
    assert next_change([made(scene, 10_000, 27.02)], settings) is None


def test_a_cut_that_failed_bounds_the_next_change(scene: Scene) -> None:
    tried = [made(scene, 10_000, 27.2), made(scene, 9_000, 26.9)]
    change = next_change(tried, goal(target_psnr=27.0))
    assert change
    assert change.base is tried[0]
    assert 9_000 < change.size < 10_000
    tried.append(made(scene, 9_970, 26.99))
    assert next_change(tried, goal(target_psnr=27.0)) is None, "nothing is left between"


def test_a_file_within_a_size_is_filled_or_cut_to_it(scene: Scene) -> None:
    settings = goal(max_bytes=10_000)
    assert size_of(next_change([made(scene, 9_500, 27)], settings)) == AIM_FULL * 10_000
    assert size_of(next_change([made(scene, 10_500, 27)], settings)) == AIM_FULL * 10_000
    assert next_change([made(scene, 9_900, 27)], settings) is None
    both = [made(scene, 9_000, 27), made(scene, 10_100, 28)]
    change = next_change(both, settings)
    assert change
    assert change.base is both[1], "what is too large by little is nearer"


def test_without_more_shapes_the_grid_gets_finer(scene: Scene) -> None:
    few = make_settings(curves=8, target_psnr=27.0)
    change = next_change([made(scene, 1000, 26.0, 2.0)], few)
    assert change
    assert change.per_pixel == 4.0
    assert next_change([made(scene, 1000, 26.0, 100.0)], few) is None


def test_the_background_is_fitted_to_what_shows_between_shapes(device: str) -> None:
    backend = Backend.on(device)
    scene = disc(10, 30, 15)
    wanted = np.array([0.2, 0.6, 0.8], np.float32)
    on_wanted = replace(scene, canvas=replace(scene.canvas, background=wanted))
    image = render(on_wanted, backend=backend)
    found = fit_background(scene, image, backend).canvas.background
    assert found is not None
    np.testing.assert_allclose(found, wanted, atol=0.51 / 255)
    assert scene.canvas.background is not None
    assert np.abs(scene.canvas.background - wanted).max() > 0.1, "it was another one"


@pytest.mark.parametrize("excess", [10, 60, 200])
def test_small_excess_is_removed_by_points(excess: float) -> None:
    scene = random_scene(Kind.FILL, count=6, basis=Basis.SPLINE)
    sizes = path_sizes(scene, 1.0)
    seen = np.arange(1, 7, dtype=np.float32)
    left = smaller(scene, seen, sizes, excess)
    gone = sizes.sum() - path_sizes(left, 1.0).sum()
    assert 0 < gone < excess + sizes.mean() / 3
    assert len(scene) - len(left) == (np.cumsum(sizes) <= excess).sum()


@pytest.mark.parametrize(("few", "share"), [(10, 0.25), (128, 0.275), (180, 0.35), (250, 0.375)])
def test_a_fit_begins_where_its_schedule_has_as_many_shapes(few: int, share: float) -> None:
    settings = make_settings(curves=256)
    begin = begin_of(settings, round(1.5 * few))
    assert begin == pytest.approx(1000 * share, abs=25) and begin % 25 == 0
    if few == 180:
        assert shapes_at(settings, begin) == pytest.approx(1.5 * few, rel=0.1)


def quick() -> Settings:
    return make_settings(
        subject="photo", iterations=60, curves=4, coarse_pixels=400, density={"interval": 3}, viewer=False
    )


def test_the_next_fit_continues_optimizer_state() -> None:
    """The first step of another fit is the next one of the first: the optimizer forgot nothing."""
    settings, seen = quick(), list[Progress]()
    run, series = Run(Backend.on("cpu", 1), seen.append), Series(quick(), (4, 8))
    first, none = series.next(4)
    assert none is None
    fit(Problem(picture(), first), series.part(4, run))
    assert [p.work for p in seen] == sorted(p.work for p in seen)
    assert seen[-1].work == pytest.approx(1 / 3)
    second, start = series.next(8)
    assert start is not None and start.past is not None and start.scene is not None
    assert start.begin == begin_of(second, 6) > 0
    assert len(start.scene) == round(1.5 * 4), "the surplus, before it is thinned"
    assert start.past.ages.max() >= 0.6 * settings.iterations
    moments = start.past.moments[1]["points"]
    assert moments.shape == start.scene.points.shape and (moments > 0).any()
    made = fit(Problem(picture(), second), series.part(8, run), start)
    assert len(made.scene) == 8
    assert made.iterations == settings.iterations - start.begin
    assert seen[-1].work == 1
