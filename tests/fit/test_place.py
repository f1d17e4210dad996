from __future__ import annotations

import cv2
import numpy as np
import pytest

from warpsplat.fit import place
from warpsplat.fit.place import grid_scene, shape_angles, simple_curves
from warpsplat.fit.settings import make_settings
from warpsplat.scene import Kind
from warpsplat.scene.geometry import areas


@pytest.mark.parametrize("kind", list(Kind))
@pytest.mark.parametrize("count", [1, 7, 50])
def test_first_shapes_cover_the_canvas(kind: Kind, count: int) -> None:
    target = np.random.default_rng(0).uniform(size=(40, 70, 3)).astype(np.float32)
    scene = grid_scene(make_settings(kind=kind), target, count, np.random.default_rng(0))
    assert len(scene) == count
    assert 0.8 < areas(scene).sum() / (40 * 70) < 1.8
    assert np.isfinite(scene.points).all()


def blobs(height: int, width: int) -> np.ndarray:
    """Smooth, so that a reduced copy has the same colours."""
    rng = np.random.default_rng(0)
    small = rng.uniform(0, 1, (6, 8, 3)).astype(np.float32)
    return np.clip(cv2.resize(small, (width, height), interpolation=cv2.INTER_CUBIC), 0, 1)


def test_strokes_lie_along_contours() -> None:
    stripes = np.repeat(np.sin(np.arange(96) / 3)[:, None, None], 96, axis=1).repeat(3, axis=2)
    angle = shape_angles(make_settings(open=True), stripes.astype(np.float32), np.array([[48.0, 48.0]]), 6.0)
    assert abs(np.cos(angle[0])) > 0.99


def flag(bands: int) -> np.ndarray:
    """Stripes in two colours."""
    stripes = np.repeat(np.arange(bands) % 2, 400 // bands)
    return (stripes[:, None, None] * np.ones((1, 300, 3))).astype(np.float32)


def test_few_flat_regions_and_tiny_images_need_few_curves() -> None:
    assert simple_curves(flag(2)) == place.MIN_SIMPLE_CURVES
    assert simple_curves(flag(10)) == 10 * place.SHAPES_PER_REGION
    assert simple_curves(blobs(16, 16)) == 256 // place.PIXELS_PER_CURVE
    assert simple_curves(blobs(2, 2)) == 1


def test_photographs_and_soft_pictures_get_the_default() -> None:
    soft = np.linspace(0, 1, 300, dtype=np.float32)[None, :, None] * np.ones((400, 1, 3), np.float32)
    noise = np.random.default_rng(0).uniform(0, 1, (400, 300, 3)).astype(np.float32)
    moon = np.zeros((400, 300, 3), np.float32)
    moon[:120, :100] = soft[:120, ::3]
    for target in (soft, noise, moon, blobs(400, 300)):
        assert simple_curves(target) >= make_settings().curves
