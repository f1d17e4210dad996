"""Thin parts have the inks that their pixels are mixtures of."""

import numpy as np
import pytest

from tests.drawing.trace.drawings import draw_exactly, ground, levels
from warpsplat.drawing.trace.inks import with_inks
from warpsplat.drawing.trace.regions import find_regions
from warpsplat.scene import FloatArray

BROWN, BLUE = (120, 80, 40), (60, 110, 160)


def drawn(*lines: tuple[str, tuple[int, int, int]]) -> FloatArray:
    """Return lines of a pixel in width on a pale ground."""
    paths = "".join(
        f'<path d="{data}" fill="none" stroke="rgb{color}" stroke-width="1"/>' for data, color in lines
    )
    return draw_exactly(ground("#ffffd0", 64, 64) + paths, 64, 64)


def inks_of(image: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the colours of an image's pixels if they were covered, and those that are not its ground's."""
    found = with_inks(find_regions(levels(image)))
    return found.fills, np.unique(
        found.fills[np.abs(found.fills - found.fills[0, 0]).max(axis=2) > 9], axis=0
    )


def test_lines_that_touch_keep_their_colours() -> None:
    image = drawn(("M4 60Q20 20 32 32", BROWN), ("M32 32Q50 50 60 10", BLUE))
    fills, _ = inks_of(image)
    thin = np.abs(fills - fills[0, 0]).max(axis=2) > 9
    assert thin[:, :28].any() and thin[:, 36:].any()
    for part, own, other in ((np.s_[:, :28], BROWN, BLUE), (np.s_[:, 36:], BLUE, BROWN)):
        shown = fills[part][thin[part]][:, :3]
        nearer = np.abs(shown - own).sum(axis=1) < np.abs(shown - other).sum(axis=1)
        assert nearer.mean() > 0.95


@pytest.mark.parametrize("color", [BROWN, BLUE])
def test_lines_of_one_colour_have_one_ink(color: tuple[int, int, int]) -> None:
    _, inks = inks_of(drawn(("M4 60Q20 20 32 32", color), ("M10.3 10.2L50.1 14.8", color)))
    assert len(inks) == 1
    assert np.abs(inks[0, :3] - color).max() < 32
