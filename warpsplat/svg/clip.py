"""Clipping of shapes by nested viewports and ``clip-path``, and whether shapes overlap."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np

from warpsplat.errors import ImageError
from warpsplat.portable.elementary import hypot
from warpsplat.portable.linear import product
from warpsplat.scene import Bools
from warpsplat.svg.document import Document, Element, name_of
from warpsplat.svg.geometry import Matrix, about, moved, outline, parse_transform
from warpsplat.svg.gradients import parse_link
from warpsplat.svg.paths import Points, Subpath, cubics, straight
from warpsplat.svg.shapes import Shape
from warpsplat.svg.values import SvgViewport, check_length

TOLERANCE = 1e-6
"""Distance [px] from a line within which a point lies on it."""

EDGE = 1e-3
"""Overlap [px] of boxes that still counts as touching."""


def overlap(shapes: list[Shape]) -> bool:
    """Return whether the boxes of shapes overlap."""
    if len(shapes) < 2:
        return False
    overlap_shapes = 2000  # most shapes of a group that are compared with each other
    if len(shapes) > overlap_shapes:
        return True
    boxes = np.stack([shape.box() for shape in shapes])
    low, high = boxes[:, 0] + EDGE, boxes[:, 1] - EDGE
    return bool(np.all((low[:, None] < high) & (low < high[:, None]), axis=2).sum() > len(shapes))


def clipped(shapes: list[Shape], corners: Points) -> list[Shape]:
    """Return the parts of shapes inside a convex polygon.

    Raises:
        ImageError: A stroke reaches beyond it.
    """
    kept: list[Shape] = []
    ring, inside, outside = _places(shapes, corners)
    for shape, is_inside, is_outside in zip(shapes, inside, outside, strict=True):
        if is_inside:
            is_twin = shape.is_twin and bool(kept) and kept[-1].subpaths is shape.subpaths
            kept.append(replace(shape, is_twin=is_twin))
        elif not is_outside:
            if shape.line:
                raise ImageError("a stroke that a viewport cuts off is not supported")
            if parts := [part for part in (cut_subpath(s, ring) for s in shape.subpaths) if part]:
                kept.append(replace(shape, subpaths=parts, is_rect=False, is_twin=False, known_box=[]))
    return kept


def within(shapes: list[Shape], corners: Points) -> list[Shape]:
    """Return the shapes that lie wholly inside a convex polygon."""
    return [shape for shape, is_inside in zip(shapes, _places(shapes, corners)[1], strict=True) if is_inside]


def _places(shapes: list[Shape], corners: Points) -> tuple[Points, Bools, Bools]:
    """Return a polygon with its inside to the left, and which shapes' boxes lie inside it, and outside."""
    following = np.roll(corners, -1, axis=0)
    doubled = np.sum(corners[:, 0] * following[:, 1] - corners[:, 1] * following[:, 0])
    ring = corners if doubled > 0 else corners[::-1]
    if not shapes or not abs(doubled) > TOLERANCE:  # a polygon without area shows nothing
        return ring, np.zeros(len(shapes), np.bool_), np.ones(len(shapes), np.bool_)
    boxes = np.stack([shape.box() for shape in shapes])
    around = boxes.reshape(-1, 4)[:, [0, 1, 2, 1, 2, 3, 0, 3]].reshape(-1, 4, 2)
    sides = zip(ring, np.roll(ring, -1, axis=0), strict=True)
    heights = np.stack([product(around - a, _normal(a, b)) for a, b in sides])
    inside, outside = (heights >= -EDGE).all(axis=(0, 2)), (heights <= EDGE).all(axis=2).any(axis=0)
    return ring, np.asarray(inside), np.asarray(outside)


def _normal(a: Points, b: Points) -> Points:
    """Return the unit vector to the left of the line from ``a`` to ``b``."""
    x, y = (b - a) / hypot(*(b - a))
    return np.array([-y, x])


def cut_subpath(subpath: Subpath, corners: Points) -> Subpath | None:
    """Return a closed subpath of a fill within a convex polygon; None if nothing is left.

    Cut by one side after another (Sutherland and Hodgman): what lies beyond a side becomes a straight line
    along it, so that winding numbers inside stay. An open subpath is closed by a straight line. The polygon's
    ``corners``, shape (corner, 2), have its inside to the left.
    """
    points = subpath.points
    chain = [points[i : i + 4] for i in range(0, len(points) - 1, 3)]
    chain += _joined(points[-1], points[0])
    for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        chain = _cut(chain, a, _normal(a, b))
        if not chain:
            return None
    points = np.concatenate([chain[0][:1], *(cubic[1:] for cubic in chain)])
    return Subpath(points, True, False)


def _joined(start: Points, end: Points) -> list[Points]:
    """Return a straight cubic between two points, or nothing where they coincide."""
    if np.allclose(start, end, rtol=0, atol=TOLERANCE):
        return []
    return [np.concatenate([start[None], straight(start, end)])]


def _cut(chain: list[Points], at: Points, inward: Points) -> list[Points]:
    """Return the part of a closed chain of cubics where ``(point - at) . inward`` is not negative."""
    kept: list[Points] = []
    for cubic in chain:
        for piece in _split(cubic, product(cubic - at, inward)):
            if product(product(piece - at, inward), [1, 3, 3, 1]) < -8 * TOLERANCE:
                continue  # the middle lies outside
            kept += [*(_joined(kept[-1][-1], piece[0]) if kept else ()), piece]
    return kept + _joined(kept[-1][-1], kept[0][0]) if kept else []


def _split(cubic: Points, heights: Points) -> list[Points]:
    """Split a cubic into pieces that are each on one side of a line; ``heights``: of its points above it."""
    if (heights >= -TOLERANCE).all() or (heights <= TOLERANCE).all():
        return [cubic]
    pieces, start = [], 0.0
    for t in _zeros(*heights.tolist()):
        left, cubic = _halves(cubic, (t - start) / (1 - start))
        pieces.append(left)
        start = t
    return [*pieces, cubic]


def _zeros(a: float, b: float, c: float, d: float) -> list[float]:
    """Return where between 0 and 1 a cubic with these control values changes its sign, ascending."""

    def height(t: float) -> float:
        return a + t * (3 * (b - a) + t * (3 * (c - 2 * b + a) + t * (d - 3 * c + 3 * b - a)))

    # A cubic is monotonic between its extrema, where u t^2 + 2 v t + w is 0.
    u, v, w = d - 3 * c + 3 * b - a, c - 2 * b + a, b - a
    root = v + math.copysign(math.sqrt(max(v * v - u * w, 0.0)), v)
    extrema = [top / bottom for top, bottom in ((-root, u), (w, -root)) if abs(top) < abs(bottom)]
    # Where an extremum is 0, the curve touches the line or crosses it with a slope of 0.
    near_end = 1e-9  # cubics are not cut closer to their ends than this, in their parameter
    extrema = sorted(t for t in extrema if near_end < t < 1 - near_end and height(t) != 0)
    found = []
    for low, high in pairwise([near_end, *extrema, 1 - near_end]):
        if (height(low) > 0) == (height(high) > 0):
            continue
        start, end = (low, high) if height(high) > 0 else (high, low)
        while min(start, end) < (middle := (start + end) / 2) < max(start, end):
            start, end = (start, middle) if height(middle) > 0 else (middle, end)
        found.append(start)
    return found


def _halves(cubic: Points, t: float) -> tuple[Points, Points]:
    """Return both parts of a cubic, cut at ``t`` (de Casteljau)."""
    rows = [cubic]
    while len(rows[-1]) > 1:
        rows.append(rows[-1][:-1] + t * (rows[-1][1:] - rows[-1][:-1]))
    return np.array([row[0] for row in rows]), np.array([row[-1] for row in reversed(rows)])


def polygon(corners: Points) -> Subpath:
    """Return a closed polygon with these corners, shape (corner, 2)."""
    sides = (straight(a, b) for a, b in pairwise([*corners, corners[0]]))
    return Subpath(np.concatenate([corners[:1], *sides]), True, False)


def clip_rectangle(link: str, document: Document, matrix: Matrix, viewport: SvgViewport) -> Points | None:
    """Return the corners of a ``clip-path`` that is one rectangle (SVG 1.1, 14.3); None: there is no clip.

    Raises:
        ImageError: It is not a rectangle.
    """
    if link == "none":
        return None
    found = parse_link(link)
    element = document.called(found[0]) if found else None
    content = document.once(_content, element) if element is not None else None
    if element is not None and content is not None:
        units = element.get("clipPathUnits", "userSpaceOnUse")
        for part in (element, content):
            style = document.style_of(part)
            own = about(style["transform-origin"], viewport, parse_transform(style["transform"]))
            matrix = product(matrix, own)
            units += "" if style["clip-path"] == "none" and style["display"] != "none" else " clipped"
        drawn = cubics(outline("rect", content.attrib, viewport), keep_dots=False)
        is_rect = style["visibility"] == "visible" and drawn and len(drawn[0].points) == 13
        if units == "userSpaceOnUse" and is_rect:
            return moved(matrix, drawn[0].points[:12:3])
    raise ImageError("uses a clip-path that is not a rectangle, which is not supported")


def _content(element: Element, document: Document) -> Element | None:
    """Return the only element in a ``clipPath`` if it is a rectangle, else None."""
    content = [child for child in element if name_of(child)]
    if name_of(element) != "clipPath" or len(content) != 1 or name_of(content[0]) != "rect":
        return None
    for part in (element, content[0]):
        for name, value in document.style_of(part).items() | part.attrib.items():
            check_length(name, value)
    return content[0]
