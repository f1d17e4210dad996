"""The scene that ``serialize_scene`` hands to ``apply``: its structure, hashable, and its tensors."""

from __future__ import annotations

import functools
import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import torch

from warpsplat.errors import UsageError
from warpsplat.pydiffvg.color import Color, LinearGradient, RadialGradient
from warpsplat.pydiffvg.gather import FIRST, Place, places_of
from warpsplat.pydiffvg.shape import Circle, Ellipse, Path, Polygon, Rect, Shape, ShapeGroup
from warpsplat.scene import Paint
from warpsplat.svg.shapes import LineStyle

Tensor = torch.Tensor

ZERO, ONE = 0, 1
"""Indices of a scene's numbers: the constants 0 and 1; from FIRST on come the values of its tensors."""

IDENTITY = np.eye(3).tolist()


class PaintStructure(NamedTuple):
    """Structure of a colour or gradient."""

    kind: Paint
    stops: int
    first: int
    """Index of its first number: four of a colour, or of a gradient's two points (or centre and radii); then
    the stops' offsets and their colours."""


class ShapeStructure(NamedTuple):
    """Structure of a shape."""

    kind: str
    """``path``, ``circle``, ``ellipse`` or ``rect``."""
    counts: tuple[int, ...]
    """Control points between the ends of each segment: 0, 1 or 2."""
    closed: bool
    points: int
    """End and control points."""
    tapers: bool
    """Whether the stroke has a width for each point."""
    first: int
    """Index of the first coordinate."""
    width: int
    """Index of the first width."""


class GroupStructure(NamedTuple):
    """Structure of a group."""

    shapes: tuple[ShapeStructure, ...]
    fill: PaintStructure | None
    stroke: PaintStructure | None
    even_odd: bool
    transform: int | None
    """Index of the first of its nine numbers; None: the identity."""
    uniform: bool
    """Whether the transform scales all directions alike."""
    one_width: bool
    """Whether all its shapes share one tensor as their width."""
    line: LineStyle | None


@dataclass(frozen=True)
class Structure:
    """Everything about a scene but the values in its tensors."""

    groups: tuple[GroupStructure, ...]

    @functools.cached_property
    def _hash(self) -> int:
        return hash(self.groups)

    def __hash__(self) -> int:
        """Computed once: a scene that stays the same is looked up at every step."""
        return self._hash


@dataclass(frozen=True)
class SceneArguments:
    """A serialized scene. Its tensors are those of the shapes and groups, not copies."""

    width: int
    """[canvas units]"""
    height: int
    """[canvas units]"""
    structure: Structure
    tensors: tuple[Tensor, ...]
    """The shapes' coordinates, their widths, the groups' fills, strokes and transforms: those of one kind lie
    side by side, so that ``joined`` has few operations."""

    @functools.cached_property
    def _runs(self) -> list[tuple[Tensor, ...]]:
        """Neighbours that can be joined along their first dimension, or are single numbers."""
        return [
            tuple(run)
            for _, run in itertools.groupby(self.tensors, lambda each: each.shape[1:] or each.dim())
        ]

    def joined(self) -> list[Tensor]:
        """Return the numbers of all tensors, joined by torch's own operations: for many tensors these take
        less time than a function in Python.
        """
        return [
            run[0] if len(run) == 1 else torch.cat(run) if run[0].dim() else torch.stack(run)
            for run in self._runs
        ]

    @functools.cached_property
    def places(self) -> tuple[Place, ...]:
        """Where the values of ``joined`` lie among the scene's numbers."""
        with torch.no_grad():
            return places_of(self.joined())


def serialize(
    width: int, height: int, shapes: Sequence[Shape], groups: Sequence[ShapeGroup], device: torch.device
) -> SceneArguments:
    """Return the structure and the tensors of a scene, these on ``device``.

    A ``UsageError`` names a shape or group that cannot be rendered.
    """
    tensors = _Tensors(device)
    ids = [_ids(group, f"group {number}", len(shapes)) for number, group in enumerate(groups)]
    stroked = {
        i for group, own in zip(groups, ids, strict=True) if group.stroke_color is not None for i in own
    }
    forms = [_shape(shape, f"shape {number}", tensors) for number, shape in enumerate(shapes)]
    forms = [
        _with_width(form, shape, f"stroke_width of shape {number}", number in stroked, tensors)
        for number, (form, shape) in enumerate(zip(forms, shapes, strict=True))
    ]
    fills = [_paint(group.fill_color, f"fill_color of group {i}", tensors) for i, group in enumerate(groups)]
    strokes = [
        _paint(group.stroke_color, f"stroke_color of group {i}", tensors) for i, group in enumerate(groups)
    ]
    widths = [id(shape.stroke_width) for shape in shapes]
    structures = [
        GroupStructure(
            shapes=tuple(forms[i] for i in own),
            fill=fill,
            stroke=stroke,
            even_odd=bool(group.use_even_odd_rule),
            one_width=len({widths[i] for i in own}) <= 1,
            line=getattr(group, "line", None),
            **_transform(group, f"shape_to_canvas of group {number}", tensors),
        )
        for number, (group, own, fill, stroke) in enumerate(zip(groups, ids, fills, strokes, strict=True))
    ]
    return SceneArguments(int(width), int(height), Structure(tuple(structures)), tuple(tensors.found))


def _ids(group: ShapeGroup, name: str, count: int) -> list[int]:
    """Return the indices of a group's shapes, of which there are ``count``."""
    found = _list(group.shape_ids)
    for i in found:
        if not 0 <= i < count:
            raise UsageError(f"{name} names shape {i}, there are {count}")
    return found


class _Tensors:
    """Collects the tensors of a scene."""

    def __init__(self, device: torch.device) -> None:
        self.found: list[Tensor] = []
        self._device = device
        self._next = FIRST

    def check(self, value: Tensor, shape: tuple[int, ...], name: str) -> Tensor:
        """Return a tensor as float32 on the device, if of this ``shape``; -1 stands for any length."""
        if not isinstance(value, Tensor):
            raise UsageError(f"{name} is a {type(value).__name__}, not a tensor")
        fits = map(lambda n, wanted: wanted in (-1, n), value.shape, shape)
        if len(value.shape) != len(shape) or not all(fits):
            wanted = ", ".join("n" if n < 0 else str(n) for n in shape)
            raise UsageError(f"{name} has shape {tuple(value.shape)}, not ({wanted})")
        return value.to(self._device, torch.float32)

    def add(self, value: Tensor, shape: tuple[int, ...], name: str) -> int:
        """Collect a tensor, see ``check``; return the index of its first number."""
        self.found.append(self.check(value, shape, name))
        at, self._next = self._next, self._next + value.numel()
        return at


def _widths_shape(value: Tensor, points: int) -> tuple[int, ...]:
    """Return the shape of a tensor with a number for each point, and maybe more."""
    return (-1,) if value.dim() == 1 and len(value) > points else (points,)


def _number_shape(value: object) -> tuple[int, ...]:
    """Return the shape of a tensor that holds one number, in any shape."""
    return tuple(value.shape) if isinstance(value, Tensor) and value.numel() == 1 else ()


def _list(values: Tensor | Sequence[int]) -> list[int]:
    """Return whole numbers, which programs give as a tensor, an array or a list."""
    return [int(i) for i in (values.tolist() if hasattr(values, "tolist") else values)]


def _shape(shape: Shape, name: str, tensors: _Tensors) -> ShapeStructure:
    if isinstance(shape, (Path, Polygon)):
        first = tensors.add(shape.points, (-1, 2), f"points of {name}")
        kind, counts, closed = "path", _counts(shape, len(shape.points), name), bool(shape.is_closed)
    elif isinstance(shape, Rect):
        kind, counts, closed = "rect", (0, 0, 0, 0), True
        first = tensors.add(shape.p_min, (2,), f"corner of {name}")
        tensors.add(shape.p_max, (2,), f"corner of {name}")
    elif isinstance(shape, (Circle, Ellipse)):
        kind, counts, closed = "ellipse", (2, 2, 2, 2), True
        first = tensors.add(shape.center, (2,), f"center of {name}")
        if isinstance(shape, Circle):
            kind = "circle"
            tensors.add(shape.radius, _number_shape(shape.radius), f"radius of {name}")
        else:
            tensors.add(shape.radius, (2,), f"radius of {name}")
    else:
        raise UsageError(f"{name} is a {type(shape).__name__}, no shape of pydiffvg")
    points = sum(counts) + len(counts) + (not closed)
    return ShapeStructure(kind, counts, closed, points, False, first, ZERO)


def _with_width(
    form: ShapeStructure, shape: Shape, name: str, is_stroked: bool, tensors: _Tensors
) -> ShapeStructure:
    """Return the structure of a shape with its width; without that where nothing depends on it."""
    width = shape.stroke_width
    tapers = isinstance(width, Tensor) and width.numel() != 1
    wanted = _widths_shape(width, form.points) if tapers else _number_shape(width)
    if not is_stroked and not tensors.check(width, wanted, name).requires_grad:
        return form
    return form._replace(tapers=tapers, width=tensors.add(width, wanted, name))


def _counts(shape: Path | Polygon, points: int, name: str) -> tuple[int, ...]:
    """Return the number of control points of each segment, if they fit the number of points."""
    is_open = not shape.is_closed
    if isinstance(shape, Polygon):
        counts = (0,) * (points - is_open)
    else:
        counts = tuple(_list(shape.num_control_points))
    wanted = sum(counts) + len(counts) + is_open
    if not counts or not {0, 1, 2}.issuperset(counts) or wanted > points:
        raise UsageError(
            f"{name} has {points} points, its num_control_points {list(counts)} ask for {wanted}"
        )
    return counts


def _transform(group: ShapeGroup, name: str, tensors: _Tensors) -> dict[str, Any]:
    """Return what a group's structure says about its transform."""
    matrix = tensors.check(group.shape_to_canvas, (3, 3), name)
    if not matrix.requires_grad and matrix.tolist() == IDENTITY:
        return {"transform": None, "uniform": True}
    scales = np.linalg.svd(matrix[:2, :2].detach().cpu().numpy(), compute_uv=False)
    # Relative difference of a transform's two scales up to which a stroke keeps one width.
    uniform_tolerance = 1e-3
    uniform = bool(scales[1] >= (1 - uniform_tolerance) * scales[0])
    return {"transform": tensors.add(matrix, (3, 3), name), "uniform": uniform}


def _paint(color: Color, name: str, tensors: _Tensors) -> PaintStructure | None:
    if color is None:
        return None
    if isinstance(color, Tensor):
        return PaintStructure(Paint.FLAT, 0, tensors.add(color, (4, 1) if color.dim() == 2 else (4,), name))
    if isinstance(color, LinearGradient):
        kind, points = Paint.LINEAR, {"begin": color.begin, "end": color.end}
    elif isinstance(color, RadialGradient):
        kind, points = Paint.RADIAL, {"center": color.center, "radius": color.radius}
    else:
        raise UsageError(f"{name} is a {type(color).__name__}, neither a tensor nor a gradient")
    first, _ = (tensors.add(point, (2,), f"{what} of {name}") for what, point in points.items())
    tensors.add(color.offsets, (-1,), f"offsets of {name}")
    tensors.add(color.stop_colors, (len(color.offsets), 4), f"stop_colors of {name}")
    return PaintStructure(kind, len(color.offsets), first)
