"""An SVG's shapes on its page in real units, upwards: what files for machines are written from."""

from __future__ import annotations

import itertools
from dataclasses import dataclass, replace

import numpy as np

from warpsplat.svg.clip import clipped
from warpsplat.svg.gradients import FlatColor
from warpsplat.svg.inspect import inspect_svg, known_size
from warpsplat.svg.page import picture_area
from warpsplat.svg.read import is_background
from warpsplat.svg.shapes import Shape, opacity_of
from warpsplat.svg.structure import read_shapes
from warpsplat.svg.values import Color


@dataclass(frozen=True)
class Drawn:
    """An SVG's shapes in the units of a page whose origin is its lower left corner."""

    width: float
    height: float
    shapes: list[Shape]
    """In painter's order, in these units; gradients and the fields about the SVG are not moved."""


def drawn_on_page(text: str, units_per_inch: float, *, background: bool) -> Drawn:
    """Return what an SVG draws.

    Fills end at the page's border, as in a viewer. A group's opacity becomes that of its shapes. Strokes that
    are stretched have their mean width. ``background``: whether a rectangle that fills the page, or the
    picture on it, behind everything is a shape.

    Raises:
        ImageError: Not an SVG, one of unknown size, or one with something other than fills and strokes.
    """
    width, height = known_size(inspect_svg(text).root)
    shapes = read_shapes(text, 1.0, see_through=True, outlines=True)
    left, top, right, bottom = picture_area(text) or (0.0, 0.0, 1.0, 1.0)
    area = np.array([[left * width, top * height], [right * width, bottom * height]])
    if not background and len(shapes) > 1 and is_background(shapes[0], area):
        shapes = shapes[1:]
    page = np.array([[0, 0], [width, 0], [width, height], [0, height]], np.float64)
    with np.errstate(all="ignore"):  # boxes of straight lines
        parts = [[shape] if shape.line else clipped([shape], page) for shape in shapes]
    per_inch = 96.0  # pixels of an inch (CSS)
    scale = units_per_inch / per_inch
    upwards, shift = np.diag([scale, -scale]), np.array([0, scale * height])
    moved = []
    for shape in itertools.chain.from_iterable(parts):
        line = shape.line
        if line:
            dashes = tuple(scale * length for length in line.dashes)
            line = replace(line, width=scale * line.width, dashes=dashes)
        subpaths = [subpath.moved(upwards, shift) for subpath in shape.subpaths]
        moved.append(replace(shape, subpaths=subpaths, line=line, known_box=[]))
    return Drawn(scale * width, scale * height, moved)


def color_of(shape: Shape) -> tuple[Color, float]:
    """Return a shape's colour, sRGB in 0..1, and its opacity; of a gradient the means of its stops."""
    if isinstance(shape.paint, FlatColor):
        return shape.paint.color, opacity_of(shape)
    stops = shape.paint.stops  # type: ignore[union-attr]  # pictures are in no file without kept elements
    colors = np.array([(*stop.color, stop.opacity) for stop in stops]).mean(axis=0).tolist()
    return (colors[0], colors[1], colors[2]), shape.opacity * colors[3]
