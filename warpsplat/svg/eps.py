"""Encapsulated PostScript of an SVG's fills and strokes (PostScript Language Reference, level 2).

PostScript has no opacity: translucent colours are what they are on white. Gradients are their mean colour.
"""

from __future__ import annotations

import math

import numpy as np

from warpsplat.scene import Cap, Join, Rule
from warpsplat.svg.numbers import number
from warpsplat.svg.outlines import color_of, drawn_on_page
from warpsplat.svg.paths import Subpath
from warpsplat.svg.shapes import LineStyle, Shape

POINTS = 72.0
"""Points in an inch."""

CAPS = {Cap.BUTT: 0, Cap.ROUND: 1, Cap.SQUARE: 2}
JOINS = {Join.MITER: 0, Join.ROUND: 1, Join.BEVEL: 2}

SHORTHANDS = "/m{moveto}bind def/l{lineto}bind def/c{curveto}bind def/h{closepath}bind def"
SHORTHANDS += "/k{setrgbcolor}bind def"


def draw_eps(text: str, *, zoom: float = 1.0) -> bytes:
    """Return an SVG's shapes as an EPS, ``zoom`` times as large; the same text gives the same bytes.

    Raises:
        ImageError: As ``drawn_on_page``.
    """
    page = drawn_on_page(text, POINTS * zoom, background=True)
    size = row([page.width, page.height])
    lines = [
        "%!PS-Adobe-3.0 EPSF-3.0",
        f"%%BoundingBox: 0 0 {math.ceil(page.width)} {math.ceil(page.height)}",
        f"%%HiResBoundingBox: 0 0 {size}",
        "%%LanguageLevel: 2",
        "%%EndComments",
        f"gsave {SHORTHANDS}",
        f"0 0 {size} rectclip",
        *(line for shape in page.shapes for line in _painted(shape)),
        "grestore",
    ]
    return "\n".join([*lines, "%%EOF\n"]).encode()


def row(values: list[float]) -> str:
    """Return numbers in as few characters as possible."""
    decimals = 3  # decimals of coordinates [pt]
    return " ".join(number(value, decimals) for value in values)


def _painted(shape: Shape) -> list[str]:
    """Return the lines that paint a shape."""
    color, opacity = color_of(shape)
    on_white = row([1 - opacity * (1 - level) for level in color])
    paths = [_path(subpath) for subpath in shape.subpaths]
    if not opacity or not paths:
        return []
    if shape.line:
        return [f"{on_white} k {_pen(shape.line)}", *paths, "stroke"]
    return [f"{on_white} k", *paths, "eofill" if shape.rule == Rule.EVENODD else "fill"]


def _pen(line: LineStyle) -> str:
    """Return the operators that set how strokes are drawn."""
    offset, *dashes = line.dashes or (0.0,)
    return (
        f"{row([line.width])} setlinewidth {CAPS[line.cap]} setlinecap {JOINS[line.join]} setlinejoin "
        f"{row([line.miter_limit])} setmiterlimit [{row(dashes)}] {row([offset])} setdash"
    )


def _path(subpath: Subpath) -> str:
    """Return the operators that draw a subpath."""
    points = subpath.points
    made = [f"{row(points[0].tolist())} m"]
    for i in range(0, len(points) - 1, 3):
        piece = points[i : i + 4]
        if np.abs(np.diff(piece, 2, axis=0)).max() < 1e-9:  # a straight line has its handles at thirds
            made.append(f"{row(piece[3].tolist())} l")
        else:
            made.append(f"{row(piece[1:].ravel().tolist())} c")
    return "\n".join([*made, "h"] if subpath.is_closed else made)
