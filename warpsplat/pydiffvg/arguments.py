"""The scene that ``serialize_scene`` hands to ``apply``: its structure, hashable, and its tensors."""

from __future__ import annotations

import functools
import operator
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import chain
from typing import Any, NamedTuple

import numpy as np
import torch
from torch._utils import _flatten_dense_tensors

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

UNIFORM_TOLERANCE = 1e-3
"""Relative difference of a transform's two scales up to which a stroke keeps one width."""


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
    """For each shape its coordinates and width, then for each group its fill, stroke and transform."""

    @functools.cached_property
    def places(self) -> tuple[Place, ...]:
        """Where the tensors' values lie among the scene's numbers."""
        return places_of(self.tensors)


def serialize(
    width: int, height: int, shapes: Sequence[Shape], groups: Sequence[ShapeGroup], device: torch.device
) -> SceneArguments:
    """Return the structure and the tensors of a scene, these on ``device``.

    A ``UsageError`` names a shape or group that cannot be rendered.
    """
    tensors = _Tensors(device)
    forms = [_shape(shape, f"shape {number}", tensors) for number, shape in enumerate(shapes)]
    widths = [id(shape.stroke_width) for shape in shapes]
    structures = []
    for number, group in enumerate(groups):
        name, ids = f"group {number}", _list(group.shape_ids)
        for i in ids:
            if not 0 <= i < len(shapes):
                raise UsageError(f"{name} names shape {i}, there are {len(shapes)}")
        one_width = len({widths[i] for i in ids}) <= 1
        structures.append(_group(group, name, tuple(forms[i] for i in ids), one_width, tensors))
    return SceneArguments(int(width), int(height), Structure(tuple(structures)), tuple(tensors.found))


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

    def add_widths(self, value: Tensor, points: int, name: str) -> int:
        """Collect a tensor with a number for each point, and maybe more."""
        surplus = isinstance(value, Tensor) and value.dim() == 1 and len(value) > points
        return self.add(value, (-1,) if surplus else (points,), name)

    def add_number(self, value: Tensor, name: str) -> int:
        """Collect a tensor that holds one number, in any shape."""
        is_number = isinstance(value, Tensor) and value.numel() == 1
        return self.add(value, tuple(value.shape) if is_number else (), name)


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
            tensors.add_number(shape.radius, f"radius of {name}")
        else:
            tensors.add(shape.radius, (2,), f"radius of {name}")
    else:
        raise UsageError(f"{name} is a {type(shape).__name__}, no shape of pydiffvg")
    points = sum(counts) + len(counts) + (not closed)
    width, name = shape.stroke_width, f"stroke_width of {name}"
    tapers = isinstance(width, Tensor) and width.numel() != 1
    at = tensors.add_widths(width, points, name) if tapers else tensors.add_number(width, name)
    return ShapeStructure(kind, counts, closed, points, tapers, first, at)


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


def _group(
    group: ShapeGroup, name: str, shapes: tuple[ShapeStructure, ...], one_width: bool, tensors: _Tensors
) -> GroupStructure:
    fill = _paint(group.fill_color, f"fill_color of {name}", tensors)
    stroke = _paint(group.stroke_color, f"stroke_color of {name}", tensors)
    transform, uniform = None, True
    matrix = tensors.check(group.shape_to_canvas, (3, 3), f"shape_to_canvas of {name}")
    if matrix.requires_grad or matrix.tolist() != IDENTITY:
        transform = tensors.add(matrix, (3, 3), name)
        scales = np.linalg.svd(matrix[:2, :2].detach().cpu().numpy(), compute_uv=False)
        uniform = bool(scales[1] >= (1 - UNIFORM_TOLERANCE) * scales[0])
    even_odd, line = bool(group.use_even_odd_rule), getattr(group, "line", None)
    return GroupStructure(shapes, fill, stroke, even_odd, transform, uniform, one_width, line)


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


# The last scene, used again while shapes and groups are the same with the same tensors.


def _objects(shapes: Sequence[Shape], groups: Sequence[ShapeGroup]) -> list[object]:
    """Return shapes, groups and gradients and their fields, which are compared by identity."""
    owners: list[object] = [*shapes, *groups]
    fields = list(chain.from_iterable(map(dict.values, map(vars, owners))))
    if not {LinearGradient, RadialGradient}.isdisjoint(map(type, fields)):
        gradients = [each for each in fields if isinstance(each, (LinearGradient, RadialGradient))]
        fields += chain.from_iterable(vars(each).values() for each in gradients)
    return owners + fields


def _numbers(shapes: Sequence[Shape], groups: Sequence[ShapeGroup]) -> list[Tensor | list[object]]:
    """Return the numbers that belong to the structure, those of each field together.

    They are compared by value, as code can write into tensors without leaving a trace.
    """
    matrices = [group.shape_to_canvas for group in groups]
    return [
        _joined([shape.num_control_points for shape in shapes if isinstance(shape, Path)]),
        _joined([group.shape_ids for group in groups]),
        _joined(matrices),
        [matrix.requires_grad for matrix in matrices],
    ]


@torch.no_grad()
def _joined(values: Sequence[Any]) -> Tensor | list[object]:
    """Return all numbers of tensors or lists: a few operations for many tensors on the CPU."""
    if values and all(isinstance(each, Tensor) and each.is_cpu for each in values):
        return _flatten_dense_tensors(values)
    return [each.tolist() if hasattr(each, "tolist") else list(each) for each in values]


def _equal(a: Tensor | list[object], b: Tensor | list[object]) -> bool:
    return torch.equal(a, b) if isinstance(a, Tensor) and isinstance(b, Tensor) else bool(a == b)


class _Cached(NamedTuple):
    """A scene and what it was made of."""

    frame: tuple[object, ...]
    """Size, device and number of shapes."""
    objects: list[object]
    tensors: list[Tensor]
    """Those of the objects."""
    sizes: list[int]
    """How many numbers each has."""
    numbers: list[Tensor | list[object]]
    scene: SceneArguments


_last: _Cached | None = None


def serialize_cached(
    width: int, height: int, shapes: Sequence[Shape], groups: Sequence[ShapeGroup], device: torch.device
) -> SceneArguments:
    """Return ``serialize`` of the arguments, or the last result where only values in tensors have changed."""
    global _last  # noqa: PLW0603 - one scene is kept, with its tensors, until the next
    frame, objects = (int(width), int(height), device, len(shapes)), _objects(shapes, groups)
    last = _last  # another thread may replace it meanwhile
    if (
        last
        and frame == last.frame
        and len(objects) == len(last.objects)
        and all(map(operator.is_, objects, last.objects))
        and list(map(Tensor.numel, last.tensors)) == last.sizes
        and all(map(_equal, _numbers(shapes, groups), last.numbers))
    ):
        return last.scene
    scene = serialize(width, height, shapes, groups, device)
    own = set(map(id, objects))
    # Copies and results of operations are made again for each scene.
    if all(id(tensor) in own and tensor.grad_fn is None for tensor in scene.tensors):
        tensors = [each for each in objects if isinstance(each, Tensor)]
        numbers = _numbers(shapes, groups)
        _last = _Cached(frame, objects, tensors, list(map(Tensor.numel, tensors)), numbers, scene)
    else:
        _last = None
    return scene
