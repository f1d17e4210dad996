"""Render SVGs as frames of an animation."""

from __future__ import annotations

from PIL import Image

from warpsplat.errors import ImageError
from warpsplat.svg.inspect import inspect_svg, svg_size
from warpsplat.svg.viewer import render_own, render_svg

Size = tuple[int, int]
"""Width and height [px]."""


def size_of(text: str) -> tuple[float, float]:
    """Return the size of an SVG [px].

    Raises:
        ImageError: it says none.
    """
    size = svg_size(inspect_svg(text).root)
    if size is None:
        raise ImageError("says neither its size nor a viewBox")
    return size


def screen(text: str, zoom: float) -> Size:
    """Return the whole pixels that a magnified SVG covers."""
    width, height = size_of(text)
    return max(1, int(width * zoom + 1e-6)), max(1, int(height * zoom + 1e-6))


def picture(text: str, size: Size, zoom: float | None = None) -> Image.Image:
    """Render an SVG as a viewer shows it, RGBA, cropped to ``size``.

    Args:
        text: written here and of this size, without a ``zoom``; else any.
        size: of the picture.
        zoom: magnification.

    Raises:
        ImageError: it cannot be drawn.
    """
    image = render_own(text) if zoom is None else render_svg(text, zoom=zoom)
    return image.convert("RGBA").crop((0, 0, *size))
