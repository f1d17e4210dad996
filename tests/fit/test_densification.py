"""Shapes that come and go between steps, and those whose numbers are not finite."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import warpsplat
from tests.fit.pictures import picture, step_for
from tests.run.helpers import after
from tests.scenes import random_scene, with_gradients
from warpsplat.errors import UsageError
from warpsplat.fit.densification import recover
from warpsplat.fit.loop import fit
from warpsplat.fit.problem import Problem, Run
from warpsplat.fit.progress import Progress
from warpsplat.fit.settings import make_settings
from warpsplat.fit.step import Step
from warpsplat.rendering.backend import Backend
from warpsplat.rendering.program import Launch
from warpsplat.rendering.renderer import render
from warpsplat.scene import ATTRIBUTES, Kind, Scene
from warpsplat.svg.write import write_svg

CURVES = 12
USUAL = {"curves": CURVES, "iterations": 100, "seed": 1, "subject": "photo", "device": "cpu"}
LATE = 62
"""Steps after which such runs have their whole surplus."""


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


def test_figures_of_a_stopped_run_match_its_scene(device: str) -> None:
    target = picture()
    settings = make_settings(curves=CURVES, iterations=100, seed=1)
    made = fit(Problem(target, settings), Run(Backend.on(device), stop=after(LATE)), rounding=None)
    error = np.square(render(made.scene, backend=Backend.on(device)) - target).mean()
    assert made.render_psnr == pytest.approx(-10 * np.log10(error), abs=0.1)
    assert made.estimated_psnr == pytest.approx(made.render_psnr, abs=0.1)


SETTINGS = make_settings(curves=6, iterations=100)
BROKEN = 2
"""The shape whose numbers are spoiled."""


def scene_of(what: str) -> Scene:
    scene = random_scene(Kind.STROKE if what == "strokes" else Kind.FILL, 6, width=64, height=48, seed=3)
    return with_gradients(scene) if what == "gradients" else scene


def step_of(scene: Scene) -> Step:
    """Return an advanced step of two threads, which is replayed launch by launch."""
    step = step_for(scene, picture(), settings=SETTINGS, threads=2)
    step.advance()
    return step


def poison(step: Step, name: str, where: str) -> None:
    """Spoil one number of shape ``BROKEN``: now, or a gradient just before the next updates."""
    group = step.state.parameters.groups[name]
    row = int(np.flatnonzero(group.owner.numpy() == BROKEN)[0])
    array = getattr(group, where)

    def spoil() -> None:
        values = array.numpy().copy()
        values[row, 0] = np.nan if where != "moment2" else np.inf
        array.assign(values)

    if where == "grad":
        step.programs[-1].launches.insert(0, Launch("update", "spoil", (spoil,)))
    else:
        spoil()


def all_finite(step: Step) -> bool:
    parameters = step.state.parameters
    return not parameters.invalid().any() and bool(np.isfinite(step.renderer.read_image()).all())


CASES = [
    *(("fills", name) for name in ("points", "colors", "opacities")),
    *(("strokes", name) for name in ("points", "widths", "colors")),
    *(("gradients", name) for name in ("points", "frames", "stop_colors")),
]


@pytest.mark.parametrize("where", ["value", "moment1", "moment2", "grad"])
@pytest.mark.parametrize(("what", "name"), CASES)
def test_a_spoiled_shape_is_reset(what: str, name: str, where: str) -> None:
    first = scene_of(what)
    step = step_of(first)
    poison(step, name, where)
    step.advance()
    recorded = step.renderer
    recover(step, replaces=False)
    assert step.renderer is recorded
    assert step.state.renewed == 1
    assert all_finite(step)
    scene = step.state.scene()
    for attribute in ATTRIBUTES:
        rows = scene.rows(attribute, np.array([BROKEN]))
        got, wanted = getattr(scene, attribute.name)[rows], getattr(first, attribute.name)[rows]
        np.testing.assert_array_equal(got, wanted)
    ages = step.state.parameters.arrays["ages"].numpy()
    assert ages[BROKEN] == 0 and (np.delete(ages, BROKEN) == 2).all()
    if where == "grad":
        del step.programs[-1].launches[0]
    step.advance()
    recover(step, replaces=False)
    assert step.renderer is recorded and step.state.renewed == 1, "it is over"
    assert all_finite(step)


def test_twins_are_reset_together() -> None:
    fill = random_scene(Kind.FILL, 2, width=64, height=48, seed=5)
    stroke = replace(fill, kind=np.ones(2, np.int32), widths=np.full(2, 3, np.float32))
    scene = fill.append(stroke).take(np.array([0, 2, 1, 3]))
    step = step_of(replace(scene, twin=np.array([0, 1, 0, 1], np.int32)))
    poison(step, "points", "value")
    step.advance()
    recover(step, replaces=False)
    assert step.state.renewed == 2
    made = step.state.scene()
    np.testing.assert_array_equal(made.points_of(2), made.points_of(3))


@pytest.mark.parametrize("at", [10, 60, 90, 100])
def test_a_run_survives_and_counts(at: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """While the number of shapes grows, while coordinates are rounded, and at the last step."""
    advance = Step.advance
    image = picture()

    def spoiled(self: Step) -> None:
        advance(self)
        if self.state.step == at:
            poison(self, "colors", "value")

    monkeypatch.setattr(Step, "advance", spoiled)
    told: list[Progress] = []
    made = fit(Problem(image, replace(SETTINGS, curves=9)), Run(Backend.on("cpu", 1), told.append))
    assert made.renewed == 1
    assert np.isfinite([made.render_psnr, made.estimated_psnr]).all()
    assert write_svg(made.scene, per_pixel=made.per_pixel)
    for name in ("points", "colors", "opacities"):
        values = getattr(made.scene, name).copy()
        values[-1] = np.inf
        with pytest.raises(UsageError, match=rf"shape \d: {name} with a number that is not finite"):
            write_svg(replace(made.scene, **{name: values}))
