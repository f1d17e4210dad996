"""Thin lines and small letters, which have pixels of no pure colour."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from PIL import Image

from tests.drawing.trace.drawings import draw_exactly, ground, levels
from warpsplat.drawing.trace.regions import Regions, find_regions
from warpsplat.drawing.trace.sub_pixels import with_sub_pixels
from warpsplat.drawing.trace.trace import trace
from warpsplat.rendering.renderer import render
from warpsplat.scene import FloatArray

LETTERS = (
    '<g fill="none" stroke="#113366" stroke-width="1.1">'
    '<circle cx="6.3" cy="9.2" r="2.4"/><circle cx="14.6" cy="9.4" r="2.2"/>'
    '<path d="M20.4 6.5v5.2M24.7 6.5v5.2M29.3 3.2v8.5"/></g>'
    '<circle cx="20.4" cy="4.1" r="0.8" fill="#113366"/><circle cx="24.7" cy="4.1" r="0.8" fill="#113366"/>'
)
"""Two letters "o", two "i" and an "l", 12 px high."""


@pytest.fixture(scope="module")
def letters() -> FloatArray:
    return draw_exactly(ground("#ffffff", 36, 16) + LETTERS, 36, 16)


@pytest.fixture(scope="module")
def small(letters: FloatArray) -> Regions:
    return with_sub_pixels(find_regions(levels(letters)))


def test_sub_pixels_have_the_area_of_their_pixel(letters: FloatArray, small: Regions) -> None:
    scale = small.scale
    assert scale == 4
    shown = small.fills.reshape(16, scale, 36, scale, 4).mean(axis=(1, 3))
    off = np.abs(shown - levels(letters)).max(axis=2)
    assert off.max() <= 255 * 0.1 and off.mean() <= 255 * 0.01


def test_letters_have_one_ink_their_counters_and_their_dots(small: Regions) -> None:
    assert len(np.unique(small.paint)) == 2
    # The paper, two counters; two rings, two stems with a dot each, and the "l".
    assert len(small.paint) == 1 + 2 + 2 + 4 + 1


def test_a_trace_of_small_letters_is_near_their_source_at_four_times_the_size(letters: FloatArray) -> None:
    large = draw_exactly(f'<g transform="scale(4)">{ground("#ffffff", 36, 16)}{LETTERS}</g>', 144, 64)
    shown = render(trace(letters).scene, scale=4)
    assert -10 * np.log10(((shown - large) ** 2).mean()) > 23


@pytest.mark.parametrize(("size", "scale"), [(40, 4), (80, 4), (96, 1)])
def test_small_images_are_mapped_for_few_thin_parts(size: int, scale: int) -> None:
    disc = '<circle cx="20" cy="20" r="12.3" fill="#a02030"/><path d="M20.4 20.6h2.1l-.7 1.7z" fill="#fff"/>'
    image = draw_exactly(ground("#ffffff", size, size) + disc, size, size)
    assert with_sub_pixels(find_regions(levels(image))).scale == scale


def test_tips_are_no_parts_of_their_own() -> None:
    points = (180, 40), (196, 84), (240, 88), (206, 116), (218, 160), (180, 136), (142, 160), (154, 116)
    star = "".join(f"L{x / 4.1:.2f} {y / 4.1:.2f}" for x, y in points).replace("L", "M", 1)
    image = draw_exactly(ground("#ffffff", 64, 44) + f'<path d="{star}z" fill="#143cb4"/>', 64, 44)
    found = with_sub_pixels(find_regions(levels(image)))
    assert found.scale > 1
    assert len(found.paint) == 2


def test_letters_beside_a_gradient_are_mapped_too() -> None:
    shade = (
        '<linearGradient id="g"><stop stop-color="#c05010"/><stop offset="1" stop-color="#f0b040"/>'
        "</linearGradient>"
        '<rect y="20" width="36" height="20" fill="url(#g)"/>'
    )
    image = draw_exactly(ground("#ffffff", 36, 40) + shade + LETTERS, 36, 40)
    mapped = with_sub_pixels(find_regions(levels(image)))
    assert mapped.scale == 4
    shown = mapped.fills.reshape(40, 4, 36, 4, 4).mean(axis=(1, 3))
    assert np.abs(shown - levels(image)).max(axis=2).mean() <= 255 * 0.01
    assert sum(mapped.colorings[k].ramp is not None for k in np.unique(mapped.paint)) == 1


def test_broad_shapes_keep_their_pixels() -> None:
    image = draw_exactly(
        ground("#ffffff", 40, 40) + '<circle cx="20" cy="20" r="12.3" fill="#a02030"/>', 40, 40
    )
    assert with_sub_pixels(find_regions(levels(image))).scale == 1


def test_a_blurred_image_keeps_whole_pixels() -> None:
    code = cv2.QRCodeEncoder.create().encode("warpsplat")
    soft = np.asarray(Image.fromarray(code).resize((round(3.3 * len(code)),) * 2, Image.Resampling.BICUBIC))
    regions = find_regions(np.stack([soft, soft, soft, np.full_like(soft, 255)], axis=2))
    assert with_sub_pixels(regions) is regions
