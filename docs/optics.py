"""The picture of docs/scans.md: ``python docs/optics.py [FILE]``.

A badge as a scanner and programs would have saved it, its drawing as it is, and with what they did undone.
"""

from __future__ import annotations

import io
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
from PIL import Image, ImageFilter

import warpsplat
from warpsplat.svg.viewer import on_white, render_svg

FILE = Path(__file__).parent / "images" / "optics.webp"
SIDE, BIG, ZOOM = 96, 8, 8
"""Pixels of the images, how many times as large the badge is drawn, and how many times they are shown."""
CUT = (14, 64, 54, 90)
"""The part that is shown: left, top, right, bottom [px]."""

BADGE = f"""<svg xmlns="http://www.w3.org/2000/svg"
 width="{SIDE * BIG}" height="{SIDE * BIG}" viewBox="0 0 96 96">
<rect width="96" height="96" fill="#f4f1e8"/><rect x="5" y="5" width="86" height="86" rx="21" fill="#20304f"/>
<circle cx="64" cy="34" r="14" fill="#ffc44d"/><path fill="#2f8f83" d="M14 74 38 34l24 40z"/>
<path fill="#53b8a6" d="M42 74l18-26 22 26z"/>
<path fill="none" stroke="#f4f1e8" stroke-width="2.4" d="M21 82c11-6 18 3 28 0s16-5 26 0"/></svg>"""

IMAGE = Image.Image


def small(image: IMAGE, how: Image.Resampling = Image.Resampling.BOX) -> IMAGE:
    """Return an image at its final size."""
    return image.resize((SIDE, SIDE), how)


def in_linear_light(image: IMAGE) -> IMAGE:
    """Return an image made smaller in linear light, about."""
    light = (np.asarray(image) / 255) ** 2.2
    means = light.reshape(SIDE, BIG, SIDE, BIG, 3).mean(axis=(1, 3))
    return Image.fromarray(np.round(255 * means ** (1 / 2.2)).astype(np.uint8))


def scanned(image: IMAGE) -> IMAGE:
    """On paper, with uneven light, a soft lens, grain, as JPEG."""
    soft = np.asarray(small(image).filter(ImageFilter.GaussianBlur(0.8)), np.float64)
    rng, across = np.random.default_rng(3), np.linspace(1, 0.95, SIDE)[:, None]
    soft = soft * across * (0.99, 0.98, 0.95) + rng.normal(0, 1.5, soft.shape)
    data = io.BytesIO()
    Image.fromarray(np.clip(np.round(soft), 0, 255).astype(np.uint8)).save(data, "JPEG", quality=85)
    return Image.open(data).convert("RGB")


MADE: list[Callable[[IMAGE], IMAGE]] = [
    lambda image: small(image).filter(ImageFilter.UnsharpMask(1, 90, 0)),
    lambda image: small(image).filter(ImageFilter.GaussianBlur(0.7)),
    in_linear_light,
    scanned,
]
"""Sharpened, blurred, resized in linear light, scanned."""


def drawn(image: IMAGE, optics: str = "auto") -> IMAGE:
    """Return a drawing of an image as a viewer shows it, enlarged."""
    svg = warpsplat.vectorize(image, subject="drawing", optics=optics).svg
    return Image.fromarray(np.asarray(on_white(render_svg(svg, zoom=ZOOM))).astype(np.uint8))


def main(file: Path = FILE) -> None:
    """Draw the picture."""
    badge = Image.fromarray(np.asarray(on_white(render_svg(BADGE))).astype(np.uint8))
    size = ZOOM * SIDE, ZOOM * SIDE
    left, top, right, bottom = (ZOOM * side for side in CUT)
    rows = []
    for make in MADE:
        image = make(badge)
        columns = image.resize(size, Image.Resampling.NEAREST), drawn(image, "none"), drawn(image)
        rows.append(
            np.concatenate([np.asarray(each.crop((left, top, right, bottom))) for each in columns], axis=1)
        )
    Image.fromarray(np.concatenate(rows)).save(file, "WEBP", quality=82, method=6)


if __name__ == "__main__":
    main(*map(Path, sys.argv[1:]))
