"""Smooth shading: which parts are cut into bands, and what the bands show."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from tests.drawing.trace.drawings import decibels
from warpsplat.drawing.trace.seeds import noise_of
from warpsplat.drawing.trace.trace import trace
from warpsplat.rendering.renderer import render
from warpsplat.scene import FloatArray


def square(top: int, bottom: int, left: int, right: int, value: float) -> FloatArray:
    """A square on nothing, 96 px."""
    shade = np.zeros((96, 96), np.float32)
    shade[top:bottom, left:right] = value
    return shade


@pytest.mark.parametrize(
    ("shade", "place", "color"),
    [
        (cv2.GaussianBlur(square(24, 80, 20, 76, 0.5), (0, 0), 4), np.s_[20:72, 20:76], (0.2, 0.4, 0.9)),
        (cv2.GaussianBlur(square(28, 76, 24, 72, 0.6), (0, 0), 6), np.s_[24:72, 24:72], (0.98, 0.98, 0.98)),
    ],
)
def test_a_soft_shadow_is_a_few_bands(
    shade: FloatArray, place: tuple[slice, slice], color: tuple[float, ...]
) -> None:
    """Cuts that gain nothing at first are made: the halves of a ring of shade are no nearer to a gradient."""
    tone = np.repeat(1 - shade[..., None], 3, axis=2)
    tone[place] = color
    image = np.round(tone * 255).astype(np.float32) / 255
    scene = trace(image).scene
    assert 6 <= len(scene) <= 30
    assert decibels(render(scene), image) > 36  # a single gradient reaches 28


def test_shading_of_many_hues_is_not_cut_into_patches() -> None:
    y, x = np.mgrid[:64, :64] / np.float32(64)
    image = np.round(np.stack([1 - x / 2, 0.5 + y / 2, x / 3], axis=2) * 255).astype(np.float32) / 255
    assert len(trace(image).scene) <= 2


def test_a_shadow_that_fades_away_is_kept() -> None:
    """On a transparent ground, where it goes over into nothing."""
    shade = square(40, 80, 20, 76, 0.5)
    image = np.zeros((96, 96, 4), np.float32)
    image[..., 3] = np.round(cv2.GaussianBlur(shade, (0, 0), 5) * 255) / 255
    image[20:64, 20:76] = (0.2, 0.4, 0.9, 1)
    shown = render(trace(image).scene)
    assert shown.shape[2] == 4
    assert np.sqrt(np.square(255 * (shown - image)[..., 3]).mean()) < 3
    assert shown[:8].max() == 0, "nothing is painted where nothing was"


def test_a_slope_is_no_noise_but_grain_is() -> None:
    ramp = np.round(np.broadcast_to(np.linspace(0, 240, 80)[:, None], (80, 80, 3)))
    image = np.concatenate([ramp, np.full((80, 80, 1), 255.0)], axis=2).astype(np.float32)
    assert noise_of(image) < 0.5
    image[..., :3] += np.random.default_rng(0).normal(0, 4, (80, 80, 1))
    assert noise_of(image) > 3
    coarse = np.kron(2 * np.random.default_rng(0).integers(0, 2, (40, 40)), np.ones((2, 2)))
    image[..., :3] = 100 + coarse[..., None]  # steps of a scaled picture differ by no more than they are
    assert noise_of(image) == 2


def test_a_map_without_flat_areas_has_no_noise_but_a_noisy_one_has() -> None:
    """Every pixel is beside an edge, and some of its steps are small."""
    colors = np.array([(90, 30, 20), (100, 120, 30), (110, 150, 60)], np.float32)
    image = np.full((32, 32, 4), 255, np.float32)
    image[..., :3] = colors[np.random.default_rng(0).integers(0, 3, (32, 32))]
    assert noise_of(image) < 1
    image[..., :3] += np.round(np.random.default_rng(0).normal(0, 4, (32, 32, 1)))
    assert noise_of(image) > 3


def test_what_is_uneven_on_one_ground_only_is_no_noise() -> None:
    opacity = np.random.default_rng(0).normal(128, 6, (80, 80, 1)).astype(np.float32)
    assert noise_of(np.repeat(opacity, 4, axis=2)) < 0.01  # white, not seen on white
    dirt = np.concatenate([np.repeat(opacity / 2, 3, axis=2), opacity], axis=2)
    assert noise_of(dirt) > 1
