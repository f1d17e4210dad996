"""Shapes and groups of them, with the fields of DiffVG's classes.

Shapes have units of their own, which ``ShapeGroup.shape_to_canvas`` maps to the canvas. A ``stroke_width`` is
half of SVG's: how far the stroke reaches from its line [shape units], shape ().
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import torch

from warpsplat.pydiffvg.color import Color
from warpsplat.svg.paths import Subpath, cubics
from warpsplat.svg.shapes import LineStyle

Tensor = torch.Tensor


def _one() -> Tensor:
    return torch.tensor(1.0)


@dataclass(eq=False)
class Circle:
    """A circle."""

    radius: Tensor
    """[shape units], shape ()."""
    center: Tensor
    """[shape units], shape (2,)."""
    stroke_width: Tensor = field(default_factory=_one)
    id: str = ""


@dataclass(eq=False)
class Ellipse:
    """An ellipse whose axes are those of the coordinates."""

    radius: Tensor
    """Along x and y [shape units], shape (2,)."""
    center: Tensor
    """[shape units], shape (2,)."""
    stroke_width: Tensor = field(default_factory=_one)
    id: str = ""


@dataclass(eq=False)
class Path:
    """A sequence of lines, quadratics and cubics."""

    num_control_points: Tensor
    """Control points of each segment: 0 for a line, 1 for a quadratic, 2 for a cubic; shape (segment,)."""
    points: Tensor
    """End and control points [shape units], shape (point, 2). A closed path does not repeat its first one."""
    is_closed: bool
    stroke_width: Tensor = field(default_factory=_one)
    """Shape (), or (point,) for a width that changes along the path as the points do."""
    id: str = ""
    use_distance_approx: bool = False
    """Ignored: distances are not approximated here."""


@dataclass(eq=False)
class Polygon:
    """A polygon, or a polyline."""

    points: Tensor
    """[shape units], shape (point, 2)."""
    is_closed: bool
    stroke_width: Tensor = field(default_factory=_one)
    id: str = ""


@dataclass(eq=False)
class Rect:
    """A rectangle whose sides are parallel to the axes."""

    p_min: Tensor
    """Corner [shape units], shape (2,)."""
    p_max: Tensor
    """Opposite corner [shape units], shape (2,)."""
    stroke_width: Tensor = field(default_factory=_one)
    id: str = ""


Shape = Circle | Ellipse | Path | Polygon | Rect


@dataclass(eq=False)
class ShapeGroup:
    """Shapes that are painted as one, the stroke above the fill."""

    shape_ids: Tensor
    """Indices of the shapes, shape (n,)."""
    fill_color: Color
    use_even_odd_rule: bool = True
    stroke_color: Color = None
    shape_to_canvas: Tensor = field(default_factory=lambda: torch.eye(3))
    """Affine map of the shapes and their strokes to canvas units, shape (3, 3)."""
    id: str = ""
    line: LineStyle | None = None
    """Caps, joins and dashes of strokes read from a file; None: round and solid. DiffVG has no such field."""


def from_svg_path(
    path_str: str, shape_to_canvas: Tensor | None = None, force_close: bool = False
) -> list[Path]:
    """Return the subpaths of SVG path data (a ``d`` attribute), with arcs as cubics.

    ``shape_to_canvas``: affine map that the points are transformed by, shape (3, 3); ``force_close``: whether
    to close all subpaths.
    """
    paths = [path_of(subpath, is_closed=force_close or None) for subpath in cubics(path_str, keep_dots=False)]
    if shape_to_canvas is not None:
        for path in paths:
            matrix = shape_to_canvas.to(path.points)
            path.points = path.points @ matrix[:2, :2].T + matrix[:2, 2]
    return paths


def path_of(subpath: Subpath, *, is_closed: bool | None = None) -> Path:
    """Return a subpath, with lines and quadratics where its cubics are such.

    ``is_closed``: default: whether the subpath is closed or its ends meet.
    """
    points = subpath.points
    close = 1e-5  # distance of a path's ends [path units] below which it counts as closed
    meets = bool(np.abs(points[0] - points[-1]).max() < close)
    counts, chain = _segments(points)
    if is_closed is None:
        is_closed = subpath.is_closed or meets
    if is_closed and meets:
        chain = chain[:-1]
    elif is_closed:
        counts.append(0)
    return Path(
        torch.tensor(counts, dtype=torch.int32), torch.tensor(np.array(chain), dtype=torch.float32), is_closed
    )


def _segments(points: np.ndarray) -> tuple[list[int], list[Sequence[float]]]:
    """Return the number of control points of each cubic in its simplest form, and all points in order.

    ``points``: of the cubics, shape (1 + 3 x cubic, 2).
    """
    counts: list[int] = []
    chain = [points[0]]
    # Distance of a cubic's control points from those of a line or quadratic, relative to its coordinates,
    # below which it is one.
    straight = 1e-6
    for p0, p1, p2, p3 in zip(points[:-1:3], points[1::3], points[2::3], points[3::3], strict=True):
        tolerance = straight * (1 + np.abs([p0, p1, p2, p3]).max())
        first, second = 1.5 * p1 - 0.5 * p0, 1.5 * p2 - 0.5 * p3
        if np.abs(p1 - (2 * p0 + p3) / 3).max() < tolerance > np.abs(p2 - (p0 + 2 * p3) / 3).max():
            counts.append(0)
        elif np.abs(first - second).max() < tolerance:
            counts.append(1)
            chain.append((first + second) / 2)
        else:
            counts.append(2)
            chain += [p1, p2]
        chain.append(p3)
    return counts, chain
