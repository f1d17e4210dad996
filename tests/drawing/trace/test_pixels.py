"""Pixel art: the file shows the very image, by as few corners as its cells have."""

from __future__ import annotations

import numpy as np
import pytest

from warpsplat.drawing.trace import pixels
from warpsplat.drawing.trace.pixels import outlines, trace_pixels
from warpsplat.errors import ImageError
from warpsplat.metrics import score_svg
from warpsplat.scene import FloatArray
from warpsplat.svg.read import load_scene
from warpsplat.svg.viewer import render_svg
from warpsplat.svg.write import write_svg


def noise(side: int, colors: int, seed: int = 0) -> FloatArray:
    rng = np.random.default_rng(seed)
    palette = rng.integers(0, 256, (colors, 3)) / 255
    return palette[rng.integers(0, colors, (side, side))].astype(np.float32)


def enlarged(image: FloatArray, size: int) -> FloatArray:
    return np.kron(image, np.ones((size, size, 1), np.float32))


@pytest.mark.parametrize("size", [1, 3, 10])
def test_nothing_is_lost(size: int) -> None:
    image = enlarged(noise(16, 5), size)
    scene, per_pixel = trace_pixels(image)
    assert per_pixel == 1 / size
    score = score_svg(write_svg(scene, per_pixel=per_pixel), image, perceptual=False)
    assert score.psnr == np.inf
    assert score.paths == 4, "and the ground"


def test_colours_are_those_of_eight_bits() -> None:
    """An image of 16 bits may have many more."""
    image = noise(16, 3)
    finer = image + np.random.default_rng(2).uniform(-0.4, 0.4, image.shape).astype(np.float32) / 255
    scene, _ = trace_pixels(np.clip(finer, 0, 1).astype(np.float32))
    assert len(scene) == 2


def test_what_is_empty_stays_empty() -> None:
    image = np.concatenate([noise(16, 4), np.ones((16, 16, 1), np.float32)], axis=2)
    image[np.random.default_rng(1).random((16, 16)) < 0.3] = 0
    scene, per_pixel = trace_pixels(image)
    assert scene.canvas.background is None
    assert len(scene) == 4
    assert score_svg(write_svg(scene, per_pixel=per_pixel), image, perceptual=False).psnr == np.inf


def test_a_background_of_its_own_needs_no_path() -> None:
    image = noise(8, 3)
    scene, _ = trace_pixels(image, np.asarray(image[0, 0]))
    assert len(scene) == 2
    scene, _ = trace_pixels(image, np.array([0.1, 0.2, 0.3], np.float32))
    assert len(scene) == 3


def test_only_corners_are_kept() -> None:
    """A ring: four corners outside, four inside, the other way round."""
    ring = np.ones((5, 6), np.bool_)
    ring[2, 2:4] = False
    outer, inner = sorted(([(x, y) for x, y in each.tolist()] for each in outlines(ring)), key=min)
    assert set(outer) == {(0, 0), (6, 0), (6, 5), (0, 5)}
    assert set(inner) == {(2, 2), (4, 2), (4, 3), (2, 3)}
    assert _area(outer) == 30
    assert _area(inner) == -2


def _area(points: list[tuple[int, int]]) -> float:
    x, y = np.array(points, float).T
    return float((x * np.roll(y, -1) - np.roll(x, -1) * y).sum() / 2)


def test_a_photograph_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pixels, "MOST_CELLS", 100)
    with pytest.raises(ImageError, match="16x16 cells, more than pixel art may have"):
        trace_pixels(enlarged(noise(16, 3), 2))


def test_no_hairlines_at_a_zoom_that_ends_cells_within_pixels() -> None:
    image = np.concatenate([noise(12, 3), np.ones((12, 12, 1), np.float32)], axis=2)
    scene, per_pixel = trace_pixels(image)
    text = write_svg(scene, per_pixel=per_pixel)
    # What begins in the last row and column is not whole.
    shown = np.asarray(render_svg(text, zoom=1.37).convert("RGBA"))[:-1, :-1]
    known = np.round(image[..., :3].reshape(-1, 3) * 255).astype(np.uint8)
    assert (shown[..., 3] == 255).all()
    assert set(map(tuple, shown[..., :3].reshape(-1, 3))) <= set(map(tuple, known))
    assert len(load_scene(text, 12, 12, "cells.svg")[0]) == len(scene), "and the file can be read again"


def test_one_colour_on_a_ground_abuts_nothing() -> None:
    text = write_svg(trace_pixels(noise(12, 2))[0])
    assert "shape-rendering" not in text
