"""Rounding in stages, and outlines drawn back from what is empty."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from tests.fit.pictures import picture, step_for
from tests.scenes import CURVES, disc, mixed_scene, random_scene, started_alike
from tests.svg.foreign import load_scene
from warpsplat.fit import rounding
from warpsplat.fit.clear import clear_empty
from warpsplat.fit.export import export
from warpsplat.fit.loop import fit
from warpsplat.fit.problem import Problem, Run
from warpsplat.fit.rounding import (
    choose_grid,
)
from warpsplat.fit.settings import make_settings
from warpsplat.rendering.backend import Backend
from warpsplat.rendering.models import ExactModel
from warpsplat.rendering.renderer import render
from warpsplat.scene import OPACITY_RANGE, Basis, Canvas, Kind, Scene
from warpsplat.svg.viewer import premultiplied, render_own
from warpsplat.svg.write import GRIDS, rounded

SETTINGS = make_settings()
OPAQUE = np.float32(OPACITY_RANGE[1])


@pytest.mark.parametrize("staged", [True, False])
@pytest.mark.parametrize("loss", [0.003, 0.01, 0.03])
def test_the_coarsest_grid_within_the_loss(
    device: str, staged: bool, loss: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Against renders of the rounded scene."""
    monkeypatch.setattr(rounding, "MAX_LOSS", loss)
    start = mixed_scene(64, 48, seed=1)
    noise = np.random.default_rng(0).normal(0, 0.1, (48, 64, 3))
    image = (render(start, backend=Backend.on(device)) + noise).astype(np.float32)
    step = step_for(start, image, device, make_settings(iterations=100))
    for _ in range(3):
        step.advance()
    scene = step.state.scene()
    grid = choose_grid(step, staged=staged)

    def error(points: np.ndarray) -> float:
        model = ExactModel(slack=step.target.slack)
        shown = render(replace(scene, points=points), model=model, backend=step.renderer.backend)
        return float(((shown - image) ** 2).mean(dtype=np.float64))

    before = error(scene.points)
    allowed = before * (10 ** (loss / 10) - 1) / (rounding.STAGED_COST if staged else 1)
    costs = {g: error(rounded(scene, g).points) - before for g in GRIDS}
    assert grid == next(g for g, cost in costs.items() if cost <= allowed)
    assert GRIDS[0] < grid < GRIDS[-1], "a loss that decides something"
    np.testing.assert_array_equal(step.state.scene().points, scene.points)


@pytest.mark.parametrize("kind", list(Kind))
@pytest.mark.parametrize("basis", CURVES)
def test_the_final_scene_equals_the_file(device: str, kind: Kind, basis: Basis) -> None:
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


def shown(scene: Scene) -> np.ndarray:
    return premultiplied(render_own(export(scene, SETTINGS, 10.0))) / 255


def test_outlines_are_drawn_back_no_further_than_needed(device: str) -> None:
    scene = replace(disc(12, 40, 20), canvas=Canvas(40, 40, None))
    target = shown(replace(scene, points=20 + (scene.points - 20) * np.float32(11.3 / 12)))
    empty = target[..., 3] == 0
    assert shown(scene)[empty].any()
    cleared = clear_empty(scene, target, SETTINGS, Run(Backend.on(device)), 10.0)
    assert not shown(cleared)[empty].any()
    assert np.abs(cleared.points - scene.points).max() < 1.5
    late = Run(Backend.on(device), deadline=-math.inf)
    assert clear_empty(scene, target, SETTINGS, late, 10.0) is scene


def test_a_clear_scene_stays_as_it_is(device: str) -> None:
    scene = random_scene(Kind.FILL, 5, basis=Basis.SPLINE)
    scene = replace(scene, canvas=Canvas(40, 36, None))
    cleared = clear_empty(scene, shown(scene), SETTINGS, Run(Backend.on(device)), 10.0)
    np.testing.assert_array_equal(cleared.points, rounded(scene, 10.0).points)
