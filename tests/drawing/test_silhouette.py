"""Outlines of objects photographed on plain ground."""

from __future__ import annotations

import numpy as np
import pytest

import warpsplat
from warpsplat.drawing.silhouette import by_object
from warpsplat.drawing.without_background import without_ground
from warpsplat.errors import ImageError
from warpsplat.portable.filters import gaussian_blur
from warpsplat.scene import FloatArray
from warpsplat.svg.viewer import render_own

WIDTH, HEIGHT = 96, 72


def shapes() -> FloatArray:
    """How much of each pixel is an object: a ring, and a bar."""
    y, x = np.mgrid[:HEIGHT, :WIDTH].astype(np.float32) + np.float32(0.5)
    away = np.sqrt(np.square(x - 32) + np.square(y - 36))
    ring = np.clip(22 - away, 0, 1) * np.clip(away - 10, 0, 1)
    bar = np.clip(9 - np.abs(x - 76), 0, 1) * np.clip(24 - np.abs(y - 36), 0, 1)
    return np.asarray(ring + bar, np.float32)


def photograph(noise: float = 2.0) -> FloatArray:
    """The objects on paper: uneven light, a soft shadow, noise."""
    cover = shapes()
    light = np.linspace(0.95, 0.75, WIDTH)[None, :] * np.linspace(1.0, 0.9, HEIGHT)[:, None]
    shadow = gaussian_blur(np.roll(cover, (3, 3), (0, 1)), 5.0)
    paper = light[..., None] * np.array([1.0, 0.98, 0.93]) * (1 - 0.35 * shadow[..., None])
    image = paper * (1 - cover[..., None]) + np.array([0.25, 0.2, 0.2]) * cover[..., None]
    grain = np.random.default_rng(3).uniform(-1, 1, image.shape) * noise / 255
    return np.clip(image + grain, 0, 1).astype(np.float32)


def test_edge_colors_do_not_contain_the_background() -> None:
    found = without_ground(photograph(0), everywhere=True)
    edge = (found[..., 3] > 0.2) & (found[..., 3] < 1)
    straight = found[edge][:, :3] / found[edge][:, 3:]
    assert edge.any()
    assert np.abs(straight - np.array([0.25, 0.2, 0.2])).max() < 0.1


@pytest.mark.parametrize("is_cut_out", [False, True])
def test_a_path_for_each_object(is_cut_out: bool) -> None:
    """Of a photograph, and of an image that is cut out already, as a draft."""
    image, quality = photograph(), "draft" if is_cut_out else "balanced"
    if is_cut_out:
        image = np.concatenate([np.full_like(image, 0.5), shapes()[..., None]], axis=2)
    result = warpsplat.vectorize(image, subject="silhouette", quality=quality, device="cpu", dpi=25.4)
    assert len(result.scene) == 2
    assert 'width="96mm"' in result.svg
    assert not result.scene.colors.any()
    shown = np.asarray(render_own(result.svg.replace("mm", "px")).convert("RGBA"))[..., 3] / 255
    assert np.abs(shown - shapes()).mean() < (0.005 if is_cut_out else 0.015)
    counts = np.diff(np.searchsorted(result.scene.starts, result.scene.first))
    assert sorted(counts) == [1, 2], "the ring has its hole"
    with pytest.raises(ImageError, match="nothing but plain ground"):
        warpsplat.vectorize(np.full((40, 40, 3), 200, np.uint8), subject="silhouette")


def test_objects_in_holes_of_others() -> None:
    cover = np.zeros((64, 64, 4), np.uint8)
    for side, level in ((4, 255), (14, 0), (22, 255)):
        cover[side:-side, side:-side, 3] = level
    scene = warpsplat.vectorize(cover, subject="silhouette", quality="draft", device="cpu").scene
    assert len(scene) == 2
    assert len(by_object(scene)) == 2


def test_large_photographs_keep_their_size() -> None:
    large = np.repeat(np.repeat(photograph(0), 18, axis=0), 18, axis=1)
    result = warpsplat.vectorize(large, subject="silhouette", quality="draft", device="cpu")
    assert "864x648" in result.reduced
    canvas = result.scene.canvas
    assert (canvas.width, canvas.height) == (18 * WIDTH, 18 * HEIGHT)
