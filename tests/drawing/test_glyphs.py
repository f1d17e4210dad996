"""Letters and other small parts of one colour, which are drawn once."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

import warpsplat
from warpsplat.drawing.glyphs import find_glyphs

Floats = npt.NDArray[np.float64]

FINE = 12
"""Samples of a pixel along each axis."""

PAPER, PANEL = (1.0, 1.0, 1.0), (36 / 255, 64 / 255, 122 / 255)
BLACK, GREY = (0.0, 0.0, 0.0), (119 / 255, 119 / 255, 136 / 255)


def letter(kind: int, shift: float = 0.0, weight: float = 1.0, side: int = 10) -> Floats:
    """Return the coverage of a ring, a cross or a slanted bar, ``shift`` px to the right; (side, side)."""
    place = (np.arange(side * FINE) + 0.5) / FINE
    x, y = place[None] - shift - 5.3, place[:, None] - 4.8
    inside = (
        np.abs(np.sqrt(x * x + y * y) - 2.6) < 1.2 * weight,
        (np.minimum(np.abs(x), np.abs(y)) < 1.1 * weight) & (np.maximum(np.abs(x), np.abs(y)) < 3.6),
        (np.abs(x - 0.5 * y) < 1.5 * weight) & (np.abs(y) < 3),
    )[kind]
    return inside.reshape(side, FINE, side, FINE).mean(axis=(1, 3))


def page(stripes: bool = False, weight: float = 1.0) -> npt.NDArray[np.float32]:
    """Return three rows of letters in black and grey on paper, white on a panel; (96, 96, 3).

    ``stripes``: drawn for a screen whose pixels have red on the left and blue on the right.
    """
    image = np.ones((96, 96, 3))
    image[64:, :] = PANEL
    for row, (ink, ground) in enumerate([(BLACK, PAPER), (GREY, PAPER), (PAPER, PANEL)]):
        for k in range(6):
            shifts = (1 / 3, 0, -1 / 3) if stripes else (0, 0, 0)
            cover = np.stack([letter(k % 3, shift, weight) for shift in shifts], axis=2)
            y, x = 4 + 32 * row, 4 + 14 * k
            image[y : y + 10, x : x + 10] = cover * ink + (1 - cover) * np.array(ground)
    return (np.round(image * 255) / 255).astype(np.float32)


def test_each_different_letter_is_on_the_sheet_once() -> None:
    image = page()
    sheet, rest = find_glyphs(image)
    assert sheet
    assert len(sheet.corners) == 9 and len(sheet.copies) == 18
    assert np.array_equal(rest[:64], np.ones((64, 96, 3))) and (rest[64:] == rest[-1, -1]).all()
    inks = {tuple(np.round(255 * ink).astype(int).tolist()) for ink in sheet.inks}
    grey_is_not_thin_black = {(0, 0, 0, 255), (119, 119, 136, 255), (255, 255, 255, 255)}
    assert inks == grey_is_not_thin_black
    for copy, (x, y) in zip(sheet.copies, sheet.places, strict=True):
        left, top = sheet.corners[copy]
        across, down = sheet.sizes[copy]
        share = 1 - sheet.image[top : top + down, left : left + across, :1]
        shown = share * sheet.inks[copy, :3] + (1 - share) * sheet.grounds[copy, :3]
        assert np.abs(shown - image[y : y + down, x : x + across]).max() < 2.5 / 255


def test_the_ink_of_thin_letters_is_their_strongest_colour() -> None:
    sheet, _ = find_glyphs(page(weight=0.4))
    assert sheet
    assert len(sheet.copies) == 18
    assert len(np.unique(sheet.inks, axis=0)) == 3
    assert (sheet.inks[:, :3].min(axis=0) < 0.12).all()


def test_fringes_of_stripes_are_no_colours() -> None:
    sheet, _ = find_glyphs(page(stripes=True))
    assert sheet
    assert len(sheet.copies) == 18
    first = sheet.copies[0]
    (left, top), (across, down) = sheet.corners[first], sheet.sizes[first]
    mean = np.mean([letter(0, shift) for shift in (1 / 3, 0, -1 / 3)], axis=0)
    mean, (x, y) = np.pad(mean, 2), sheet.places[0] - 2
    shares = 1 - sheet.image[top : top + down, left : left + across, 0]
    assert np.abs(shares - mean[y : y + down, x : x + across]).max() < 0.02


@pytest.mark.parametrize("reason", ["two colours", "few", "noise"])
def test_some_images_have_no_sheet(reason: str) -> None:
    image = page()
    if reason == "two colours":
        is_left = (np.arange(96) - 4) % 14 < 5
        image[:, is_left] = image[:, is_left][..., ::-1] * np.array([1, 0.6, 1], np.float32)
    elif reason == "few":
        image[:32], image[32:64, :48] = 1, 1
    else:
        image += np.random.default_rng(0).normal(0, 0.02, image.shape).astype(np.float32)
    sheet, rest = find_glyphs(image)
    assert sheet is None
    assert np.array_equal(rest, image)


@pytest.mark.parametrize("quality", ["draft", "balanced"])
def test_a_page_of_letters_is_drawn_with_equal_outlines(quality: str) -> None:
    made = warpsplat.vectorize(page(), subject="drawing", quality=quality, threads=1)
    assert made.score
    assert made.score.psnr > (27 if quality == "draft" else 32)
    scene = warpsplat.load_svg(made.svg)
    rows = np.split(scene.points, scene.starts[1:-1])
    at_origin = {np.round((points - points.min(axis=0)) * 100).tobytes() for points in rows}
    assert len(at_origin) <= 12, "rings have two outlines, crosses and bars one, in three colours"


@pytest.mark.parametrize("quality", ["draft", "balanced"])
@pytest.mark.parametrize("limit", [{"curves": 500}, {"colors": 64}, {"max_bytes": "1MB"}])
def test_a_limit_that_is_met_anyway_changes_nothing(quality: str, limit: dict[str, Any]) -> None:
    given = {"subject": "drawing", "quality": quality, "threads": 1}
    assert warpsplat.vectorize(page(), **given, **limit).svg == warpsplat.vectorize(page(), **given).svg


@pytest.mark.parametrize("limit", [{"curves": 3}, {"colors": 2}, {"max_bytes": 900}])
def test_a_limit_that_binds_is_kept(limit: dict[str, Any]) -> None:
    made = warpsplat.vectorize(page(), subject="drawing", quality="draft", **limit)
    assert len(made.scene) <= limit.get("curves", np.inf)
    assert len(np.unique(made.scene.colors, axis=0)) <= limit.get("colors", np.inf)
    assert len(made.svg.encode()) <= limit.get("max_bytes", np.inf)


@pytest.mark.parametrize("quality", ["draft", "balanced"])
def test_less_detail_costs_letters_little(quality: str) -> None:
    """Measured: drafts the same bytes; .0 to .4 dB for .49."""
    usual, less = (
        warpsplat.vectorize(page(), subject="drawing", quality=quality, threads=1, detail=detail)
        for detail in (0.5, 0.49)
    )
    assert usual.score
    assert less.score
    assert less.score.psnr > usual.score.psnr - 1
