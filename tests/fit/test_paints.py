"""Runs with gradients: where they are worth their bytes, and what their files hold."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.fit.pictures import picture
from tests.scenes import random_scene, with_two_stops
from warpsplat.errors import UsageError
from warpsplat.fit.schedule import Phase
from warpsplat.fit.settings import Settings, make_settings
from warpsplat.fit.state import FitState
from warpsplat.fit.step import Step, Target
from warpsplat.jobs.result import Result
from warpsplat.jobs.vectorize import vectorize
from warpsplat.metrics import psnr
from warpsplat.rendering.backend import Backend
from warpsplat.rendering.renderer import render
from warpsplat.scene import FloatArray, Kind, Paint
from warpsplat.svg.read import load_scene
from warpsplat.svg.viewer import on_white, render_own


def sky() -> FloatArray:
    """From dark to light blue, with a dark hill."""
    y, x = np.mgrid[:64, :80].astype(np.float32)
    t = (y / 64)[..., None]
    image = (1 - t) * np.array([0.1, 0.3, 0.8]) + t * np.array([0.9, 0.85, 0.6])
    image[y > 50 + 0.01 * (x - 40) ** 2] = [0.1, 0.2, 0.1]
    return image.astype(np.float32)


def flags() -> FloatArray:
    """Plain colours."""
    y, x = np.mgrid[:64, :80]
    image = np.full((64, 80, 3), 0.9, np.float32)
    image[y < 20] = [0.8, 0.1, 0.1]
    image[np.hypot(x - 40, y - 38) < 15] = [0.1, 0.2, 0.6]
    return image


def run(image: FloatArray, device: str, **options: object) -> Result:
    settings = make_settings("draft", **{"curves": 12, "iterations": 160} | options)
    return vectorize(image, settings, Backend.on(device))


def test_flat_is_the_default() -> None:
    assert Settings().paint == "flat"
    assert make_settings(paint="flat") == make_settings()


def test_auto_paints_a_sky_with_ramps(device: str) -> None:
    flat, auto = (run(sky(), device, paint=paint) for paint in ("flat", "auto"))
    assert flat.score and auto.score
    assert (flat.scene.paint == Paint.FLAT).all()
    assert (auto.scene.paint != Paint.FLAT).any()
    assert "Gradient" not in flat.svg
    assert auto.score.psnr > flat.score.psnr + 1


def test_auto_paints_a_flat_drawing_flat(device: str) -> None:
    """Now and then a ramp is worth its bytes where a shape spills over an edge."""
    files = [run(flags(), device, paint="auto", seed=seed).svg for seed in (2, 3, 4)]
    assert sum("Gradient" in file for file in files) <= 1


@pytest.mark.parametrize("kind", [Paint.LINEAR, Paint.RADIAL])
def test_one_kind(device: str, kind: Paint) -> None:
    """What is made is read back, and a viewer shows it as we do."""
    result = run(picture(), device, paint=kind.name.lower(), iterations=80)
    scene = result.scene
    assert set(scene.paint.tolist()) <= {Paint.FLAT, kind}
    assert (scene.paint == kind).sum() >= 4
    assert result.svg.count(f"<{kind.name.lower()}Gradient ") >= 4
    again, _ = load_scene(result.svg, 64, 48, "run")
    assert (np.bincount(again.paint, minlength=3) == np.bincount(scene.paint, minlength=3)).all()
    # One circle each: no matrix.
    assert "matrix" not in result.svg
    shown = on_white(render_own(result.svg))
    assert psnr(255 * render(again, backend=Backend.on(device)), shown) > 40


def test_a_circle_stays_one_in_training(device: str) -> None:
    scene = with_two_stops(random_scene(Kind.FILL, 6, 64, 48, seed=1), seed=2)
    frames = scene.frames.copy()
    frames[:4, 4:] = np.stack([-frames[:4, 3], frames[:4, 2]], axis=1)
    scene = replace(scene, frames=frames)
    state = FitState.start(scene, Backend.on(device), np.random.default_rng(0))
    step = Step(state, make_settings(), Target(picture(), Phase(64, 48)))
    for _ in range(5):
        step.advance()
    moved = state.scene().frames
    round_ = (scene.paint == Paint.RADIAL) & (np.arange(6) < 4)
    assert round_.sum() == 2
    assert (np.abs(moved - frames)[round_, :4] > 0.1).all()
    np.testing.assert_array_equal(moved[round_, 4], -moved[round_, 3])
    np.testing.assert_array_equal(moved[round_, 5], moved[round_, 2])


def test_soft_gaussians_have_no_gradients() -> None:
    with pytest.raises(UsageError, match="gaussian needs the paint flat"):
        make_settings(renderer="gaussian", paint="auto")
