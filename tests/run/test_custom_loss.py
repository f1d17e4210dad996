"""Losses of the user's own, from the first step to the file."""

from __future__ import annotations

import functools
from collections.abc import Callable
from types import FunctionType, ModuleType
from typing import Any

import numpy as np
import pytest

import warpsplat
from tests.fit.pictures import picture, step_for
from tests.run.helpers import CLEAR, PICTURE, Both, fitted, slopes
from tests.scenes import random_scene
from warpsplat import CustomLoss
from warpsplat.alpha import squares
from warpsplat.errors import UsageError
from warpsplat.fit.custom_loss import uses_torch
from warpsplat.fit.export import export, shown_image
from warpsplat.fit.rounding import evaluate_file
from warpsplat.fit.schedule import CHECK_INTERVAL
from warpsplat.fit.settings import make_settings
from warpsplat.fit.step import Step
from warpsplat.scene import FloatArray, Kind, Scene
from warpsplat.svg.viewer import on_white, render_svg
from warpsplat.svg.write import write_svg


def squared(image: FloatArray, target: FloatArray) -> Both:
    """The squared error; with opacity the mean of those on black and on white."""
    error = image - target
    gradient = 2 * error / error[..., :3].size
    if error.shape[2] == 4:
        white = error[..., :3] - error[..., 3:]
        mean = (error[..., :3] + white) / error[..., :3].size
        gradient = np.concatenate([mean, -white.sum(axis=2, keepdims=True) / error[..., :3].size], axis=2)
    return squares(error) / 3, gradient


def red(image: FloatArray, target: FloatArray) -> Both:
    """The squared error of red."""
    error = (image - target) * np.array([1, 0, 0], np.float32)
    return np.square(error[..., 0]), 2 * error / error[..., 0].size


def shown(result: warpsplat.Result) -> FloatArray:
    return np.asarray(on_white(render_svg(result.svg)) / 255, np.float32)


@pytest.mark.parametrize("loss", [slopes, "edges", "ssim"])
def test_removal_costs_are_near_those_of_finite_removal(device: str, loss: Any) -> None:
    """Also where those of the squared error are not."""
    custom = CustomLoss(loss, with_target=True) if callable(loss) else None
    settings = make_settings(loss=None if custom else loss, texture=0.0)
    scene = random_scene(Kind.FILL, count=24, width=64, height=48, seed=2)
    step = step_for(scene, picture(), device, settings, loss=custom)
    step.renderer.forward_complete()
    before, estimated, costs = step.objective.value(), step.objective.quadratic().removal_costs(), []
    for i in range(len(scene)):
        opacities = scene.opacities.copy()
        opacities[i] = 0
        step.state.parameters.assign(Scene(**{**vars(scene), "opacities": opacities}))
        step.renderer.forward()
        costs.append(step.objective.value() - before)
    assert np.corrcoef(estimated, costs)[0, 1] > 0.9
    square = step.renderer.removal_costs(step.loss_target.target)
    assert np.corrcoef(square, costs)[0, 1] < 0.2 or not custom


def test_a_loss_falls_further_than_without_it(device: str) -> None:
    """Measured on the file, which is one."""
    values = []
    for loss in ("l2", CustomLoss(red, with_target=True)):
        result = fitted(loss, device=device, subject="photo")
        assert result.score and result.score.paths == 10
        values.append(float(red(shown(result), PICTURE)[0].mean()))
    assert values[1] < 0.8 * values[0], "over five seeds 0.21 to 0.59 times"


@pytest.mark.parametrize(("given", "begun"), [((), 28), ((1.0,), 0), ((0.0, True, False, 0.2), 12)])
def test_when_a_loss_begins(given: tuple[Any, ...], begun: int) -> None:
    """One that replaces the squared error is evaluated once before half of the steps, for its faults."""
    progress, seen = [0], list[int]()

    def watching(image: FloatArray, target: FloatArray = PICTURE) -> Both:
        seen.append(progress[-1])
        return squared(image, target)

    fitted(CustomLoss(watching, *given), callback=lambda made: progress.append(made.step))
    early = [step for step in seen if step + CHECK_INTERVAL <= begun]
    assert len(early) == (begun > 0) and len(seen) >= 56 - begun


@pytest.mark.parametrize("factor", [1024, 1 / 1024])
def test_a_loss_of_any_scale_takes_over(factor: float) -> None:
    """Over four seeds 0.6 dB more to 1.3 dB less; with moments of the squared error up to 7 dB less."""

    def scaled(image: FloatArray, target: FloatArray) -> Both:
        value, gradient = squared(image, target)
        return factor * value, factor * gradient

    one, other = (fitted(CustomLoss(each, with_target=True)).score for each in (squared, scaled))
    assert one and other and other.psnr > one.psnr - 2.5


OPTIONS: dict[str, dict[str, Any]] = {
    "transparent": {"image": CLEAR},
    "layered": {"curves": None, "levels": (4, 12), "iterations": 28},
    "palette": {"colors": 4},
    "paint": {"paint": "auto"},
    "open": {"open": True},
    "splat": {"renderer": "splat"},
    "bytes": {"max_bytes": 1200, "curves": 34, "iterations": 16},
    "time": {"time_budget": 2.0, "iterations": 2000},
    "joins": {"loss": CustomLoss(squared, 1.0, with_target=True)},
}


@pytest.mark.parametrize("kind", OPTIONS)
def test_with_other_options(kind: str) -> None:
    """The loss sees images of as many planes as the target, in [0, 1]."""
    seen = []

    def watching(image: FloatArray, target: FloatArray) -> Both:
        assert image.shape == target.shape and image.dtype == target.dtype == np.float32
        seen.append((image.min(), image.max(), image.shape[2]))
        return squared(image, target)

    result = fitted(**{"loss": CustomLoss(watching, with_target=True), **OPTIONS[kind]})
    assert result.score and result.score.psnr > 12
    assert all(low >= 0 and high <= 1 for low, high, _ in seen)
    assert {planes for *_, planes in seen} <= {4 if kind == "transparent" else 3}


def test_a_loss_sees_what_a_viewer_shows(device: str) -> None:
    """Once the file is evaluated; in the step after, that is what is shown of the same shapes."""
    seen: list[FloatArray] = []

    def watching(image: FloatArray) -> Both:
        seen.append(image)
        return 0.0, np.zeros_like(image)

    scene, settings = random_scene(Kind.FILL, count=6, width=64, height=48, seed=1), make_settings()
    step: Step = step_for(scene, picture(), device, settings, loss=CustomLoss(watching))
    evaluate_file(step)
    text = export(step.state.scene(), settings, step.state.per_pixel)
    step.advance()
    np.testing.assert_allclose(seen[-1], shown_image(text, scene, 3), atol=1e-6)


def bad(image: FloatArray) -> Both:
    raise ValueError("no idea\nwhat to do")


ZEROS = np.zeros_like
FAULTS: dict[str, tuple[Callable[[FloatArray], Any], str]] = {
    "raises": (bad, "the loss raised ValueError: no idea"),
    "nan": (lambda image: (np.nan, ZEROS(image)), "the loss is nan"),
    "shape": (lambda image: (np.zeros(7), ZEROS(image)), r"the loss's value has shape \(7,\)"),
    "flat gradient": (lambda image: (0.0, np.zeros(7)), r"the loss's gradient has shape \(7,\), not the"),
    "infinite gradient": (lambda image: (1.0, ZEROS(image) + np.inf), "gradient has numbers that are not"),
    "no gradient": (lambda image: 0.5, "the loss returned 0.5, without a gradient"),
    "no number": (lambda image: ("much", ZEROS(image)), "the loss returned 'much', which is not a number"),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_is_one_clear_line(fault: str) -> None:
    function, message = FAULTS[fault]
    with pytest.raises(UsageError, match=message) as caught:
        fitted(CustomLoss(function))
    assert "\n" not in str(caught.value)


REFUSED: list[tuple[Callable[[], object], str]] = [
    (lambda: fitted(CustomLoss(slopes), subject="drawing"), "subject drawing and a loss function"),
    (lambda: fitted("edgy"), "loss must be one of l2, ssim, edges, not 'edgy'"),
    (lambda: fitted("ssim", image=CLEAR, subject="photo"), "loss ssim needs an image without transparency"),
    (lambda: fitted("edges", subject="pixel"), "subject pixel and loss edges cannot be combined"),
    (lambda: CustomLoss(3), "a loss is a function of a render, not 3"),
    (lambda: CustomLoss(slopes, -1), "squared_error must be a number from 0, not -1"),
    (lambda: CustomLoss(slopes, begin=2), "begin must be a number from 0 to 1, not 2"),
]


@pytest.mark.parametrize(("call", "message"), REFUSED)
def test_refusals(call: Callable[[], object], message: str) -> None:
    with pytest.raises(UsageError, match=message):
        call()


def test_refining_is_judged_by_the_loss(device: str) -> None:
    """A loss that wants another picture than the image: the PSNR falls, and the result is kept."""
    text = write_svg(random_scene(Kind.FILL, count=6, width=48, height=36, seed=3))
    start = np.asarray(on_white(render_svg(text)) / 255, np.float32)
    loss = CustomLoss(functools.partial(squared, target=1 - start), torch=False)
    result = warpsplat.refine(text, start, iterations=30, device=device, loss=loss)
    assert result.before is not None and result.score and result.score.psnr < result.before
    assert squared(shown(result), 1 - start)[0].mean() < squared(start, 1 - start)[0].mean()


def test_functions_of_torch_are_told_by_their_file() -> None:
    def in_file(**names: Any) -> Any:
        return FunctionType(slopes.__code__, {"__builtins__": {}, **names})

    torch = ModuleType("torch.nn.functional")
    assert not uses_torch(slopes)
    assert not uses_torch(in_file(np=np))
    assert uses_torch(in_file(functional=torch))
    assert uses_torch(functools.partial(in_file(functional=torch), target=0))
    layer = type("Layer", (), {"__call__": in_file(F=torch), "method": in_file(F=torch)})()
    assert uses_torch(layer) and uses_torch(layer.method)


def test_a_target_of_a_fixed_size_is_told_of_with_target() -> None:
    """Renders are smaller in most of a run."""
    fixed = picture(64, 48)

    settings = make_settings(curves=4, iterations=10, coarse_pixels=300, subject="photo")
    for given, told in ({}, True), ({"with_target": True}, False):
        loss = CustomLoss(lambda image, *_: squared(image, fixed), begin=0.0, **given)
        with pytest.raises(UsageError, match="the loss raised ValueError: ") as caught:
            warpsplat.vectorize(fixed, settings=settings, device="cpu", loss=loss)
        assert ("with_target=True" in str(caught.value)) == told
