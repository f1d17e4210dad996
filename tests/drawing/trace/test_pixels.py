"""Pixel art: its cells are found whatever enlarged them, and the file shows the very image."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
import numpy.typing as npt
import pytest
from PIL import Image

from tests.drawing.trace.drawings import as_file, photograph
from tests.svg.foreign import load_scene
from warpsplat.drawing.trace import pixels
from warpsplat.drawing.trace.lattice import find_lattice
from warpsplat.drawing.trace.pixels import trace_pixels
from warpsplat.drawing.trace.subject import guess_subject
from warpsplat.errors import ImageError
from warpsplat.metrics import score_svg
from warpsplat.scene import FloatArray
from warpsplat.svg.viewer import on_white, render_svg
from warpsplat.svg.write import write_svg

Levels = npt.NDArray[Any]


def sprite(side: int = 16) -> Levels:
    """A symmetric figure of five colours on white."""
    rng = np.random.default_rng(3)
    half = rng.integers(1, 6, (side, side // 2))
    colors = np.concatenate([half, half[:, ::-1]], axis=1)
    y, x = np.mgrid[:side, :side] - (side - 1) / 2
    colors[np.hypot(x, y) > 0.45 * side] = 0
    palette = np.array(
        [[255] * 3, [30, 30, 40], [200, 60, 50], [240, 200, 80], [60, 140, 90], [70, 110, 200]]
    )
    return palette[colors].astype(np.uint8)


def scaled(image: Levels, scale: float, how: Image.Resampling = Image.Resampling.NEAREST) -> Levels:
    size = round(image.shape[1] * scale), round(image.shape[0] * scale)
    return np.array(Image.fromarray(image).resize(size, how))


def jpeg(image: Levels, quality: int) -> Levels:
    return np.round(255 * as_file(image / 255, quality=quality)).astype(np.uint8)


def bordered(image: Levels, left: int, top: int) -> Levels:
    return np.asarray(cv2.copyMakeBorder(image, top, 3, left, 5, cv2.BORDER_CONSTANT, value=(255, 255, 255)))


NOISY = {
    "JPEG": jpeg(scaled(sprite(), 4), 90),
    "strong JPEG": jpeg(scaled(sprite(), 6), 75),
    "broken scale, JPEG": jpeg(scaled(sprite(), 5.3), 85),
    "margin, JPEG": jpeg(bordered(scaled(sprite(), 6), 7, 9), 85),
    "interpolated": scaled(sprite(), 4, Image.Resampling.BILINEAR),
    "broken scale, interpolated": scaled(sprite(), 4.3, Image.Resampling.BILINEAR),
    "antialiased": cv2.resize(scaled(sprite(), 27), None, fx=0.1, fy=0.1, interpolation=cv2.INTER_AREA),
}
CLEAN = {
    "broken scale": scaled(sprite(), 1.5),
    "margin": bordered(scaled(sprite(), 4), 7, 9),
    "cropped": scaled(sprite(), 4)[2:-3, 1:-2],
}


def cropped(colors: Levels) -> npt.NDArray[np.int64]:
    """Without the white around."""
    seen = colors.min(axis=2) < 200
    rows, columns = np.flatnonzero(seen.max(axis=1)), np.flatnonzero(seen.max(axis=0))
    return colors[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1].astype(np.int64)


@pytest.mark.parametrize("name", [*NOISY, *CLEAN])
def test_enlarged_cells_are_pixel_art(name: str) -> None:
    """Of noisy images, the cells are those before."""
    levels = (NOISY | CLEAN)[name]
    image = levels.astype(np.float32) / 255
    assert guess_subject(image).subject == "pixel"
    scene, per_pixel = trace_pixels(image)
    text = write_svg(scene, per_pixel=per_pixel)
    score = score_svg(text, image)
    assert score.paths <= 8
    if name in CLEAN:
        assert score.psnr == np.inf
        return
    if "interpolated" not in name:
        assert score.psnr > 20
        # Each cell has one colour.
        assert len(np.unique(on_white(render_svg(text)).reshape(-1, 3), axis=0)) <= 8
    lattice = find_lattice(levels)
    assert lattice is not None
    found, wanted = cropped(lattice.palette[lattice.colors]), cropped(sprite())
    assert found.shape == wanted.shape
    assert (np.abs(found - wanted).max(axis=2) <= 12).mean() > 0.97
    assert len(lattice.palette) <= 8


def test_other_images_have_no_cells() -> None:
    disc = cv2.circle(np.full((96, 96, 3), 255, np.uint8), (48, 48), 30, (200, 30, 30), -1, cv2.LINE_AA)
    dots = np.full((96, 96, 3), 255, np.uint8)
    for y in range(8, 96, 12):
        for x in range(8, 96, 12):
            cv2.circle(dots, (x, y), 4, (30, 30, 200), -1, cv2.LINE_AA)
    photo = np.round(photograph() * 255).astype(np.uint8)
    small = cv2.resize(photo, (24, 24), interpolation=cv2.INTER_AREA)
    images = (disc, dots, photo, jpeg(photo, 75), scaled(small, 4, Image.Resampling.BILINEAR))
    assert [find_lattice(image) for image in images] == [None] * len(images)


def test_blurred_cells_of_two_tones_are_found() -> None:
    code = cv2.QRCodeEncoder.create().encode("warpsplat")
    blurred = np.asarray(Image.fromarray(code).resize((4 * len(code) + 11,) * 2, Image.Resampling.LANCZOS))
    found = find_lattice(np.repeat(blurred[..., None], 3, axis=2))
    assert found is not None
    dark = found.palette[found.colors].mean(axis=2) < 128
    assert np.array_equal(dark, code < 128)


def noise(side: int, colors: int, seed: int = 0) -> FloatArray:
    rng = np.random.default_rng(seed)
    palette = rng.integers(0, 256, (colors, 3)) / 255
    return palette[rng.integers(0, colors, (side, side))].astype(np.float32)


def enlarged(image: FloatArray, size: int) -> FloatArray:
    return np.kron(image, np.ones((size, size, 1), np.float32))


@pytest.mark.parametrize("is_clear", [False, True])
@pytest.mark.parametrize("size", [1, 3, 10])
def test_pixel_art_is_reproduced_exactly(size: int, is_clear: bool) -> None:
    image = noise(16, 5)
    if is_clear:
        image = np.concatenate([image, np.ones((16, 16, 1), np.float32)], axis=2)
        image[np.random.default_rng(1).random((16, 16)) < 0.3] = 0
    image = enlarged(image, size)
    scene, per_pixel = trace_pixels(image)
    assert per_pixel == 1 / size
    score = score_svg(write_svg(scene, per_pixel=per_pixel), image, perceptual=False)
    assert score.psnr == np.inf
    assert score.paths == (5 if is_clear else 4), "and the ground, if there is one"
    assert (scene.canvas.background is None) == is_clear


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


def test_shape_rendering_is_left_out_for_one_colour() -> None:
    text = write_svg(trace_pixels(noise(12, 2))[0])
    assert "shape-rendering" not in text
