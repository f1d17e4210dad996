"""An SVG as a viewer shows it: drawn by resvg, an independent renderer."""

from __future__ import annotations

import io
import re
from pathlib import Path

import numpy as np
import numpy.typing as npt
import resvg_py
from PIL import Image

from warpsplat.errors import ImageError

Pixels = npt.NDArray[np.float64]


def render_svg(
    text: str, *, width: int | None = None, height: int | None = None, zoom: float | None = None
) -> Image.Image:
    """Render SVG text with resvg, at its own size, at a size in px, or magnified by ``zoom``.

    Raises:
        ImageError: resvg does not accept the text.
    """
    try:
        png = resvg_py.svg_to_bytes(
            svg_string=text, width=width, height=height, zoom=zoom, dpi=96.0, skip_system_fonts=True
        )
    except ValueError as error:
        raise ImageError(f"cannot be rendered: {str(error).splitlines()[0]}") from error
    return Image.open(io.BytesIO(bytes(png)))


def on_white(image: Image.Image) -> Pixels:
    """RGB in 0..255, shape (height, width, 3), transparency composited on white."""
    rgba = np.asarray(image.convert("RGBA")).astype(np.float64)
    alpha = rgba[..., 3:] / 255.0
    return np.asarray(rgba[..., :3] * alpha + 255.0 * (1.0 - alpha))


PIXELS_PER_UNIT = {"px": 1.0, "in": 96.0, "cm": 96 / 2.54, "mm": 96 / 25.4, "pt": 96 / 72, "pc": 16.0}
"""CSS absolute lengths."""


def svg_size(text: str, path: Path) -> tuple[int, int]:
    """Size [px] at which a viewer shows an SVG.

    Raises:
        ImageError: not an SVG; the message names ``path``.
    """
    try:
        # resvg knows every way of giving a size; a probe that keeps the proportions is cheap.
        wide = render_svg(text, width=64)
        own = re.search(r"<svg\b[^>]*?\swidth=[\"'](\d+\.?\d*)(px|in|mm|cm|pt|pc)?[\"']", text)
        box = re.search(r"<svg\b[^>]*?\sviewBox=[\"'][-\d.e]+[ ,]+[-\d.e]+[ ,]+(\d+\.?\d*)", text)
    except ImageError as error:
        raise ImageError(f"{path}: {error}") from error
    width = float(own[1]) * PIXELS_PER_UNIT[own[2] or "px"] if own else float(box[1]) if box else 100.0
    return max(1, round(width)), max(1, round(width * wide.height / wide.width))
