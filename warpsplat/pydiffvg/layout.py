"""The scene that our renderer draws for a structure, made once, and where its attributes come from."""

from __future__ import annotations

import functools
import itertools
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import torch

from warpsplat.pydiffvg.arguments import ONE, ZERO, GroupStructure, PaintStructure, ShapeStructure, Structure
from warpsplat.pydiffvg.gather import Gather, Terms, combined, on, picked
from warpsplat.pydiffvg.tapered import contour_sizes, contours_around
from warpsplat.rendering.backend import Viewport
from warpsplat.rendering.models import EXACT
from warpsplat.scene import NO_DASHES, Canvas, Cap, Join, Kind, Paint, Rule, Scene
from warpsplat.scene.scene import IntArray, ranges, starts_of
from warpsplat.torch.engine import RenderSpec
from warpsplat.torch.tensors import attributes_of

Tensor = torch.Tensor

KEPT = 16
"""Layouts that are kept for further scenes of their structure."""

KAPPA = 4 / 3 * math.tan(math.pi / 8)
QUARTER = np.array([[1.0, 0.0], [1.0, KAPPA], [KAPPA, 1.0]])
"""Control points of a quarter of the unit circle as a cubic, without the last; off by 3e-4 at most."""
ROTATION = np.array([[0.0, 1.0], [-1.0, 0.0]])
CIRCLE = np.concatenate([QUARTER @ np.linalg.matrix_power(ROTATION, n) for n in range(4)])
"""Control points of the unit circle, clockwise on the screen; shape (12, 2)."""
SQUARE = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
"""Corners of the unit square, clockwise on the screen; shape (4, 2)."""

THIRDS = [[3, 0], [2, 1], [1, 2], [0, 3]]
ENDS = np.array([[[0, 1]] * 4, [[0, 1], [0, 1], [1, 2], [1, 2]], [[0, 1], [1, 2], [2, 3], [2, 3]]])
SHARES = np.array([THIRDS, [[3, 0], [1, 2], [2, 1], [0, 3]], [[3, 0]] * 3 + [[0, 3]]]) / 3
"""A line, a quadratic and a cubic as cubics: for each control point two points of the segment and their
weights, shape (3, 4, 2)."""

IDENTITY = (ONE, ZERO, ZERO, ZERO, ONE, ZERO, ZERO, ZERO, ONE)
BLACK = (ZERO, ZERO, ZERO, ONE)


class Row(NamedTuple):
    """A shape of our scene: a group's fill, or one or more of its strokes."""

    group: int
    shapes: tuple[ShapeStructure, ...]
    """Shapes whose outlines are its contours."""
    paint: PaintStructure
    kind: Kind
    is_area: bool = False
    """Whether it is a stroke that is filled as the area that it covers; it then has one shape."""

    def closed(self) -> list[bool]:
        """Return whether each contour is closed."""
        if self.is_area:
            return [True] * (1 + self.shapes[0].closed)
        return [self.kind == Kind.FILL or shape.closed for shape in self.shapes]

    def outlines(self) -> list[Terms]:
        """Return the control points of each contour, see ``coordinates``; none of an area."""
        each = [] if self.is_area else zip(self.shapes, self.closed(), strict=True)
        return [coordinates(shape, _contour(shape, is_closed)) for shape, is_closed in each]


class Area(NamedTuple):
    """Strokes that are drawn as areas, all with equally many segments."""

    segments: Gather
    """Control points [shape units], shape (stroke, segment, 4, 2)."""
    radii: Gather
    """Half widths [shape units], shape (stroke, segment, 4)."""
    is_closed: bool

    def points(self, numbers: Tensor) -> Tensor:
        """Return the control points of the outlines, stroke by stroke, shape (point, 2)."""
        return contours_around(self.segments(numbers), self.radii(numbers), self.is_closed).reshape(-1, 2)


class Transforms(NamedTuple):
    """Indices of the entries of the groups' transforms, shape (9 x group,); group of each point and row."""

    entries: Tensor
    point_group: Tensor
    row_group: Tensor


class GradientTensors(NamedTuple):
    """The gradients of the rows, as indices of their numbers."""

    points: Tensor
    """Start and end, or centre and radii; zeros for colours; shape (4 x row,)."""
    is_radial: Tensor
    """Shape (row, 1)."""
    offsets: Tensor
    colors: Tensor
    """Shape (4 x stop,)."""


@dataclass(frozen=True)
class Layout:
    """How the numbers of shapes and groups become the attributes of a scene of ours."""

    scene: Scene
    """Structure and canvas; its attributes are placeholders."""
    defaults: dict[str, Tensor]
    """Attributes by name, for those that come from no number."""
    gathers: tuple[Gather, ...]
    """Sums that are, in this order, control points of outlines [shape units], shape (point, 2); the rows'
    colours, black for gradients, (row, 3), and opacities, (row,); and, if any stroke has a single width, half
    widths, 0 for fills, (row,).
    """
    areas: tuple[Area, ...]
    order: Tensor | None
    """Index of each of the scene's points among those of outlines and then of areas; None: the same order."""
    transforms: Transforms | None
    """None: all are the identity."""
    gradients: GradientTensors | None
    spec: RenderSpec
    """Specification of the engine that renders the scene without premultiplying its colours."""

    @functools.cached_property
    def outlines(self) -> Scene:
        """The same outlines, each in one colour."""
        count = len(self.scene)
        return replace(
            self.scene,
            paint=np.zeros(count, np.int32),
            layer=np.ones(count, np.int32),  # differs from ``scene``, so that the two never share an engine
            stop_first=np.zeros(count + 1, np.int32),
            stop_offsets=np.zeros(0, np.float32),
            stop_colors=np.zeros((0, 3), np.float32),
            stop_opacities=np.zeros(0, np.float32),
        )


@functools.lru_cache(maxsize=KEPT)
def make_layout(
    structure: Structure, size: tuple[int, int], uniform: bool, device: torch.device, threads: int = 1
) -> Layout:
    """Return the layout of the scenes of a structure.

    ``size``: width and height of the image [px], which are the units of our scene; ``uniform``: whether
    canvas units are scaled alike along x and y.
    """
    rows = _rows(structure, uniform)
    outlines = [row.outlines() for row in rows]
    sizes = [
        contour_sizes(len(row.shapes[0].counts), row.shapes[0].closed)
        if row.is_area
        else [len(terms.indices) for terms in own]
        for row, own in zip(rows, outlines, strict=True)
    ]
    scene = _scene(rows, sizes, structure.groups, size)
    areas, order = _areas(rows, scene, device)
    paints = [
        range(p.first, p.first + 4) if p.kind == Paint.FLAT else BLACK for p in (row.paint for row in rows)
    ]
    colors = np.array(paints, np.int64).reshape(-1, 4)
    widths = [row.shapes[0].width if row.kind == Kind.STROKE else ZERO for row in rows]
    picks: list[npt.ArrayLike] = [colors[:, :3], colors[:, 3], *([widths] if any(widths) else [])]
    return Layout(
        scene,
        {a.name: on(getattr(scene, a.name), device) for a in attributes_of(scene)},
        (
            Gather(combined([NOTHING, *itertools.chain(*outlines)], np.concatenate), device),
            *(picked(each, device) for each in picks),
        ),
        areas,
        order,
        _transforms(rows, structure.groups, scene, device),
        _gradients(rows, device) if any(row.paint.kind != Paint.FLAT for row in rows) else None,
        RenderSpec(scene, Viewport(*size), EXACT, device, threads, opaque=True, straight=True),
    )


NOTHING = Terms(np.zeros((0, 2, 4), np.int64), np.zeros((0, 2, 4)))


def indices(parts: Sequence[Sequence[int] | npt.NDArray[np.integer]], device: torch.device) -> Tensor:
    """Return indices one after the other, shape (index,)."""
    return on(np.concatenate([np.zeros(0, np.int64), *parts]).astype(np.int64), device)


def _rows(structure: Structure, uniform: bool) -> list[Row]:
    rows = []
    for number, group in enumerate(structure.groups):
        if group.fill and group.shapes:
            rows.append(Row(number, group.shapes, group.fill, Kind.FILL))
        if not group.stroke:
            continue
        even = [s for s in group.shapes if uniform and group.uniform and not s.tapers]
        areas = [s for s in group.shapes if not (uniform and group.uniform) or s.tapers]
        together = [tuple(even)] if group.one_width else [(shape,) for shape in even]
        rows += [Row(number, shapes, group.stroke, Kind.STROKE) for shapes in together if shapes]
        rows += [Row(number, (shape,), group.stroke, Kind.FILL, is_area=True) for shape in areas]
    return rows


@functools.lru_cache(maxsize=1024)
def segments(counts: tuple[int, ...], points: int) -> Terms:
    """Return the control points of segments as cubics, as sums of a shape's points, shape (segment, 4, 2).

    ``counts``: see ``ShapeStructure``; a closed shape's last segment ends at the first of its ``points``.
    """
    kinds = np.array(counts)
    first = starts_of(kinds + 1)[:-1]
    return Terms((first[:, None, None] + ENDS[kinds]) % points, SHARES[kinds])


def _contour(shape: ShapeStructure, is_closed: bool) -> Terms:
    """Return the control points of a contour as sums of the shape's points, shape (point, 2)."""
    terms = segments(shape.counts + (0,) * (is_closed and not shape.closed), shape.points)
    kept = np.arange(4 * len(terms.indices)) % 4 < 3  # a segment's end is the next one's start
    kept[-1] = not is_closed
    return terms.map(lambda each: each.reshape(-1, 2)[kept])


def coordinates(shape: ShapeStructure, points: Terms) -> Terms:
    """Return the coordinates of points as sums of the scene's numbers, shape (..., coordinate, term).

    ``points``: the points as sums of the shape's, shape (..., term).
    """
    axis = np.arange(2)
    if shape.kind == "path":
        index = shape.first + np.arange(2 * shape.points).reshape(-1, 2, 1) + np.zeros(2, np.int64)
        weight = np.broadcast_to([1.0, 0.0], index.shape)
    else:  # from one corner to the other, or from the centre by a radius
        unit = SQUARE if shape.kind == "rect" else CIRCLE
        second = np.zeros(2, np.int64) if shape.kind == "circle" else axis
        index = np.tile(shape.first + np.stack([axis, 2 + second], axis=-1), (len(unit), 1, 1))
        weight = np.stack([1 - unit if shape.kind == "rect" else np.ones_like(unit), unit], axis=-1)
    both = Terms(index[points.indices], weight[points.indices] * points.weights[..., None, None])
    # [..., point's term, coordinate, number's term] -> [..., coordinate, term]
    return both.map(lambda each: np.moveaxis(each, -3, -2).reshape(*points.indices.shape[:-1], 2, 4))


def _areas(rows: list[Row], scene: Scene, device: torch.device) -> tuple[tuple[Area, ...], Tensor | None]:
    """Return the strokes that are drawn as areas, and ``Layout.order``."""
    batches: dict[tuple[int, bool], list[int]] = {}
    for number, row in enumerate(rows):
        if row.is_area:
            batches.setdefault((len(row.shapes[0].counts), row.shapes[0].closed), []).append(number)
    if not batches:
        return (), None
    areas = tuple(
        _area([rows[number].shapes[0] for number in numbers], is_closed, device)
        for (_, is_closed), numbers in batches.items()
    )
    placed = [number for number, row in enumerate(rows) if not row.is_area]
    for numbers in batches.values():
        placed += numbers
    order = np.argsort(ranges(scene.first[placed], scene.point_counts()[placed]))
    return areas, indices([order], device)


def _area(shapes: list[ShapeStructure], is_closed: bool, device: torch.device) -> Area:
    """Return strokes of equally many segments, all closed or all open."""
    pairs = [(shape, segments(shape.counts, shape.points)) for shape in shapes]
    points = [coordinates(shape, line) for shape, line in pairs]
    # A stroke of one width has it at each point.
    radii = [Terms(shape.width + line.indices * shape.tapers, line.weights) for shape, line in pairs]
    lines, widths = (Gather(combined(each, np.stack), device) for each in (points, radii))
    return Area(lines, widths, is_closed)


def _transforms(
    rows: list[Row], groups: tuple[GroupStructure, ...], scene: Scene, device: torch.device
) -> Transforms | None:
    if all(group.transform is None for group in groups):
        return None
    entries = [IDENTITY if g.transform is None else range(g.transform, g.transform + 9) for g in groups]
    row_group = np.array([row.group for row in rows], np.int64)
    point_group = np.repeat(row_group, scene.point_counts())
    return Transforms(indices(entries, device), on(point_group, device), on(row_group, device))


def _gradients(rows: list[Row], device: torch.device) -> GradientTensors:
    paints = [row.paint for row in rows]
    points = [4 * (ZERO,) if p.kind == Paint.FLAT else range(p.first, p.first + 4) for p in paints]
    offsets = [p.first + 4 + np.arange(p.stops) for p in paints]
    colors = [p.first + 4 + p.stops + np.arange(4 * p.stops) for p in paints]
    is_radial = np.array([[p.kind == Paint.RADIAL] for p in paints])
    each = [indices(parts, device) for parts in (points, offsets, colors)]
    return GradientTensors(each[0], on(is_radial, device), *each[1:])


def _scene(
    rows: list[Row], sizes: list[list[int]], groups: tuple[GroupStructure, ...], size: tuple[int, int]
) -> Scene:
    """Return our scene with placeholders for the attributes that come from tensors.

    ``sizes``: control points of each row's contours; ``size``: width and height of the image [px].
    """
    lines = [groups[row.group].line if row.kind == Kind.STROKE else None for row in rows]
    dashes = tuple(sorted({line.dashes for line in lines if line} - {()}))
    even_odd = [groups[row.group].even_odd and row.kind == Kind.FILL and not row.is_area for row in rows]

    def traits(values: Iterable[int]) -> IntArray:
        return np.array([*values], np.int32)

    return Scene(
        Canvas(*size, None),
        traits(row.kind for row in rows),
        starts_of(traits(map(sum, sizes))),
        starts=starts_of(traits(size for each in sizes for size in each)),
        closed=traits(closed for row in rows for closed in row.closed()),
        points=np.zeros((sum(map(sum, sizes)), 2), np.float32),
        rule=traits(Rule.EVENODD if each else Rule.NONZERO for each in even_odd),
        cap=traits(line.cap if line else Cap.ROUND for line in lines),
        join=traits(line.join if line else Join.ROUND for line in lines),
        miter_limits=np.array([line.miter_limit if line else 4.0 for line in lines], np.float32),
        dash=traits(dashes.index(line.dashes) if line and line.dashes else NO_DASHES for line in lines),
        dashes=dashes,
        paint=traits(row.paint.kind for row in rows),
        stop_first=starts_of(traits(row.paint.stops for row in rows)),
        # A gradient whose axes differ has gradients of its own for both of them.
        frames=np.tile(np.array([0, 0, 1, 0, 0, 2], np.float32), (len(rows), 1)),
    )
