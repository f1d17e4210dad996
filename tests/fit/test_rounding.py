"""Rounding in stages: what is held at each, which grid is taken, and what a run leaves."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.fit.pictures import picture
from tests.scenes import mixed_scene
from warpsplat.fit import rounding
from warpsplat.fit.export import export
from warpsplat.fit.loop import fit
from warpsplat.fit.rounding import STAGES, choose_grid, hold_stage, stage_at
from warpsplat.fit.schedule import phases
from warpsplat.fit.settings import Settings, make_settings
from warpsplat.fit.state import FitState
from warpsplat.fit.step import Step, Target
from warpsplat.render.backend import Backend
from warpsplat.render.renderer import render
from warpsplat.scene import OPACITY_RANGE, Basis, FloatArray, Kind, Scene
from warpsplat.svg.read import load_scene
from warpsplat.svg.write import GRIDS, rounded


def step_for(scene: Scene, device: str, settings: Settings, image: FloatArray | None = None) -> Step:
    """At the finest size, after a few steps."""
    state = FitState.start(scene, Backend.on(device), np.random.default_rng(0))
    image = picture() if image is None else image
    step = Step(state, settings, Target(image, phases(settings, 64, 48)[-1]))
    for _ in range(3):
        step.advance()
    return step


@pytest.mark.parametrize("iterations", [4, 7, 60, 1000, 2000])
def test_stages_come_once_each_in_order_before_the_end(iterations: int) -> None:
    settings = make_settings(iterations=iterations)
    found = {step: stage_at(settings, step) for step in range(iterations)}
    due = {step: stage for step, stage in found.items() if stage is not None}
    assert list(due.values()) == list(range(STAGES))
    gaps = np.diff([*due, iterations])
    assert (gaps == gaps[0]).all(), "as many steps after each"


@pytest.mark.parametrize("stage", range(STAGES))
def test_a_stage_rounds_and_holds_its_share(device: str, stage: int) -> None:
    """Stage 0: opacities. Then the points 0, 3, 6 ... of each shape, those after them, those before."""
    step = step_for(mixed_scene(64, 48), device, make_settings(iterations=100))
    state = step.state
    state.per_pixel = 2.0
    before = state.scene()
    low = rounded(before, 2.0)
    hold_stage(step, stage)
    after = state.scene()
    number = np.concatenate([np.arange(n) for n in before.point_counts()])
    held = number % 3 < stage
    np.testing.assert_array_equal(after.points[held], low.points[held])
    np.testing.assert_array_equal(after.points[~held], before.points[~held])
    if stage == 0:
        opaque = after.opacities == np.float32(OPACITY_RANGE[1])
        assert (before.opacities[opaque] >= rounding.NEARLY_OPAQUE).all()
        np.testing.assert_array_equal(after.opacities[~opaque], low.opacities[~opaque])
    else:
        np.testing.assert_array_equal(after.opacities, before.opacities)
    for _ in range(3):
        step.advance()
    moved = state.scene()
    np.testing.assert_array_equal(moved.points[held], after.points[held])
    assert held.all() or (moved.points[~held] != after.points[~held]).any(axis=1).mean() > 0.8
    assert (moved.opacities == after.opacities).all() == (stage == 0)
    assert (moved.colors != after.colors).any()


@pytest.mark.parametrize("staged", [True, False])
@pytest.mark.parametrize("loss", [0.003, 0.01, 0.1])
def test_the_coarsest_grid_within_the_loss(
    device: str, staged: bool, loss: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Measured anew, by renders of the rounded scene."""
    monkeypatch.setattr(rounding, "LOSS", loss)
    start = mixed_scene(64, 48, seed=1)
    noise = np.random.default_rng(0).normal(0, 0.1, (48, 64, 3))
    image = (render(start, backend=Backend.on(device)) + noise).astype(np.float32)
    step = step_for(start, device, make_settings(iterations=100), image)
    scene = step.state.scene()
    grid = choose_grid(step, staged=staged)

    def error(points: np.ndarray) -> float:
        shown = render(replace(scene, points=points), backend=step.renderer.backend)
        return float(((shown - image) ** 2).mean(dtype=np.float64))

    before = error(scene.points)
    allowed = before * (10 ** (loss / 10) - 1) / (rounding.STAGED if staged else 1)
    costs = {g: error(rounded(scene, g).points) - before for g in GRIDS}
    assert grid == next(g for g, cost in costs.items() if cost <= allowed)
    assert GRIDS[0] < grid < GRIDS[-1], "a loss that decides something"
    np.testing.assert_array_equal(step.state.scene().points, scene.points)


@pytest.mark.parametrize(("precision", "finest"), [(None, GRIDS[-1]), (0, 1), (1, 10), (2, 100), (3, 1000)])
def test_no_grid_is_finer_than_the_precision(
    device: str, precision: int | None, finest: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """However little may be lost; where much may be, the precision does not matter."""
    settings = make_settings(iterations=100, precision=precision)
    step = step_for(mixed_scene(64, 48), device, settings)
    monkeypatch.setattr(rounding, "LOSS", -1000.0)
    assert choose_grid(step, staged=False) == finest
    monkeypatch.setattr(rounding, "LOSS", 1000.0)
    assert choose_grid(step, staged=False) == GRIDS[0]


@pytest.mark.parametrize("kind", list(Kind))
@pytest.mark.parametrize("basis", list(Basis))
def test_a_run_ends_with_what_the_file_holds(device: str, kind: Kind, basis: Basis) -> None:
    settings = make_settings(kind=kind, basis=basis, curves=10, iterations=60)
    made = fit(picture(), settings, Backend.on(device))
    held = rounded(made.scene, made.per_pixel)
    np.testing.assert_array_equal(made.scene.points, held.points)
    opaque = made.scene.opacities == np.float32(OPACITY_RANGE[1])
    np.testing.assert_array_equal(made.scene.opacities[~opaque], held.opacities[~opaque])
    assert (held.opacities[opaque] == 1).all()
    back, _ = load_scene(export(made.scene, settings, made.per_pixel), 64, 48, "a.svg")
    np.testing.assert_array_equal(back.basis, made.scene.basis)
    if (back.first == held.first).all():
        np.testing.assert_allclose(back.points, held.points, rtol=3e-7, atol=1e-6)
    else:  # cubics without extent are left out
        assert basis == Basis.CUBIC


@pytest.mark.parametrize("iterations", [1, 2, 3, 4, 5, 6])
@pytest.mark.parametrize("precision", [0, 1])
def test_runs_of_few_steps_keep_to_the_precision(device: str, iterations: int, precision: int) -> None:
    settings = make_settings(curves=6, iterations=iterations, precision=precision)
    made = fit(picture(), settings, Backend.on(device))
    assert made.per_pixel <= 10**precision
