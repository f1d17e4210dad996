"""Images of golden cases, made by integer arithmetic alone."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt
from PIL import Image

Bytes = npt.NDArray[np.uint8]

PHOTO = Path(__file__).parents[2] / "docs" / "images" / "cat.jpg"

FINE = 4
"""Drawings are made this many times larger and reduced by means."""


def reduced(image: npt.NDArray[np.integer], factor: int) -> Bytes:
    """Means over squares of ``factor`` pixels."""
    height, width = (side // factor for side in image.shape[:2])
    cut = image[: height * factor, : width * factor].astype(np.int64)
    sums = cut.reshape(height, factor, width, factor, -1).sum(axis=(1, 3))
    return ((sums + factor * factor // 2) // (factor * factor)).astype(np.uint8)


def photo() -> Bytes:
    """A cat, 64 px wide."""
    with Image.open(PHOTO) as opened:
        return reduced(np.asarray(opened.convert("RGB")), opened.width // 64)


def transparent() -> Bytes:
    """The cat in a soft-edged disc."""
    image = photo()
    y, x = np.mgrid[: image.shape[0], : image.shape[1]]
    from_edge = 20 * 20 - (x - 32) ** 2 - (y - 22) ** 2
    alpha = np.clip(from_edge * 2, 0, 255).astype(np.uint8)
    return np.concatenate([image, alpha[..., None]], axis=2)


def _canvas(width: int, height: int, color: tuple[int, int, int]) -> Bytes:
    """A fine sheet of one colour."""
    return np.full((height * FINE, width * FINE, 3), color, np.uint8)


def logo() -> Bytes:
    """A disc, a star and a bar, on white."""
    image = _canvas(64, 64, (255, 255, 255))
    cv2.circle(image, (96, 104), 70, (200, 40, 60), -1)
    star = [(180, 40), (196, 84), (240, 88), (206, 116), (218, 160), (180, 136), (142, 160), (154, 116)]
    cv2.fillPoly(image, [np.array(star, np.int32)], (20, 60, 180))
    cv2.rectangle(image, (30, 196), (226, 226), (250, 190, 20), -1)
    return reduced(image, FINE)


def shaded() -> Bytes:
    """A rounded shape with a gradient, on blue."""
    image = _canvas(64, 48, (30, 60, 120))
    y, x = np.mgrid[: image.shape[0], : image.shape[1]]
    mask = np.zeros(image.shape[:2], np.uint8)
    cv2.ellipse(mask, (128, 96), (100, 66), 20, 0, 360, 1, -1)
    ramp = np.stack([255 - x // 2, 120 + y // 2, 40 + x // 4], axis=2).clip(0, 255).astype(np.uint8)
    return reduced(np.where(mask[..., None] > 0, ramp, image), FINE)


def sketch() -> Bytes:
    """Black strokes of a pen, and a dot."""
    image = _canvas(80, 64, (250, 250, 246))
    t = np.arange(0, 241)
    wave = np.stack([40 + t, 90 + (t - 40) * (t - 120) * (t - 200) // 16000], axis=1).astype(np.int32)
    cv2.polylines(image, [wave], False, (20, 20, 24), 9)
    cv2.circle(image, (190, 186), 40, (20, 20, 24), 9)
    cv2.line(image, (40, 230), (150, 150), (20, 20, 24), 9)
    cv2.circle(image, (270, 40), 9, (20, 20, 24), -1)
    return reduced(image, FINE)


def sprite() -> Bytes:
    """Twelve by twelve cells of four colours, four pixels each."""
    rows = np.arange(144).reshape(12, 12)
    cells = (rows * rows * 7 + rows * 13) % 11 % 4
    palette = np.array([[240, 240, 240], [40, 40, 60], [200, 60, 60], [60, 160, 80]], np.uint8)
    return palette[cells].repeat(4, axis=0).repeat(4, axis=1)


PICTURES: dict[str, Callable[[], Bytes]] = {
    "photo": photo,
    "transparent": transparent,
    "logo": logo,
    "shaded": shaded,
    "sketch": sketch,
    "sprite": sprite,
}
