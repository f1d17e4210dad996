"""Rounding in stages: what is held at each, which grid is taken, and what a run leaves."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import numpy as np
import pytest

from tests.fit.pictures import picture
from tests.scenes import mixed_scene, random_scene, started_alike
from warpsplat.fit import rounding
from warpsplat.fit.export import export
from warpsplat.fit.loop import fit
from warpsplat.fit.problem import Problem, Run
from warpsplat.fit.rate import DB_PER_DOUBLING, byte_worth
from warpsplat.fit.rounding import STAGES, choose_grid, hold_opacities, hold_stage, opacities_at, stage_at
from warpsplat.fit.schedule import phases
from warpsplat.fit.settings import Settings, make_settings
from warpsplat.fit.state import FitState
from warpsplat.fit.step import Step, Target
from warpsplat.rendering.backend import Backend
from warpsplat.rendering.models import ExactModel
from warpsplat.rendering.renderer import render
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
    assert list(due.values()) == list(range(1, STAGES + 1))
    gaps = np.diff([*due, iterations])
    assert (gaps == gaps[0]).all(), "as many steps after each"


@pytest.mark.parametrize("stage", range(1, STAGES + 1))
def test_a_stage_rounds_and_holds_its_share(device: str, stage: int) -> None:
    """The points 0, 3, 6 ... of each shape, then those after them, then those before; all widths at once."""
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
    np.testing.assert_array_equal(after.widths, low.widths)
    assert (after.widths != before.widths).any()
    for name in ("opacities", "colors"):
        np.testing.assert_array_equal(getattr(after, name), getattr(before, name))
    for _ in range(3):
        step.advance()
    moved = state.scene()
    np.testing.assert_array_equal(moved.points[held], after.points[held])
    assert held.all() or (moved.points[~held] != after.points[~held]).any(axis=1).mean() > 0.8
    np.testing.assert_array_equal(moved.widths, after.widths)
    assert (moved.opacities != after.opacities).any()
    assert (moved.colors != after.colors).any()


OPAQUE = np.float32(OPACITY_RANGE[1])


def opacity_step(device: str) -> Step:
    """Shapes of which the image has all but one, and that one it does not show."""
    scene = mixed_scene(64, 48)
    hidden = random_scene(Kind.FILL, 1, 64, 48, seed=9)
    hidden = replace(hidden, points=hidden.points - np.float32(1000))
    image = render(scene, backend=Backend.on(device))
    noise = np.random.default_rng(0).normal(0, 0.02, image.shape)
    image = (image + noise).astype(np.float32)
    return step_for(scene.append(hidden), device, make_settings(iterations=100), image)


def test_opacities_are_held_at_tenths_or_opaque(device: str) -> None:
    step = opacity_step(device)
    state = step.state
    before = state.scene()
    hold_opacities(step)
    after = state.scene()
    opaque = after.opacities == OPAQUE
    assert opaque[-1], "nobody sees it: it is worth no byte"
    assert not opaque.all(), "others are"
    wanted = np.clip(np.round(before.opacities[~opaque].astype(np.float64), 1), 0.1, OPACITY_RANGE[1])
    np.testing.assert_array_equal(after.opacities[~opaque], wanted.astype(np.float32))
    for name in ("points", "colors", "widths"):
        np.testing.assert_array_equal(getattr(after, name), getattr(before, name))
    for _ in range(3):
        step.advance()
    moved = state.scene()
    np.testing.assert_array_equal(moved.opacities, after.opacities)
    assert (moved.colors != after.colors).any()
    assert (moved.points != after.points).any()


@pytest.mark.parametrize(("worth", "all_opaque"), [(0.0, False), (1e6, True)])
def test_the_worth_of_a_byte_decides_what_is_opaque(
    device: str, worth: float, all_opaque: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    step = opacity_step(device)
    before = step.state.scene().opacities
    monkeypatch.setattr(rounding, "byte_worth", lambda square_error, size: worth)
    hold_opacities(step)
    opaque = step.state.scene().opacities == OPAQUE
    assert (opaque == (all_opaque | (before > 0.95))).all()


@pytest.mark.parametrize("opacity", [0.02, 0.051, 0.149, 0.5])
def test_no_opacity_is_rounded_away(device: str, opacity: float, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(rounding, "byte_worth", lambda square_error, size: 0.0)
    step = opacity_step(device)
    scene = step.state.scene()
    step.state.parameters.assign(replace(scene, opacities=np.full(len(scene), opacity, np.float32)))
    hold_opacities(step)
    np.testing.assert_array_equal(step.state.scene().opacities, np.float32(max(0.1, round(opacity, 1))))


@pytest.mark.parametrize("iterations", [7, 60, 1000, 2000])
@pytest.mark.parametrize("quality", ["draft", "balanced"])
def test_opacities_are_held_once_shapes_stay_and_before_all_else(
    iterations: int, quality: Literal["draft", "balanced"]
) -> None:
    settings = make_settings(quality, iterations=iterations)
    at = opacities_at(settings)
    first = min(step for step in range(iterations) if stage_at(settings, step) is not None)
    assert 0 < at <= first
    if iterations >= 60:
        assert at > settings.density.stop * iterations
        assert at > settings.coarse * iterations


def test_a_byte_is_worth_what_more_shapes_gain() -> None:
    """From ``size`` bytes to twice as many the error falls by so many decibels; scales with both."""
    size, error, done = 1000, 1.0, 0
    value = error
    for done in range(size, 2 * size):
        value -= byte_worth(value, done)
    assert 10 * np.log10(error / value) == pytest.approx(DB_PER_DOUBLING, rel=2e-3)
    assert byte_worth(3.0, 500) == pytest.approx(3 * byte_worth(1.0, 500))
    assert byte_worth(1.0, 500) == pytest.approx(2 * byte_worth(1.0, 1000))


@pytest.mark.parametrize("staged", [True, False])
@pytest.mark.parametrize("loss", [0.003, 0.01, 0.03])
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
        model = ExactModel(slack=step.target.slack)
        shown = render(replace(scene, points=points), model=model, backend=step.renderer.backend)
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
    made = fit(Problem(picture(), settings), Run(Backend.on(device)))
    held = rounded(made.scene, made.per_pixel)
    np.testing.assert_array_equal(made.scene.points, held.points)
    np.testing.assert_array_equal(made.scene.widths, held.widths)
    opaque = made.scene.opacities == OPAQUE
    np.testing.assert_array_equal(made.scene.opacities[~opaque], held.opacities[~opaque])
    assert set(held.opacities[~opaque].tolist()) <= {float(np.float32(n / 10)) for n in range(1, 10)}
    assert (held.opacities[opaque] == 1).all()
    back, _ = load_scene(export(made.scene, settings, made.per_pixel), 64, 48, "a.svg")
    np.testing.assert_array_equal(back.basis, made.scene.basis)
    if (back.first == held.first).all():
        np.testing.assert_allclose(started_alike(back, held).points, held.points, rtol=3e-7, atol=1e-6)
    else:  # cubics without extent are left out
        assert basis == Basis.CUBIC


@pytest.mark.parametrize("iterations", [1, 2, 3, 4, 5, 6])
@pytest.mark.parametrize("precision", [0, 1])
def test_runs_of_few_steps_keep_to_the_precision(device: str, iterations: int, precision: int) -> None:
    settings = make_settings(curves=6, iterations=iterations, precision=precision)
    made = fit(Problem(picture(), settings), Run(Backend.on(device)))
    assert made.per_pixel <= 10**precision
