"""What a further loss takes: a function in one of the two tuples of ``fit/losses.py``."""

from __future__ import annotations

import numpy as np
import pytest

from tests.fit.pictures import picture
from tests.kernels import trials
from warpsplat.fit import losses
from warpsplat.fit.loop import Fit, fit
from warpsplat.fit.losses import LossInputs
from warpsplat.fit.problem import Problem, Run
from warpsplat.fit.settings import Settings, make_settings
from warpsplat.rendering.backend import Backend
from warpsplat.rendering.parameters import Parameters
from warpsplat.rendering.program import Program
from warpsplat.rendering.renderer import render


def record_blue(program: Program, inputs: LossInputs) -> None:
    program.launch(
        trials.blue_backward,
        inputs.renderer.viewport.tile_count,
        inputs.renderer.film.buffers,
        inputs.aim,
        weight=2.0,
        split=True,
    )


def record_thin(program: Program, parameters: Parameters, settings: Settings) -> None:
    program.launch(
        trials.thin_backward,
        parameters.shape_count,
        parameters.arrays,
        weight=1.0 / settings.curves,
        split=True,
    )


def short_fit(device: str) -> Fit:
    return fit(Problem(picture(), make_settings(curves=8, iterations=40)), Run(Backend.on(device)))


def test_a_loss_of_the_image_changes_what_is_fitted(device: str, monkeypatch: pytest.MonkeyPatch) -> None:
    before = render(short_fit(device).scene, backend=Backend.on(device)).mean(axis=(0, 1))
    monkeypatch.setattr(losses, "IMAGE_LOSSES", (*losses.IMAGE_LOSSES, record_blue))
    after = render(short_fit(device).scene, backend=Backend.on(device)).mean(axis=(0, 1))
    # Over five seeds 0.27 to 0.37 more blue, and up to 0.05 more or less of the others.
    assert after[2] > before[2] + 0.1
    np.testing.assert_allclose(after[:2], before[:2], atol=0.15)


def test_a_loss_of_the_shapes_changes_what_is_fitted(device: str, monkeypatch: pytest.MonkeyPatch) -> None:
    before = short_fit(device).scene.opacities
    monkeypatch.setattr(losses, "SHAPE_LOSSES", (*losses.SHAPE_LOSSES, record_thin))
    after = short_fit(device).scene.opacities
    assert after.mean() < before.mean() - 0.05, "over five seeds 0.27 to 0.37 less"
