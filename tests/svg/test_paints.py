"""Gradients and transparent canvases as viewers show them."""

from __future__ import annotations

import io
from dataclasses import replace

import numpy as np
import pytest
import resvg_py
from PIL import Image

from tests.scenes import mixed_scene, random_scene, with_gradients
from warpsplat.rendering.backend import Backend
from warpsplat.rendering.renderer import render
from warpsplat.scene import Canvas, Kind, Paint
from warpsplat.svg.write import rounded, write_svg


def shown(svg: str) -> np.ndarray:
    """Premultiplied sRGB and opacity in [0, 1], as resvg draws it."""
    image = Image.open(io.BytesIO(bytes(resvg_py.svg_to_bytes(svg_string=svg)))).convert("RGBA")
    values = np.asarray(image, np.float64) / 255
    values[..., :3] *= values[..., 3:]
    return values


def decibels(a: np.ndarray, b: np.ndarray) -> float:
    return float(-10 * np.log10(np.mean((a - b) ** 2)))


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("clear", [False, True])
def test_a_viewer_shows_what_we_render(device: str, seed: int, clear: bool) -> None:
    scene = with_gradients(mixed_scene(80, 70, seed=seed), seed=seed)
    if clear:
        scene = replace(scene, canvas=Canvas(80, 70, None))
    mine = render(rounded(scene, 10), backend=Backend.on(device)).astype(np.float64)
    theirs = shown(write_svg(scene, per_pixel=10))
    assert decibels(mine, theirs if clear else theirs[..., :3]) > 38


def test_alike_gradients_are_written_once() -> None:
    scene = with_gradients(random_scene(Kind.FILL, 3))
    text = write_svg(scene.take(np.array([0, 0, 1, 2])))
    assert text.count("<linearGradient") == text.count("<radialGradient") == 1
    assert text.count("url(#g0)") == 1, "said by the group of both"


def test_the_line_of_a_skewed_frame_is_straight_across(device: str) -> None:
    """Where the second axis is not at a right angle, lines of equal colour run along it."""
    scene = with_gradients(random_scene(Kind.FILL, 2, seed=3), seed=2)
    frames = scene.frames.copy()
    frames[0] = [20, 18, 8, 3, 5, 9]
    paint = np.array([Paint.LINEAR, Paint.FLAT], np.int32)
    scene = replace(scene, frames=frames, paint=paint)
    mine = render(rounded(scene, 10), backend=Backend.on(device)).astype(np.float64)
    assert decibels(mine, shown(write_svg(scene, per_pixel=10))[..., :3]) > 38
