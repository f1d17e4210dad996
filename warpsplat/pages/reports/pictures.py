"""Pictures of a report, small enough to be embedded."""

from __future__ import annotations

import io
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt
from PIL import Image

from warpsplat.files.image import WEBP_SIDE
from warpsplat.files.sources import ImageSource, held, image_of, source_name
from warpsplat.pages.environment import webp_uri
from warpsplat.run.memory import facts_of
from warpsplat.run.render import to_pillow
from warpsplat.scene import FloatArray
from warpsplat.svg.page import picture_view, with_view

Bytes = npt.NDArray[np.uint8]

PAGE_PIXELS = 2_000_000
"""Most pixels of a picture on a page: larger images are reduced."""

SHORT_PIXELS = 500_000
"""The same after a run that was short of memory."""

CAPACITY, CAPACITY_SHARE = 190_000, 1.5
"""Bytes that the pictures of a page may take: a constant, and a share of the image's file. Encoded in base64,
a page takes no more than the SVG, twice the image and 400 kB."""

QUALITIES = (92, 85, 75, 60, 40, 20)
"""Qualities of WebP; the first that fits is used."""

MAP_QUALITIES = (70, 50, 30, 10)
"""Qualities of the error map."""

MOST_ERROR = 64.0
"""End of the error map's scale, the same on all pages [levels of 255]."""

THUMBNAIL, THUMBNAIL_GAP = 112, 3
"""Longest side of an image in a list, and the gap between two [px]."""


@dataclass(frozen=True)
class ShownImage:
    """An image as a page shows it."""

    pixels: FloatArray
    """sRGB in [0, 1], shape (height, width, 3), or premultiplied with opacity, shape (height, width, 4)."""
    width: int
    """Width of the image itself [px]."""
    height: int
    """Height of the image itself [px]."""

    @property
    def reduced_size(self) -> str:
        """Size of the pixels if the image itself is larger; otherwise empty."""
        height, width = self.pixels.shape[:2]
        return "" if (height, width) == (self.height, self.width) else f"{width}×{height}"


def shown_image(source: ImageSource, name: str | None, most: int = PAGE_PIXELS) -> ShownImage:
    """Return an image, reduced by a whole factor to at most ``most`` pixels and the longest side of a WebP.

    Raises:
        ImageError, TypeError: as ``image_of``.
    """
    name, source = name or source_name(source), held(source)
    facts = facts_of(source, name)
    width, height = facts.width, facts.height
    factor = math.ceil(max(1, math.sqrt(width * height / most), max(width, height) / WEBP_SIDE))
    return ShownImage(image_of(source, name, factor=factor), width, height)


def capacity_of(image: ImageSource) -> float:
    """Return how many bytes the pictures of a page on an image may take."""
    return CAPACITY + CAPACITY_SHARE * len(image) if isinstance(image, bytes) else math.inf


def error_map(drawn: Bytes, target: FloatArray) -> Bytes:
    """Return the root mean square difference of the channels of each pixel on white, in colours of a scale.

    Args:
        drawn: the file as a viewer shows it, not premultiplied, shape (height, width, 4).
        target: the image, as ``ShownImage.pixels``.

    Returns:
        RGB from black for no difference to white for ``MOST_ERROR`` and more, shape (height, width, 3).
    """
    size = np.sqrt(np.mean((_on_white(target) - _bytes_on_white(drawn)) ** 2, axis=2))
    levels = np.clip(np.round(size * (255 / MOST_ERROR)), 0, 255).astype(np.uint8)
    return np.ascontiguousarray(cv2.applyColorMap(levels, cv2.COLORMAP_INFERNO)[..., ::-1], np.uint8)


def map_colors() -> list[str]:
    """Return colours along the error map's scale, as ``#rrggbb``."""
    colors = cv2.applyColorMap(np.linspace(0, 255, 9).astype(np.uint8), cv2.COLORMAP_INFERNO)[:, 0, ::-1]
    return ["#" + bytes(color.tolist()).hex() for color in colors]


def _on_white(pixels: FloatArray) -> FloatArray:
    """Return an image in 0..255 on white, shape (height, width, 3)."""
    levels = pixels[..., :3] * np.float32(255)
    if pixels.shape[2] == 4:
        levels = levels + 255 * (1 - pixels[..., 3:])
    return np.asarray(levels, np.float32)


def _bytes_on_white(drawn: Bytes) -> FloatArray:
    """Return an image that is not premultiplied in 0..255 on white, shape (height, width, 3)."""
    alpha = drawn[..., 3:] / np.float32(255)
    return np.asarray(drawn[..., :3] * alpha + 255 * (1 - alpha), np.float32)


def encoded(pixels: FloatArray, capacity: float) -> str:
    """Return an image as a data URI of a WebP of at most ``capacity`` bytes, drawings without loss."""
    image = to_pillow(pixels)
    if image.getcolors(4096):  # a drawing
        data = _webp(image, lossless=True)
        if len(data) <= capacity:
            return webp_uri(data)
    return first_that_fits(image, QUALITIES, capacity)


def first_that_fits(image: Image.Image, qualities: Sequence[int], capacity: float) -> str:
    """Return a WebP of the first quality that fits as a data URI, of a smaller copy if none does."""
    for quality in qualities:
        data = _webp(image, quality=quality)
        if len(data) <= capacity or (quality == qualities[-1] and min(image.size) < 2):
            return webp_uri(data)
    return first_that_fits(image.reduce(2), qualities[-2:], capacity)


def original_entry(url: str) -> dict[str, Any]:
    """Return the viewer's entry of an image: its name, label, address, and whether pixels stay sharp."""
    return {"name": "image", "label": "Original", "url": url, "pixels": True}


def picture_alone(svg: str, shown: ShownImage) -> tuple[str, str | None]:
    """Return a file as its picture alone if it is on a sheet, with the view box; else it and None."""
    view = picture_view(svg, shown.width, shown.height)
    return (svg if view is None else with_view(svg, view, shown.width, shown.height)), view


def _webp(image: Image.Image, **options: int) -> bytes:
    file = io.BytesIO()
    image.save(file, "WEBP", method=2, **options)
    return file.getvalue()


def thumbnails(target: FloatArray, drawn: Bytes) -> str:
    """Return small copies of an image and a file, as for ``error_map``, side by side, as a data URI."""
    height, width = target.shape[:2]
    scale = min(1.0, THUMBNAIL / max(width, height))
    size = max(1, round(width * scale)), max(1, round(height * scale))
    both = (_on_white(target), _bytes_on_white(drawn))
    first, second = (cv2.resize(each, size, interpolation=cv2.INTER_AREA) for each in both)
    gap = np.full((size[1], THUMBNAIL_GAP, 3), 255, np.float32)
    levels = np.clip(np.round(np.concatenate([first, gap, second], axis=1)), 0, 255).astype(np.uint8)
    return webp_uri(_webp(Image.fromarray(levels), quality=70))
