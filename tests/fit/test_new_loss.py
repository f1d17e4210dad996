"""A further loss is an object in one of the two lists of ``fit/losses.py``."""

from __future__ import annotations

import numpy as np
import pytest

from tests.fit.pictures import picture
from tests.kernels import trials
from warpsplat.fit import losses
from warpsplat.fit.loop import fit
from warpsplat.fit.losses import Loss, LossInputs
from warpsplat.fit.problem import Problem, Run
from warpsplat.fit.settings import make_settings
from warpsplat.rendering.backend import Backend
from warpsplat.rendering.program import Program
from warpsplat.rendering.renderer import render
from warpsplat.scene import Scene


def launch_blue(program: Program, inputs: LossInputs, weight: float) -> None:
    renderer = inputs.renderer
    kernel, tiles = trials.make_blue_backward(renderer.backend.column), renderer.viewport.tile_count
    program.launch(kernel, tiles, renderer.film.buffers, inputs.target, weight=weight, split=True)


def launch_thin(program: Program, inputs: LossInputs, weight: float) -> None:
    shapes = inputs.renderer.parameters
    program.launch(trials.thin_backward, shapes.shape_count, shapes.arrays, weight=weight, split=True)


def fits(device: str, monkeypatch: pytest.MonkeyPatch, name: str, loss: Loss) -> list[Scene]:
    """A short fit without and one with the loss."""
    problem, scenes = Problem(picture(), make_settings(curves=8, iterations=40)), []
    for further in ((), (loss,)):
        monkeypatch.setattr(losses, name, (*getattr(losses, name), *further))
        scenes.append(fit(problem, Run(Backend.on(device))).scene)
    return scenes


def test_an_image_loss(device: str, monkeypatch: pytest.MonkeyPatch) -> None:
    scenes = fits(device, monkeypatch, "IMAGE_LOSSES", Loss(lambda *_: 2.0, launch_blue, "more blue"))
    before, after = (render(scene, backend=Backend.on(device)).mean(axis=(0, 1)) for scene in scenes)
    # Over five seeds 0.27 to 0.37 more blue, and up to 0.05 more or less of the others.
    assert after[2] > before[2] + 0.1
    np.testing.assert_allclose(after[:2], before[:2], atol=0.15)


def test_a_shape_loss(device: str, monkeypatch: pytest.MonkeyPatch) -> None:
    loss = Loss(lambda inputs: 1.0 / inputs.settings.curves, launch_thin, "thinner shapes")
    before, after = fits(device, monkeypatch, "SHAPE_LOSSES", loss)
    assert after.opacities.mean() < before.opacities.mean() - 0.05, "over five seeds 0.27 to 0.37 less"
