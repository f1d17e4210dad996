"""Gradients and transparent canvases as viewers show them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.scenes import mixed_scene, random_scene, with_gradients
from warpsplat.metrics import psnr
from warpsplat.rendering.backend import Backend
from warpsplat.rendering.renderer import render
from warpsplat.scene import Canvas, Kind, Paint, Scene
from warpsplat.svg.viewer import premultiplied, render_own
from warpsplat.svg.write import rounded, write_svg


def likeness(scene: Scene, device: str) -> float:
    """Return the PSNR of our rendering and that of the file [dB]."""
    mine = render(rounded(scene, 10), backend=Backend.on(device)).astype(np.float64)
    shown = premultiplied(render_own(write_svg(scene, per_pixel=10)))
    return psnr(255 * mine, shown[..., : mine.shape[2]])


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("clear", [False, True])
def test_a_viewer_shows_what_we_render(device: str, seed: int, clear: bool) -> None:
    scene = with_gradients(mixed_scene(80, 70, seed=seed), seed=seed)
    if clear:
        scene = replace(scene, canvas=Canvas(80, 70, None))
    assert likeness(scene, device) > 38


def test_equal_gradients_are_written_once() -> None:
    scene = with_gradients(random_scene(Kind.FILL, 3))
    text = write_svg(scene.take(np.array([0, 0, 1, 2])))
    assert text.count("<linearGradient") == text.count("<radialGradient") == 1
    assert text.count("url(#g0)") == 1, "in the group of both"


def test_a_skewed_frame(device: str) -> None:
    """Lines of equal colour run along the second axis, which is not at a right angle."""
    scene = with_gradients(random_scene(Kind.FILL, 2, seed=3), seed=2)
    frames = scene.frames.copy()
    frames[0] = [20, 18, 8, 3, 5, 9]
    paint = np.array([Paint.LINEAR, Paint.FLAT], np.int32)
    assert likeness(replace(scene, frames=frames, paint=paint), device) > 38
