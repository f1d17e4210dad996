"""Runs that end while they train more shapes than were asked for."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import warpsplat
from tests.fit.pictures import picture
from warpsplat.fit.budget import Budget
from warpsplat.fit.loop import fit
from warpsplat.fit.problem import Problem, Run
from warpsplat.fit.schedule import Phase
from warpsplat.fit.settings import make_settings
from warpsplat.fit.state import FitState
from warpsplat.fit.step import Step, Target
from warpsplat.fit.surgery import thin
from warpsplat.rendering.backend import Backend
from warpsplat.rendering.renderer import render
from warpsplat.scene import Canvas, Kind, Scene

CURVES = 12
USUAL = {"curves": CURVES, "iterations": 100, "seed": 1, "subject": "photo", "device": "cpu"}
LATE = 62
"""A step at which runs of so many have their whole surplus."""


def after(count: int) -> Callable[[], bool]:
    """A wish to stop after so many steps."""
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


def test_so_has_one_whose_time_is_up(monkeypatch: pytest.MonkeyPatch) -> None:
    over = after(LATE)
    monkeypatch.setattr(Budget, "over", lambda self: over())
    monkeypatch.setattr(
        Budget, "fit", lambda self, settings, done, slowness: replace(settings, iterations=100)
    )
    result = warpsplat.vectorize(picture(), time_budget=600, **USUAL)
    assert not result.stopped
    assert max(now.shapes for now in result.history) > CURVES
    assert len(result.scene) == CURVES


def test_what_a_checkpoint_keeps_has_its_surplus(tmp_path: Path) -> None:
    path = tmp_path / "run.checkpoint"
    stopped = warpsplat.vectorize(picture(), checkpoint=path, stop=after(LATE), **USUAL)
    assert len(stopped.scene) == CURVES
    resumed = warpsplat.vectorize(picture(), checkpoint=path, resume=True, **USUAL)
    assert resumed.svg == warpsplat.vectorize(picture(), **USUAL).svg


def test_the_figures_are_those_of_what_is_left(device: str) -> None:
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


def thinned(scene: Scene, count: int, base: int, device: str) -> Scene:
    """``scene`` with ``count`` shapes, against its own picture."""
    backend, settings = Backend.on(device), make_settings(curves=count, iterations=10)
    state = FitState.start(scene, backend, np.random.default_rng(0), base=base)
    target = Target(render(scene, backend=backend), Phase(64, 48))
    return thin(Step(state, settings, target), count).state.scene()


def test_of_shapes_that_hide_each_other_one_stays(device: str) -> None:
    """None of the two is missed while the other is there."""
    scene = discs((16, 16, 12), (16, 16, 12), (44, 12, 3), (44, 36, 5))
    left = thinned(scene, 2, 0, device)
    assert len(left) == 2
    assert sorted(left.points[left.starts[:-1], 0].round()) == [28, 49]


def test_shapes_of_earlier_levels_stay(device: str) -> None:
    scene = discs((44, 12, 2), (16, 16, 12), (44, 36, 5))
    np.testing.assert_array_equal(thinned(scene, 2, 1, device).points, scene.take(np.array([0, 1])).points)
