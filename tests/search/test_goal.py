"""The search for a file that meets a goal, and files of few shapes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.fit.pictures import picture
from tests.scenes import disc, random_scene
from warpsplat.fit.loop import fit
from warpsplat.fit.problem import Fit, Problem, Run
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


def test_a_file_with_a_surplus_is_cut_and_one_that_lacks_grows(scene: Scene) -> None:
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


def test_the_ground_is_what_shows_between_shapes(device: str) -> None:
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
def test_what_is_less_than_a_shape_goes_by_points(excess: float) -> None:
    scene = random_scene(Kind.FILL, count=6, basis=Basis.SPLINE)
    sizes = path_sizes(scene, 1.0)
    seen = np.arange(1, 7, dtype=np.float32)
    left = smaller(scene, seen, sizes, excess)
    gone = sizes.sum() - path_sizes(left, 1.0).sum()
    assert 0 < gone < excess + sizes.mean() / 3
    assert len(scene) - len(left) == (np.cumsum(sizes) <= excess).sum()
