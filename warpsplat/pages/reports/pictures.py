"""What a report's slider shows, small enough to be embedded."""

from __future__ import annotations

import io
import math
from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt
from PIL import Image

from warpsplat.files.image import WEBP_SIDE
from warpsplat.files.sources import ImageSource, image_of
from warpsplat.pages.embed import image_uri
from warpsplat.run.memory import facts_of
from warpsplat.scene import FloatArray

Bytes = npt.NDArray[np.uint8]

PAGE_PIXELS = 2_000_000
"""Most pixels of a picture on a page; of larger images a reduced copy is shown."""

SHORT_PIXELS = 500_000
"""The same after a run for which memory was short."""

ROOM, ROOM_SHARE = 190_000, 1.5
"""Bytes that the pictures of a page may take: so many, and this share of the image's file. With what base64
adds a page weighs no more than the SVG, twice the image and 400 kB."""

QUALITIES = (92, 85, 75, 60, 40, 20)
"""Of WebP, the best that there is room for."""

MAP_QUALITY = 70
"""Of the error map: colours that stand for numbers, looked at, not measured."""

FEW_COLORS = 4096
"""Up to so many different colours an image is a drawing, which is kept without loss."""

MOST_ERROR = 64.0
"""The end of the error map's scale, the same on all pages [levels of 255]."""


@dataclass(frozen=True)
class Shown:
    """An image as a page shows it."""

    pixels: FloatArray
    """sRGB in [0, 1], shape (height, width, 3); with opacity premultiplied, shape (height, width, 4)."""
    width: int
    """Of the image itself [px]."""
    height: int

    @property
    def is_reduced(self) -> bool:
        """Whether the image itself is larger."""
        return self.pixels.shape[:2] != (self.height, self.width)


def shown_image(source: ImageSource, name: str | None, most: int = PAGE_PIXELS) -> Shown:
    """The image, smaller by a whole factor where it has more than ``most`` pixels or is too long for a WebP.

    Raises:
        ImageError, TypeError: as ``image_of``.
    """
    facts = facts_of(source)
    factor = 1
    if facts:
        factor = math.ceil(
            max(1, math.sqrt(facts.width * facts.height / most), max(facts.width, facts.height) / WEBP_SIDE)
        )
    pixels = image_of(source, name, factor=factor)
    height, width = pixels.shape[:2]
    return Shown(pixels, facts.width if facts else width, facts.height if facts else height)


def error_map(shown: Bytes, target: FloatArray) -> Bytes:
    """Where a file differs from an image: the root of the mean square of the channels' differences, black for
    none, white for ``MOST_ERROR`` and more.

    Args:
        shown: the file as a viewer shows it, not premultiplied, shape (height, width, 4).
        target: the image, as ``Shown.pixels``; both lie on white.

    Returns:
        RGB, shape (height, width, 3).
    """
    alpha = shown[..., 3:] / np.float32(255)
    error = on_white(target) - (shown[..., :3] * alpha + 255 * (1 - alpha))
    size = np.sqrt(np.mean(error**2, axis=2))
    levels = np.clip(np.round(size * (255 / MOST_ERROR)), 0, 255).astype(np.uint8)
    return np.asarray(
        cv2.cvtColor(cv2.applyColorMap(levels, cv2.COLORMAP_INFERNO), cv2.COLOR_BGR2RGB), np.uint8
    )


def map_colors(count: int = 9) -> list[str]:
    """Colours along the error map's scale, for a legend, ``#rrggbb``."""
    levels = np.linspace(0, 255, count).astype(np.uint8)[:, None]
    colors = cv2.applyColorMap(levels, cv2.COLORMAP_INFERNO)[:, 0, ::-1]
    return ["#" + bytes(color.tolist()).hex() for color in colors]


def on_white(pixels: FloatArray) -> FloatArray:
    """An image in 0..255 on white, shape (height, width, 3)."""
    levels = pixels[..., :3] * np.float32(255)
    if pixels.shape[2] == 4:
        levels = levels + 255 * (1 - pixels[..., 3:])
    return np.asarray(levels, np.float32)


def straight(pixels: FloatArray) -> Bytes:
    """An image in 8 bits, not premultiplied, with opacity if it has some."""
    if pixels.shape[2] == 4:
        alpha = pixels[..., 3:]
        color = np.divide(pixels[..., :3], alpha, out=np.zeros_like(pixels[..., :3]), where=alpha > 0)
        pixels = np.concatenate([color, alpha], axis=2)
    return np.round(255 * np.clip(pixels, 0, 1)).astype(np.uint8)


def encoded(pixels: FloatArray, room: float) -> str:
    """An image as a data URI: without loss where it is a drawing and small, else as good as ``room`` bytes
    allow.
    """
    levels = straight(pixels)
    image = Image.fromarray(levels)
    if _has_few_colors(levels):
        data = _webp(image, lossless=True)
        if len(data) <= room:
            return image_uri(data)
    return image_uri(_first_within(image, QUALITIES, room))


def encoded_map(pixels: Bytes, room: float) -> str:
    """An error map as a data URI."""
    return image_uri(_first_within(Image.fromarray(pixels), (MAP_QUALITY, 50, 30, 10), room))


def _first_within(image: Image.Image, qualities: Sequence[int], room: float) -> bytes:
    """Of the first quality that fits; where none does, of a smaller copy."""
    for quality in qualities:
        data = _webp(image, quality=quality)
        if len(data) <= room:
            return data
    if min(image.size) < 2:
        return data
    return _first_within(image.reduce(2), qualities[-2:], room)


def _webp(image: Image.Image, *, lossless: bool = False, quality: int = 80) -> bytes:
    file = io.BytesIO()
    image.save(file, "WEBP", lossless=lossless, quality=quality, method=2)
    return file.getvalue()


def _has_few_colors(levels: Bytes) -> bool:
    whole = np.zeros((*levels.shape[:2], 4), np.uint8)
    whole[..., : levels.shape[2]] = levels
    return len(np.unique(whole.reshape(-1, 4).view(np.uint32))) <= FEW_COLORS


def thumbnails(target: FloatArray, shown: Bytes) -> bytes:
    """Small copies of an image and of the file, side by side on white, WebP.

    Args:
        target: the image, as ``Shown.pixels``.
        shown: the file, not premultiplied, shape (height, width, 4).
    """
    alpha = shown[..., 3:] / np.float32(255)
    flat = shown[..., :3] * alpha + 255 * (1 - alpha)
    height, width = target.shape[:2]
    scale = min(1.0, THUMBNAIL / max(width, height))
    size = max(1, round(width * scale)), max(1, round(height * scale))
    both = [cv2.resize(each, size, interpolation=cv2.INTER_AREA) for each in (on_white(target), flat)]
    gap = np.full((size[1], GAP, 3), 255, np.float32)
    levels = np.clip(np.round(np.concatenate([both[0], gap, both[1]], axis=1)), 0, 255).astype(np.uint8)
    return _webp(Image.fromarray(levels), quality=70)


THUMBNAIL = 112
"""Longest side of an image in a list [px]."""

GAP = 3
"""Between the two [px]."""
