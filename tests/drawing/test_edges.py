"""Clean edges of a picture tell rings and the light in which colours were mixed."""

from __future__ import annotations

import numpy as np
import pytest

from tests.drawing.test_optics import BOX, MADE, small
from warpsplat.drawing.edges import LINEAR, MIDDLES, find_edges
from warpsplat.scene import FloatArray


def levels(how: str | None = None) -> FloatArray:
    return np.asarray(MADE[how]() if how else small(BOX), np.float32)


def test_linear_light_and_back() -> None:
    np.testing.assert_array_equal(np.searchsorted(MIDDLES, LINEAR), np.arange(256))
    assert LINEAR[0] == 0 and LINEAR[255] == 255 and LINEAR[188] == pytest.approx(255 / 2, abs=1)


@pytest.mark.parametrize("how", [None, *MADE])
def test_what_edges_tell(how: str | None) -> None:
    found = find_edges(levels(how))
    assert found.clean.sum() > 300
    if how != "by Lanczos":  # which leaves several rings, the outermost of which are faint
        assert found.has_rings == (how in ("sharpened", "by bicubic"))
    assert found.is_linear == (how == "in linear light")


def test_without_rings_an_image_has_the_colours_of_its_areas() -> None:
    image = levels("sharpened")
    plain = find_edges(image).plain
    drawn = {tuple(color) for color in levels().reshape(-1, 3).astype(int).tolist()}
    darkest = min(sum(color) for color in drawn)
    assert image.sum(axis=2).min() < darkest - 30
    assert np.abs(plain - levels()).mean() < 0.75 * np.abs(image - levels()).mean()


def test_an_image_without_rings_stays() -> None:
    image = levels()
    assert (find_edges(image).plain != image).any(axis=2).mean() < 0.002


def test_edges_mixed_in_linear_light_become_mixtures_in_srgb() -> None:
    image = levels("in linear light")
    found = find_edges(image)
    off = np.abs(found.plain - levels())[found.clean]
    assert off.mean() < 0.3 * np.abs(image - levels())[found.clean].mean()


def test_outlines_are_no_rings() -> None:
    """A dark outline around a paler shape is as clean as a ring, but much darker."""
    image = np.full((40, 40, 3), 250, np.float32)
    image[8:32, 8:32] = (20, 20, 90)
    image[10:30, 10:30] = (90, 120, 200)
    found = find_edges(image)
    assert not found.has_rings
    np.testing.assert_array_equal(found.plain, image)


@pytest.mark.parametrize("shape", [(1, 1), (1, 9), (9, 1), (2, 3), (3, 2)])
@pytest.mark.parametrize("planes", [3, 4])
def test_small_images_have_no_edges(shape: tuple[int, int], planes: int) -> None:
    image = np.zeros((*shape, planes), np.float32)
    image[-1:, -1:] = 200
    found = find_edges(image)
    np.testing.assert_array_equal(found.plain, image)
    assert not found.has_rings and not found.is_linear
