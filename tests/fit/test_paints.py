"""Runs with gradients: where they are worth their bytes, and their files."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.fit.pictures import picture, step_for
from tests.runs import vectorize
from tests.scenes import random_scene, with_stops
from warpsplat.fit.paints import choose_paints
from warpsplat.fit.settings import make_settings
from warpsplat.metrics import psnr
from warpsplat.rendering.backend import Backend
from warpsplat.rendering.renderer import render
from warpsplat.run.result import Result
from warpsplat.scene import Basis, Canvas, FloatArray, Kind, Paint, Scene
from warpsplat.svg.read import load_scene
from warpsplat.svg.viewer import on_white, render_own


def sky() -> FloatArray:
    """From dark blue to yellow."""
    t = np.broadcast_to(np.linspace(0, 1, 64, dtype=np.float32)[:, None, None], (64, 80, 1))
    ends = np.array([[0.1, 0.2, 0.9], [1.0, 0.9, 0.2]], np.float32)
    return (1 - t) * ends[0] + t * ends[1]


def stripes(grey: float) -> Scene:
    """The upper half of an image in this grey, the lower half in as many stripes as make a usual file."""
    heights = np.array([32] + [2] * 16)
    x, y = np.array([(0, 0), (0, 1), (1, 1), (1, 0)]).T
    corners = np.stack([120 * x - 20 + 0 * heights[:, None], y * heights[:, None]], axis=2)
    corners[..., 1] += np.cumsum([0, *heights[:-1]])[:, None]
    sides = [corners + (np.roll(corners, -1, axis=1) - corners) * along for along in (0, 1 / 3, 2 / 3)]
    greys = np.array([grey] + [0, 0.2] * 8)
    return Scene.uniform(
        Kind.FILL,
        Canvas(80, 64, np.ones(3, np.float32)),
        np.stack(sides, axis=2).reshape(17, 12, 2).astype(np.float32),
        Basis.CUBIC,
        colors=np.repeat(greys[:, None], 3, axis=1).astype(np.float32),
        opacities=np.ones(17, np.float32),
    )


def run(image: FloatArray, device: str, **options: object) -> Result:
    settings = make_settings("draft", **{"curves": 12, "iterations": 160} | options)
    return vectorize(image, settings, Backend.on(device))


def test_auto_paints_a_sky_with_ramps(device: str) -> None:
    flat, auto = (run(sky(), device, paint=paint) for paint in ("flat", "auto"))
    assert flat.score and auto.score
    assert (flat.scene.paint == Paint.FLAT).all()
    assert (auto.scene.paint != Paint.FLAT).any()
    assert "Gradient" not in flat.svg
    assert auto.score.psnr > flat.score.psnr + 1, "over five seeds 8 to 12 dB more"


@pytest.mark.parametrize("ramp", [0.0, 0.3])
def test_auto_paints_flat_what_is_flat(device: str, ramp: float) -> None:
    """Shapes in their places, one of them in a wrong colour, or where the target brightens to the right."""
    settings = make_settings("draft", paint="auto", curves=17)
    scene = stripes(0.5)
    target = render(stripes(0.5 if ramp else 0.7), backend=Backend.on(device)).copy()
    target[:32] += np.float32(ramp) * np.linspace(-1, 1, 80, dtype=np.float32)[:, None]
    step = step_for(scene, target, device, settings)
    step.render()
    choose_paints(step)
    assert (step.state.scene().paint != Paint.FLAT).tolist() == [ramp > 0] + [False] * 16


@pytest.mark.parametrize("kind", [Paint.LINEAR, Paint.RADIAL])
def test_one_kind(device: str, kind: Paint) -> None:
    """The file is read back, and a viewer shows it as we do."""
    result = run(picture(), device, paint=kind.name.lower(), iterations=80)
    scene = result.scene
    assert set(scene.paint.tolist()) <= {Paint.FLAT, kind}
    assert (scene.paint == kind).any()
    assert result.svg.count(f"<{kind.name.lower()}Gradient ") > 0
    again, _ = load_scene(result.svg, 64, 48, "run")
    assert (np.bincount(again.paint, minlength=3) == np.bincount(scene.paint, minlength=3)).all()
    # One circle each: no matrix.
    assert "matrix" not in result.svg
    shown = on_white(render_own(result.svg))
    assert psnr(255 * render(again, backend=Backend.on(device)), shown) > 35, "42 to 47 dB over five seeds"


def test_a_circle_stays_one_in_training(device: str) -> None:
    scene = with_stops(random_scene(Kind.FILL, 6, 64, 48, seed=1), seed=2)
    frames = scene.frames.copy()
    frames[:4, 4:] = np.stack([-frames[:4, 3], frames[:4, 2]], axis=1)
    scene = replace(scene, frames=frames)
    step = step_for(scene, picture(), device)
    for _ in range(5):
        step.advance()
    moved = step.state.scene().frames
    round_ = (scene.paint == Paint.RADIAL) & (np.arange(6) < 4)
    assert round_.sum() == 2
    assert (np.abs(moved - frames)[round_, :4] > 0.1).all()
    np.testing.assert_array_equal(moved[round_, 4], -moved[round_, 3])
    np.testing.assert_array_equal(moved[round_, 5], moved[round_, 2])
