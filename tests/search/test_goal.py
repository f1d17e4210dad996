"""The next change on the way to a goal, and the effects of changes."""

from __future__ import annotations

import numpy as np
import pytest

from tests.fit.pictures import picture
from warpsplat.fit.export import export
from warpsplat.fit.loop import Fit, Rounding, Start, fit
from warpsplat.fit.problem import Problem, Run
from warpsplat.fit.settings import Settings, make_settings
from warpsplat.rendering.backend import Backend
from warpsplat.scene import Scene
from warpsplat.search.candidate import Candidate, Change
from warpsplat.search.goal import AIM_FULL, curves_for, next_change
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


def test_shapes_that_a_probe_run_needs() -> None:
    assert curves_for(26.8, {256: 25.0}, 10_000) == 512, "twice the shapes for 1.8 dB"
    assert curves_for(24.0, {256: 25.0, 128: 23.0}, 10_000) in {181, 182}, "between two, by those"
    assert curves_for(60.0, {256: 25.0}, 1000) == 1000


def test_a_run_can_be_entered_late(scene: Scene) -> None:
    settings = make_settings(curves=8, iterations=100)
    start = Start(scene=scene, begin=90)
    late = fit(Problem(picture(), settings), Run(Backend.on("cpu")), start, Rounding(4.0))
    assert late.iterations == 10
    assert late.per_pixel == 4.0
    half = late.scene.points * 2
    assert np.abs(half - np.round(half)).max() < 1e-5, "all stages of rounding were done"


def test_sizes_of_paths_are_those_in_the_file(scene: Scene) -> None:
    whole = len(export(scene, Settings(), 4.0))
    for i in (0, 5):
        without = len(export(scene.take(np.delete(np.arange(8), i)), Settings(), 4.0))
        assert whole - without == path_sizes(scene, 4.0)[i]
