"""What ``serialize_scene`` takes down: the tensors of shapes and groups, and what their structure is."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import torch

from warpsplat.errors import UsageError
from warpsplat.pydiffvg.color import Color, LinearGradient, RadialGradient
from warpsplat.pydiffvg.shape import Circle, Ellipse, Path, Polygon, Rect, Shape, ShapeGroup
from warpsplat.svg.shapes import LineStyle

Tensor = torch.Tensor

RING = (2, 2, 2, 2)
"""Segments of an ellipse."""
CORNERS = (0, 0, 0, 0)
"""Segments of a rectangle."""

IDENTITY = np.eye(3).tolist()

UNIFORM = 1e-3
"""By how much a map may stretch one direction more than another and strokes still be of one width."""


class Form(NamedTuple):
    """Structure of a shape."""

    kind: str
    """``path``, ``circle``, ``ellipse`` or ``rect``."""
    counts: tuple[int, ...]
    """Control points of each segment."""
    closed: bool
    points: int
    """Ends and control points."""
    tapers: bool
    """Whether the width of its stroke changes along it."""


class Plan(NamedTuple):
    """Structure of a group."""

    shapes: tuple[int, ...]
    fill: tuple[str, int] | None
    """Kind of paint, and stops of a gradient."""
    stroke: tuple[str, int] | None
    even_odd: bool
    uniform: bool
    """Whether its map has one scale in all directions."""
    one_width: bool
    """Whether all its shapes have one and the same tensor as width."""
    line: LineStyle | None
    is_mapped: bool
    """Whether its map changes anything."""


@dataclass(frozen=True)
class Structure:
    """What of a scene is no tensor."""

    forms: tuple[Form, ...]
    plans: tuple[Plan, ...]

    @functools.cached_property
    def _hash(self) -> int:
        return hash((self.forms, self.plans))

    def __hash__(self) -> int:
        """Computed once: a scene that stays asks for it every step."""
        return self._hash


@dataclass(frozen=True)
class SceneArguments:
    """A scene as it was when it was serialized; its tensors are those of the shapes, not copies."""

    width: int
    height: int
    structure: Structure
    tensors: tuple[Tensor, ...]
    """Of each shape the points of a path, centre and radius of an ellipse or corners of a rectangle, and the
    width; then of each group those of its fill, of its stroke, and its map: see ``flat.places_of``."""


def take_down(
    width: int, height: int, shapes: Sequence[Shape], groups: Sequence[ShapeGroup], device: torch.device
) -> SceneArguments:
    """Structure and tensors of a scene, on ``device``.

    Raises:
        UsageError: something of it cannot be rendered.
    """
    forms, plans, tensors = [], [], []
    for number, shape in enumerate(shapes):
        form, values = _shape(shape, f"shape {number}", device)
        forms.append(form)
        tensors += values
    widths = [id(shape.stroke_width) for shape in shapes]
    for number, group in enumerate(groups):
        plan, values = _group(group, f"group {number}", widths, device)
        plans.append(plan)
        tensors += values
    return SceneArguments(int(width), int(height), Structure(tuple(forms), tuple(plans)), tuple(tensors))


def _tensor(value: Tensor, shape: tuple[int, ...], name: str, device: torch.device) -> Tensor:
    """``value`` where it is rendered; -1 in ``shape`` stands for any number.

    Raises:
        UsageError: it is no tensor, or has another shape.
    """
    if not isinstance(value, Tensor):
        raise UsageError(f"{name} is a {type(value).__name__}, not a tensor")
    fits = value.dim() == len(shape) and all(w in {-1, n} for n, w in zip(value.shape, shape, strict=True))
    if not fits:
        wanted = ", ".join("n" if n < 0 else str(n) for n in shape)
        raise UsageError(f"{name} has shape {tuple(value.shape)}, not ({wanted})")
    if value.dtype == torch.float32 and value.device == device:
        return value
    return value.to(device, torch.float32)


def _shape(shape: Shape, name: str, device: torch.device) -> tuple[Form, list[Tensor]]:
    if isinstance(shape, (Path, Polygon)):
        points = _tensor(shape.points, (-1, 2), f"points of {name}", device)
        form = Form("path", _counts(shape, len(points), name), bool(shape.is_closed), len(points), False)
        values = [points]
    elif isinstance(shape, Rect):
        form = Form("rect", CORNERS, True, 4, False)
        values = [_tensor(p, (2,), f"corner of {name}", device) for p in (shape.p_min, shape.p_max)]
    elif isinstance(shape, (Circle, Ellipse)):
        kind = "circle" if isinstance(shape, Circle) else "ellipse"
        form = Form(kind, RING, True, 12, False)
        values = [
            _tensor(shape.center, (2,), f"center of {name}", device),
            _number(shape.radius, f"radius of {name}", device)
            if isinstance(shape, Circle)
            else _tensor(shape.radius, (2,), f"radius of {name}", device),
        ]
    else:
        raise UsageError(f"{name} is a {type(shape).__name__}, no shape of pydiffvg")
    width = shape.stroke_width
    if isinstance(width, Tensor) and width.numel() != 1:
        form = form._replace(tapers=True)
        return form, [*values, _tensor(width, (form.points,), f"stroke_width of {name}", device)]
    return form, [*values, _number(width, f"stroke_width of {name}", device)]


def _number(value: Tensor, name: str, device: torch.device) -> Tensor:
    """``value`` where it is rendered: one number, in whatever shape.

    Raises:
        UsageError: it is none.
    """
    if isinstance(value, Tensor) and value.numel() == 1:
        return _tensor(value, tuple(value.shape), name, device)
    return _tensor(value, (), name, device)


def _counts(shape: Path | Polygon, points: int, name: str) -> tuple[int, ...]:
    """Control points of each segment.

    Raises:
        UsageError: they are not as many as there are points for.
    """
    is_open = not shape.is_closed
    if isinstance(shape, Polygon):
        counts = (0,) * (points - is_open)
    else:
        counts = tuple(map(int, shape.num_control_points.tolist()))
    wanted = sum(counts) + len(counts) + is_open
    if not counts or not {0, 1, 2}.issuperset(counts) or wanted != points:
        raise UsageError(
            f"{name} has {points} points, its num_control_points {list(counts)} ask for {wanted}"
        )
    return counts


def _group(
    group: ShapeGroup, name: str, widths: Sequence[int], device: torch.device
) -> tuple[Plan, list[Tensor]]:
    """``widths``: which tensor is each shape's width."""
    ids = tuple(map(int, group.shape_ids.tolist()))
    for i in ids:
        if not 0 <= i < len(widths):
            raise UsageError(f"{name} names shape {i}, there are {len(widths)}")
    fill, fill_tensors = _paint(group.fill_color, f"fill_color of {name}", device)
    stroke, stroke_tensors = _paint(group.stroke_color, f"stroke_color of {name}", device)
    matrix = _matrix(group.shape_to_canvas, name, device)
    plan = Plan(
        ids,
        fill,
        stroke,
        bool(group.use_even_odd_rule),
        matrix is None or _is_uniform(matrix),
        len({widths[i] for i in ids}) <= 1,
        getattr(group, "line", None),
        matrix is not None,
    )
    return plan, [*fill_tensors, *stroke_tensors, *([] if matrix is None else [matrix])]


def _paint(color: Color, name: str, device: torch.device) -> tuple[tuple[str, int] | None, list[Tensor]]:
    """Kind of a paint and the number of its stops; its tensors.

    Raises:
        UsageError: it is none.
    """
    if color is None:
        return None, []
    if isinstance(color, Tensor):
        return ("flat", 0), [_tensor(color, (4,), name, device)]
    if not isinstance(color, (LinearGradient, RadialGradient)):
        raise UsageError(f"{name} is a {type(color).__name__}, neither a tensor nor a gradient")
    stops = len(color.offsets)
    offsets = _tensor(color.offsets, (-1,), f"offsets of {name}", device)
    colors = _tensor(color.stop_colors, (max(stops, 1), 4), f"stop_colors of {name}", device)
    if isinstance(color, LinearGradient):
        ends = [_tensor(p, (2,), f"end of {name}", device) for p in (color.begin, color.end)]
        return ("linear", stops), [*ends, offsets, colors]
    center = _tensor(color.center, (2,), f"center of {name}", device)
    radius = _tensor(color.radius, (2,), f"radius of {name}", device)
    return ("radial", stops), [center, radius, offsets, colors]


def _matrix(matrix: Tensor, name: str, device: torch.device) -> Tensor | None:
    found = _tensor(matrix, (3, 3), f"shape_to_canvas of {name}", device)
    if not found.requires_grad and found.tolist() == IDENTITY:
        return None
    return found


def _is_uniform(matrix: Tensor) -> bool:
    sizes = np.linalg.svd(matrix[:2, :2].detach().cpu().numpy(), compute_uv=False)
    return bool(sizes[1] >= (1 - UNIFORM) * sizes[0])
