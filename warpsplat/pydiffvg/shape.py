"""Shapes and groups of them, with the fields of DiffVG's classes.

A ``stroke_width`` is half of what SVG calls so: a stroke covers what is nearer to its line.
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
    """Shape ()."""
    center: Tensor
    """Shape (2,)."""
    stroke_width: Tensor = field(default_factory=_one)
    id: str = ""


@dataclass(eq=False)
class Ellipse:
    """An ellipse with upright axes."""

    radius: Tensor
    """Along x and y, shape (2,)."""
    center: Tensor
    """Shape (2,)."""
    stroke_width: Tensor = field(default_factory=_one)
    id: str = ""


@dataclass(eq=False)
class Path:
    """Lines, quadratics and cubics, one after the other."""

    num_control_points: Tensor
    """Of each segment: 0 for a line, 1 for a quadratic, 2 for a cubic; shape (segment,)."""
    points: Tensor
    """Ends and control points in order, shape (point, 2). A closed path does not repeat its first point."""
    is_closed: bool
    stroke_width: Tensor = field(default_factory=_one)
    """Shape (), or (point,): it changes along the path as the points do."""
    id: str = ""
    use_distance_approx: bool = False
    """Not read: distances are not approximated here."""


@dataclass(eq=False)
class Polygon:
    """Straight lines."""

    points: Tensor
    """Shape (point, 2)."""
    is_closed: bool
    stroke_width: Tensor = field(default_factory=_one)
    id: str = ""


@dataclass(eq=False)
class Rect:
    """An upright rectangle."""

    p_min: Tensor
    """Shape (2,)."""
    p_max: Tensor
    """Shape (2,)."""
    stroke_width: Tensor = field(default_factory=_one)
    id: str = ""


Shape = Circle | Ellipse | Path | Polygon | Rect


@dataclass(eq=False)
class ShapeGroup:
    """Shapes that are painted as one."""

    shape_ids: Tensor
    """Numbers of the shapes, shape (n,)."""
    fill_color: Color
    use_even_odd_rule: bool = True
    stroke_color: Color = None
    shape_to_canvas: Tensor = field(default_factory=lambda: torch.eye(3))
    """Affine map of the shapes, and of their strokes, to canvas units; shape (3, 3)."""
    id: str = ""
    line: LineStyle | None = None
    """How strokes end, join and are dashed, where a file said so; else they are round and solid. DiffVG has
    no such field."""


def from_svg_path(
    path_str: str, shape_to_canvas: Tensor | None = None, force_close: bool = False
) -> list[Path]:
    """The subpaths of an SVG path's data, arcs as cubics, in coordinates that ``shape_to_canvas`` maps."""
    paths = [
        path_of(subpath, is_closed=True if force_close else None)
        for subpath in cubics(path_str, keep_dots=False)
    ]
    if shape_to_canvas is not None:
        for path in paths:
            matrix = shape_to_canvas.to(path.points)
            path.points = path.points @ matrix[:2, :2].T + matrix[:2, 2]
    return paths


CLOSE = 1e-5
"""Distance of a path's ends below which it counts as closed."""
STRAIGHT = 1e-6
"""How far from where a line or quadratic would have them the handles of a cubic may lie, over its size."""


def path_of(subpath: Subpath, *, is_closed: bool | None = None) -> Path:
    """A subpath, with the cubics that are lines or quadratics as such.

    Closed where ``is_closed`` says so; where nothing does, where the subpath is or its ends meet.
    """
    points = subpath.points
    meets = bool(np.abs(points[0] - points[-1]).max() < CLOSE)
    counts, chain = _segments(points)
    if is_closed is None:
        is_closed = subpath.is_closed or meets
    if is_closed and meets:
        chain = chain[:-1]
    elif is_closed:
        counts.append(0)
    return Path(
        torch.tensor(counts, dtype=torch.int32),
        torch.tensor(np.array(chain), dtype=torch.float32),
        is_closed,
    )


def _segments(points: np.ndarray) -> tuple[list[int], list[Sequence[float]]]:
    """Control points of each cubic as the simplest segment that it is, and all points in order."""
    counts: list[int] = []
    chain = [points[0]]
    for p0, p1, p2, p3 in zip(points[:-1:3], points[1::3], points[2::3], points[3::3], strict=True):
        tolerance = STRAIGHT * (1 + np.abs([p0, p1, p2, p3]).max())
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
