"""What a picture is taken for."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from tests.drawing.trace.drawings import LOGO, as_file, draw, ground, photograph
from warpsplat.drawing.trace.subject import guess_subject
from warpsplat.scene import FloatArray

LINES = ground("#fff") + (
    '<g stroke="#111" fill="none"><path d="M8 20L88 60"/>'
    '<path d="M8 60C40 0 60 100 90 20" stroke-width="2"/></g>'
)
LARGE = f'<g transform="scale(2)">{LOGO}</g>'
BARS = (
    ground("#264653", 192, 192) + '<rect x="20" y="20" width="60" height="150" fill="#2a9d8f"/>'
    '<circle cx="130" cy="90" r="40" fill="#e9c46a"/>'
)
RAMP = (
    '<defs><linearGradient id="a"><stop stop-color="#f80"/><stop offset="1" stop-color="#80f"/>'
    '</linearGradient></defs><rect x="8" y="8" width="80" height="60" fill="url(#a)"/>'
)


def cells(side: int, size: int, colors: int) -> FloatArray:
    rng = np.random.default_rng(0)
    image = (rng.integers(0, 256, (colors, 3)) / 255)[rng.integers(0, colors, (side, side))]
    return np.kron(image, np.ones((size, size, 1))).astype(np.float32)


def dithered(side: int = 96) -> FloatArray:
    rng = np.random.default_rng(0)
    dots = rng.random((side, side, 1)) < np.linspace(0, 1, side)[:, None]
    return np.repeat(dots, 3, axis=2).astype(np.float32)


def grainy(image: FloatArray, levels: float = 13.0) -> FloatArray:
    """With noise of so many levels in each pixel and channel."""
    noise = np.random.default_rng(0).normal(0, levels, image.shape)
    return (np.clip(np.round(255 * image + noise), 0, 255) / 255).astype(np.float32)


def small_grey(side: int) -> FloatArray:
    small = cv2.resize(photograph(192), (side, side), interpolation=cv2.INTER_AREA)
    return np.repeat(small.mean(axis=2, keepdims=True), 3, axis=2).astype(np.float32)


def stroked(
    paths: str, width: int, height: int, color: str = "#111", paper: str = "#fff", pen: float = 1.5
) -> FloatArray:
    pens = f'<g fill="none" stroke="{color}" stroke-width="{pen}">{paths}</g>'
    return draw(ground(paper, width, height) + pens, width, height)


def icon(side: int) -> FloatArray:
    """A cross in a ring, a quarter of whose pixels are edges."""
    paths = '<circle cx="16" cy="16" r="12"/><path d="M8 16H24M16 8V24"/>'
    return stroked(paths, side, side, "#c22", pen=2)


def letters() -> FloatArray:
    """Lines of strokes of a pixel and a half, 12 px high."""
    strokes = "".join(f"M{4 + 6 * i} {4 + i % 3}v{10 - 2 * (i % 4)}h{2 + i % 3}" for i in range(30))
    return stroked(f'<path d="{strokes}"/>', 190, 20)


def discs() -> FloatArray:
    """Without antialiasing: rows and columns between them are alike, but these are no cells."""
    image = np.ones((160, 200, 3), np.float32)
    for i in range(8):
        center = (25 + 45 * (i % 4), 40 + 80 * (i // 4))
        cv2.circle(image, center, 15 + i, (0.1 * i, 0.5, 0.9), -1)
    return image


def sprite() -> FloatArray:
    """16 x 16 pixels, shaded in some 40 tones, most of them rare; around it nothing."""
    rng = np.random.default_rng(3)
    tones = (rng.integers(0, 256, (40, 3)) / 255)[np.minimum(rng.integers(0, 40, (16, 16)), 39)]
    inside = np.hypot(*(np.mgrid[:16, :16] - 7.5)) < 7
    return np.dstack([tones * inside[..., None], inside]).astype(np.float32)


def table() -> FloatArray:
    """An outline of a table with round corners, on a grid of 8 px: no cells."""
    lines = '<rect x="12" y="12" width="136" height="136" rx="12"/>'
    lines += '<path d="M12 52H148M12 92H148M52 12V148M92 12V148"/>'
    discs = "".join(
        f'<circle cx="{32 + 40 * x}" cy="{32 + 40 * y}" r="10" fill="#123" stroke="none"/>'
        for x in range(3)
        for y in range(3)
    )
    return stroked(lines + discs, 160, 160, "#123", pen=8)


def words_on_shade() -> FloatArray:
    """Thin ink on a plain ground, beside a shaded and grainy disc."""
    image = np.full((160, 240, 3), 0.2, np.float32)
    strokes = "".join(f"M{4 + 6 * i} {4 + 24 * j}v{12 - 2 * (i % 4)}h3" for i in range(22) for j in range(6))
    image[:, :140] = stroked(f'<path d="{strokes}"/>', 140, 160, "#fff", "#333", 2)
    disc = np.hypot(*(np.mgrid[:160, :240] - np.array([80, 190])[:, None, None])) < 45
    image[disc] = grainy(photograph(240)[:160], 4)[disc]
    return image


def moon() -> FloatArray:
    """A mottled grey disc on white: few shades, and a texture."""
    noise = np.random.default_rng(0).normal(0, 1, (160, 160)).astype(np.float32)
    soft = sum(side * cv2.GaussianBlur(noise, (0, 0), side) for side in (1, 3))
    disc = np.hypot(*(np.mgrid[:160, :160] - 79.5)) < 72
    grey = np.where(disc, np.round(np.clip(130 + 12 * soft, 0, 255)) / 255, 1)
    return np.repeat(grey[..., None], 3, axis=2).astype(np.float32)


def screen_tones() -> FloatArray:
    """Ink on white, under dots here and under hatches there."""
    image = draw(BARS, 192, 192)
    image[:, 160:][np.indices((192, 32)).sum(axis=0) % 4 == 0] = 0
    image[:, :48][np.arange(192) % 4 < 2] = 0
    return image


def page(side: int = 160) -> FloatArray:
    """Lines of strokes of 12 px on a pale ground."""
    strokes = "".join(
        f"M{6 + 6 * i} {6 + 18 * j}v{10 - 2 * (i % 4)}h{2 + (i + j) % 3}" for i in range(24) for j in range(8)
    )
    return stroked(f'<path d="{strokes}"/>', side, side, "#223", "#fbfbf8", 1.6)


def on_checkerboard() -> FloatArray:
    """Bright discs, half covered by a dark checkerboard: dark and light are cells, colours are not."""
    colors, places = ("#ff2", "#2ff", "#f5f", "#fff"), range(3, 126, 17)
    discs = "".join(
        f'<circle cx="{x + y % 5}" cy="{y}" r="11" fill="{colors[(x + y) % 4]}"/>'
        for x in places
        for y in places
    )
    dark = np.kron(np.indices((16, 16)).sum(axis=0) % 2, np.ones((8, 8)))[..., None]
    return (0.35 * dark + draw(ground("#fff", 128, 128) + discs, 128, 128) * (1 - dark)).astype(np.float32)


def cut_out() -> FloatArray:
    """A photograph in a disc on white."""
    inside = np.hypot(*(np.mgrid[:192, :192] - 95.5)) < 60
    detail = cv2.GaussianBlur(
        np.random.default_rng(1).normal(0, 1, (192, 192, 3)).astype(np.float32), (0, 0), 2
    )
    return np.where(inside[..., None], np.clip(photograph(192) + detail, 0, 1), 1).astype(np.float32)


SHADE = np.linspace(0.3, 0.9, 96)[:, None, None] * np.ones((96, 96, 3), np.float32)
PICTURES = {
    "logo": (draw(LOGO), "drawing"),
    "hard": (draw(LARGE, 192, 192, hard=True), "drawing"),
    "jpeg": (draw(BARS, 192, 192, jpeg=60), "drawing"),
    "ramp": (draw(ground("#eee") + RAMP), "drawing"),
    "one colour": (np.ones((64, 64, 3), np.float32), "drawing"),
    "lines": (draw(LINES), "drawing"),
    "photograph": (photograph(96), "photo"),
    "grainy logo": (grainy(draw(BARS, 192, 192)), "drawing"),
    "grainy photograph": (grainy(0.2 + 0.6 * photograph(192)), "photo"),
    "dithered": (dithered(160), "photo"),
    "screen tones": (screen_tones(), "drawing"),
    "moon": (moon(), "photo"),
    "small grey photograph": (small_grey(48), "photo"),
    "small icon": (icon(32), "drawing"),
    "small letters": (letters(), "drawing"),
    "hard discs": (discs(), "drawing"),
    "code": (cells(25, 4, 2), "pixel"),
    "sprite": (cells(32, 1, 6), "pixel"),
    "shaded sprite": (sprite(), "pixel"),
    "table": (table(), "drawing"),
    "words beside a photograph": (words_on_shade(), "drawing"),
    "page with noise": (grainy(page(), 4), "drawing"),
    "icon with noise": (grainy(icon(32), 4), "drawing"),
    "logo with noise": (grainy(draw(ground("#fff") + LOGO), 4), "drawing"),
    "page as JPEG": (as_file(page(), quality=75), "drawing"),
    "icon as JPEG": (as_file(icon(32), quality=75), "drawing"),
    "small logo as JPEG": (as_file(draw(ground("#fff") + LOGO), quality=75), "drawing"),
    "on a checkerboard": (on_checkerboard(), "drawing"),
    "cut out": (cut_out(), "photo"),
    "cells of many colours": (cells(20, 4, 90), "pixel"),
    "shaded sky with grain": (grainy(SHADE, 4), "photo"),
    "even shading": (SHADE, "drawing"),
}


@pytest.mark.parametrize(("image", "subject"), PICTURES.values(), ids=PICTURES.keys())
def test_guesses(image: FloatArray, subject: str) -> None:
    guess = guess_subject(image)
    assert guess.subject == subject, guess.why
    assert guess.why


@pytest.mark.parametrize(("side", "subject"), [(16, "pixel"), (17, "photo")])
def test_tiny_images_are_pixel_art(side: int, subject: str) -> None:
    assert guess_subject(grainy(photograph(side), 4)).subject == subject
