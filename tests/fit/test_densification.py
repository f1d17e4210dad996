"""Shapes and points that come and go between steps, and runs that end with a surplus of shapes."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import warpsplat
from tests.fit.pictures import picture, step_for
from tests.scenes import random_scene
from warpsplat.fit.densification import densify, remove_surplus
from warpsplat.fit.loop import fit
from warpsplat.fit.problem import Problem, Run
from warpsplat.fit.schedule import mean_points_at
from warpsplat.fit.settings import Density, make_settings
from warpsplat.fit.simplify import MIN_SPLINE_POINTS
from warpsplat.rendering.backend import Backend
from warpsplat.rendering.renderer import render
from warpsplat.scene import Basis, Canvas, Kind, Scene

CURVES = 12
USUAL = {"curves": CURVES, "iterations": 100, "seed": 1, "subject": "photo", "device": "cpu"}
LATE = 62
"""Steps after which such runs have their whole surplus."""


def test_points_follow_the_schedule(device: str) -> None:
    """The number of shapes and points is that of the schedule, and training goes on in between."""
    density = Density(interval=4, stop=1.0, mean_points=8.0, grown=0.1, start=1.0)
    settings = make_settings(curves=12, iterations=60, density=density)
    scene = random_scene(Kind.FILL, 12, 64, 48, basis=Basis.SPLINE)
    step = step_for(scene, picture(), device, settings)
    state = step.state
    while state.step < 56:
        for _ in range(4):
            step.advance()
        densify(step, grows=True)
        counts = state.scene().point_counts()
        assert counts.min() >= MIN_SPLINE_POINTS
        # New shapes come with all their points.
        assert counts.mean() < mean_points_at(settings, state.step) + 2
    assert len(counts) == 12
    assert counts.mean() == pytest.approx(8, abs=0.5)
    assert len(set(counts.tolist())) > 1
    step.advance()
    assert np.isfinite(step.psnr())
    densify(step, grows=False)
    assert len(state.scene()) == 12


def after(count: int) -> Callable[[], bool]:
    """Return a function that is true from its ``count``-th call on."""
    steps = itertools.count(1)
    return lambda: next(steps) >= count


@pytest.mark.parametrize(
    ("given", "stop", "most"),
    [
        ({}, LATE, CURVES),
        ({}, 80, CURVES),
        ({"open": True}, LATE, CURVES),
        ({"mixed": True}, LATE, CURVES),
        ({"paint": "auto"}, LATE, CURVES),
        ({"colors": 4}, LATE, CURVES),
        ({"renderer": "splat"}, LATE, CURVES),
        ({"renderer": "gaussian", "open": True}, LATE, CURVES),
        ({"curves": None, "levels": (6, 14), "iterations": 200}, 90, 6),
        ({"curves": None, "levels": (6, 14), "iterations": 200}, 150 + 140, 14),
        ({"max_bytes": 2000, "curves": CURVES}, LATE, CURVES),
    ],
    ids=str,
)
def test_a_run_that_is_stopped_has_the_shapes_asked_for(given: dict[str, Any], stop: int, most: int) -> None:
    result = warpsplat.vectorize(picture(), stop=after(stop), **{**USUAL, **given})
    assert result.stopped
    assert max(now.shapes for now in result.history) > most, "there was a surplus"
    assert len(result.scene) == most
    assert result.score
    assert result.score.paths == most
    if given.get("colors"):
        assert len(np.unique(result.scene.colors, axis=0)) <= 4


def test_figures_of_a_stopped_run_are_those_of_what_is_left(device: str) -> None:
    target = picture()
    settings = make_settings(curves=CURVES, iterations=100, seed=1)
    made = fit(Problem(target, settings), Run(Backend.on(device), stop=after(LATE)), rounding=None)
    error = np.square(render(made.scene, backend=Backend.on(device)) - target).mean()
    assert made.render_psnr == pytest.approx(-10 * np.log10(error), abs=0.1)
    assert made.estimated_psnr == pytest.approx(made.render_psnr, abs=0.1)


def discs(*each: tuple[float, float, float]) -> Scene:
    """White opaque discs on black: x, y, radius."""
    angles = np.arange(12) * np.pi / 6
    ring = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    points = np.stack([np.array([x, y]) + radius * ring for x, y, radius in each]).astype(np.float32)
    canvas = Canvas(64, 48, np.zeros(3, np.float32))
    white = np.ones((len(each), 3), np.float32)
    return Scene.uniform(Kind.FILL, canvas, points, colors=white, opacities=np.ones(len(each), np.float32))


@pytest.mark.parametrize(
    ("scene", "base", "left"),
    [
        # Neither of the first two is missed while the other one is there.
        (discs((16, 16, 12), (16, 16, 12), (44, 12, 3), (44, 36, 5)), 0, [1, 3]),
        (discs((44, 12, 2), (16, 16, 12), (44, 36, 5)), 1, [0, 1]),
    ],
    ids=["hidden", "earlier level"],
)
def test_the_surplus_that_is_removed(device: str, scene: Scene, base: int, left: list[int]) -> None:
    target, settings = render(scene, backend=Backend.on(device)), make_settings(curves=2, iterations=10)
    step = step_for(scene, target, device, settings, base=base)
    remove_surplus(step, 2)
    np.testing.assert_array_equal(step.state.scene().points, scene.take(np.array(left)).points)
