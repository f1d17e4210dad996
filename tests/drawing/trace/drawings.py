"""Drawings whose source is known, small."""

from __future__ import annotations

import io
import math

import numpy as np
from PIL import Image

from warpsplat.files.sources import image_of
from warpsplat.metrics import psnr
from warpsplat.scene import FloatArray
from warpsplat.svg.viewer import render_own


def star(x: float, y: float, outer: float, inner: float, tips: int = 5) -> str:
    """Points of a star."""
    angles = [math.pi * (k / tips - 0.5) for k in range(2 * tips)]
    radii = [outer if k % 2 == 0 else inner for k in range(2 * tips)]
    return " ".join(
        f"{x + r * math.cos(a):.3f},{y + r * math.sin(a):.3f}" for a, r in zip(angles, radii, strict=True)
    )


STAR = star(46, 42, 30, 12)

LOGO = (
    '<rect x="5" y="5" width="86" height="86" rx="20" fill="#2457a8"/>'
    f'<polygon points="{STAR}" fill="#ffd23f"/>'
    '<circle cx="75" cy="73" r="9" fill="#ee4266"/>'
    '<rect x="18" y="68" width="28" height="11" fill="#ffffff"/>'
)
"""Four regions on a transparent canvas."""


def draw_exactly(body: str, width: int = 96, height: int = 96) -> FloatArray:
    """An opaque drawing with the mean of 8x8 places a pixel: viewers take fewer."""
    fine = draw(f'<g transform="scale(8)">{body}</g>', 8 * width, 8 * height)
    return np.asarray(fine.reshape(height, 8, width, 8, 3).mean(axis=(1, 3)), np.float32)


def draw(body: str, width: int = 96, height: int = 96, *, hard: bool = False, jpeg: int = 0) -> FloatArray:
    """A drawing as an image: premultiplied with opacity where there is some.

    Args:
        body: elements of an SVG.
        width: [px]
        height: [px]
        hard: without antialiasing.
        jpeg: quality that it has been through; 0: none.
    """
    rendering = ' shape-rendering="crispEdges"' if hard else ""
    size = f'width="{width}" height="{height}" viewBox="0 0 {width} {height}"'
    image = render_own(f'<svg xmlns="http://www.w3.org/2000/svg" {size}{rendering}>{body}</svg>')
    return encoded(image.convert("RGB"), "jpeg", quality=jpeg) if jpeg else encoded(image, "png")


def encoded(image: Image.Image, kind: str, **options: int) -> FloatArray:
    """An image as a file of it shows it."""
    data = io.BytesIO()
    image.save(data, kind, **options)
    return image_of(data.getvalue())


def as_file(image: FloatArray, kind: str = "jpeg", **options: int) -> FloatArray:
    """Pixels in [0, 1] as a file of them shows them."""
    return encoded(Image.fromarray(np.round(255 * image).astype(np.uint8)), kind, **options)


def decibels(a: FloatArray, b: FloatArray) -> float:
    """PSNR of pixels in [0, 1]."""
    return psnr(255 * a, 255 * b)


def ground(color: str, width: int = 96, height: int = 96) -> str:
    """A rectangle over the whole canvas."""
    return f'<rect width="{width}" height="{height}" fill="{color}"/>'


def levels(image: FloatArray) -> FloatArray:
    """As regions are found in: premultiplied, 0..255, with opacity."""
    if image.shape[2] == 3:
        image = np.concatenate([image, np.ones_like(image[..., :1])], axis=2)
    return np.asarray(image * 255, np.float32)


def photograph(side: int = 64) -> FloatArray:
    """Nothing flat in it."""
    rng = np.random.default_rng(0)
    small = Image.fromarray(rng.integers(0, 256, (9, 9, 3), np.uint8))
    smooth = np.asarray(small.resize((side, side), Image.Resampling.BICUBIC), np.float32)
    return np.clip((smooth + rng.normal(0, 6, smooth.shape)) / 255, 0, 1).astype(np.float32)
