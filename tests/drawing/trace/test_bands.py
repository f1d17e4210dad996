"""Smooth shading: which parts are cut into bands, and what the bands show."""

from __future__ import annotations

import cv2
import numpy as np

from warpsplat.drawing.trace.bands import split_uneven
from warpsplat.drawing.trace.palette import paint_parts
from warpsplat.drawing.trace.ramps import fit_ramp
from warpsplat.drawing.trace.seeds import noise_of
from warpsplat.drawing.trace.trace import trace
from warpsplat.metrics import psnr
from warpsplat.rendering.renderer import render


def _shadow(side: int = 96) -> np.ndarray:
    """A square with a soft shadow below, sRGB in [0, 1]."""
    shade = np.zeros((side, side), np.float32)
    shade[24:80, 20:76] = 0.5
    tone = np.repeat(1 - cv2.GaussianBlur(shade, (0, 0), 4)[..., None], 3, axis=2)
    tone[20:72, 20:76] = (0.2, 0.4, 0.9)
    return np.round(tone * 255).astype(np.float32) / 255


def test_a_soft_shadow_is_a_few_bands() -> None:
    image = _shadow()
    scene = trace(image).scene
    assert 6 <= len(scene) <= 30
    assert psnr(255 * render(scene), 255 * image) > 36  # a single gradient reaches 28


def test_cuts_that_gain_nothing_at_first_are_made() -> None:
    """Both halves of a ring of shade are as far from a gradient as all of it."""
    shade = np.zeros((96, 96), np.float32)
    shade[28:76, 24:72] = 0.6
    tone = (1 - cv2.GaussianBlur(shade, (0, 0), 6)[..., None]) * np.array([0.87, 0.92, 0.96], np.float32)
    tone[24:72, 24:72] = 0.98
    image = np.round(tone * 255).astype(np.float32) / 255
    assert psnr(255 * render(trace(image).scene)[..., :3], 255 * image) > 36


def test_shading_of_many_hues_is_not_cut_into_patches() -> None:
    y, x = np.mgrid[:64, :64] / np.float32(64)
    image = np.round(np.stack([1 - x / 2, 0.5 + y / 2, x / 3], axis=2) * 255).astype(np.float32) / 255
    assert len(trace(image).scene) <= 2


def test_a_shadow_that_fades_away_is_kept() -> None:
    """On a transparent ground, where it goes over into nothing."""
    shade = np.zeros((96, 96), np.float32)
    shade[40:80, 20:76] = 0.5
    image = np.zeros((96, 96, 4), np.float32)
    image[..., 3] = np.round(cv2.GaussianBlur(shade, (0, 0), 5) * 255) / 255
    image[20:64, 20:76] = (0.2, 0.4, 0.9, 1)
    shown = render(trace(image).scene)
    assert shown.shape[2] == 4
    assert np.sqrt(np.square(255 * (shown - image)[..., 3]).mean()) < 3
    assert shown[:8].max() == 0, "nothing is painted where nothing was"


def test_a_linear_gradient_stays_one_gradient() -> None:
    ramp = np.linspace(0.2, 0.9, 64, dtype=np.float32)
    image = np.round(np.broadcast_to(ramp[:, None], (64, 64, 3)) * 255).astype(np.float32) / 255
    assert len(trace(image).scene) == 1


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


def test_stops_of_a_gradient_are_pixels_apart() -> None:
    tones = np.linspace(0, 120, 12)[:, None] + np.random.default_rng(0).integers(-3, 4, (12, 60))
    ramp = fit_ramp(np.repeat(tones[..., None], 4, axis=2).astype(np.float32), np.ones((12, 60), bool), 0, 0)
    assert ramp is not None
    assert np.diff(ramp.offsets).min() * np.hypot(*ramp.frame[2:4]) >= 0.99


def test_flat_parts_stay_whole() -> None:
    image = np.full((32, 32, 4), 255, np.float32)
    image[8:24, 8:24, :3] = 90
    labels = (image[..., 0] < 200).astype(np.int32)
    parts = paint_parts(image, labels, 0.0)
    assert split_uneven(image, parts, 0.0) is parts
    waves = 8 * np.sin(np.arange(32) / 2)
    image[..., :3] += np.outer(waves, waves)[..., None] * (labels == 1)[..., None]
    assert len(split_uneven(image, paint_parts(image, labels, 0.0), 0.0).paint) > 2
