from __future__ import annotations

import numpy as np
import pytest
from PIL import Image

from tests.fuzz.corpus import saved
from warpsplat.errors import ImageError
from warpsplat.files.sources import load_importance


def png(pixels: np.ndarray) -> bytes:
    return saved(Image.fromarray(pixels), "PNG")


def test_grey_of_8_and_16_bits() -> None:
    levels = np.array([[0, 51, 255], [102, 204, 0]])
    for data in (png(levels.astype(np.uint8)), png((257 * levels).astype(np.uint16))):
        np.testing.assert_allclose(load_importance(data, 3, 2), levels / 255, atol=1e-6)


def test_colours_count_by_their_luma() -> None:
    colours = np.array([[[255, 0, 0], [0, 255, 0]], [[0, 0, 255], [255, 255, 255]]], np.uint8)
    wanted = [[0.299, 0.587], [0.114, 1]]
    np.testing.assert_allclose(load_importance(png(colours), 2, 2), wanted, atol=1e-5)


def test_transparent_pixels_are_black() -> None:
    """As in a face marked with a white brush on an empty layer."""
    layer = np.full((2, 2, 4), 255, np.uint8)
    layer[..., 3] = [[0, 255], [51, 0]]
    np.testing.assert_allclose(load_importance(png(layer), 2, 2), [[0, 1], [0.2, 0]], atol=1e-6)


@pytest.mark.parametrize(("wide", "tall"), [(768, 512), (1536, 1024), (100, 66), (100, 67), (3, 2)])
def test_any_size_of_the_same_proportions(wide: int, tall: int) -> None:
    assert load_importance(png(np.zeros((tall, wide), np.uint8)), 768, 512).shape == (tall, wide)


@pytest.mark.parametrize(("wide", "tall"), [(512, 768), (768, 500), (100, 68), (3, 3)])
def test_other_proportions_are_refused(wide: int, tall: int) -> None:
    with pytest.raises(ImageError, match=rf"^m\.png: {wide}x{tall} pixels; .* 768x512 image$"):
        load_importance(png(np.zeros((tall, wide), np.uint8)), 768, 512, "m.png")


def test_no_image() -> None:
    with pytest.raises(ImageError, match=r"^m\.png: not an image"):
        load_importance(b"none", 3, 2, "m.png")
