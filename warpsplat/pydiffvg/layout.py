"""The structure of a scene as our renderer has it, made once for all scenes of one structure."""

from __future__ import annotations

import functools
import itertools
import math
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import torch

from warpsplat.pydiffvg.arguments import Form, Plan, Structure
from warpsplat.pydiffvg.flat import BLACK, ZERO, PaintPlace, Places, Sum, on, places_of
from warpsplat.pydiffvg.tapered import ring_points
from warpsplat.rendering.backend import Viewport
from warpsplat.rendering.models import EXACT
from warpsplat.scene import NO_DASHES, Basis, Canvas, Cap, Join, Kind, Paint, Rule, Scene
from warpsplat.scene.scene import IntArray, starts_of
from warpsplat.torch.engine import Picture
from warpsplat.torch.tensors import attributes_of

Tensor = torch.Tensor
FloatArray = npt.NDArray[np.float32]

KAPPA = 4 / 3 * math.tan(math.pi / 8)
QUARTER = np.array([[1.0, 0.0], [1.0, KAPPA], [KAPPA, 1.0]])
"""Control points of a quarter of the unit circle, as cubics; off by 3e-4 at most."""
TURN = np.array([[0.0, 1.0], [-1.0, 0.0]])
CIRCLE = np.concatenate([QUARTER @ np.linalg.matrix_power(TURN, n) for n in range(4)])
"""Control points of the unit circle, clockwise as it is seen; shape (12, 2)."""
SQUARE = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
"""Corners of the unit square, clockwise as it is seen."""


class Blend(NamedTuple):
    """Points as means of two others each."""

    which: npt.NDArray[np.int64]
    """Shape (..., 2)."""
    weight: FloatArray
    """Shape (..., 2)."""


class Row(NamedTuple):
    """A shape of our scene."""

    group: int
    is_stroke: bool
    """Which of the group's paints it has."""
    shapes: tuple[int, ...]
    """Its contours."""
    is_ring: bool
    """Whether it is a stroke that is drawn as the area that it covers."""
    paint: tuple[str, int]


class Ring(NamedTuple):
    """Strokes that are drawn as areas, of equally many segments."""

    segments: Sum
    """Control points, shape (stroke, segment, 4, 2)."""
    radii: Sum
    """Theirs, shape (stroke, segment, 4)."""
    is_closed: bool
    """Whether the strokes are; or all open."""


class Maps(NamedTuple):
    """The groups' maps."""

    entries: Tensor
    """Shape (9 x group,)."""
    point_group: Tensor
    """Shape (point,)."""
    row_group: Tensor
    """Shape (row,)."""


class Gradients(NamedTuple):
    """The gradients among the paints."""

    linear: Tensor
    """Beginnings and ends, shape (4 x linear,)."""
    radial: Tensor
    """Centres and radii, shape (4 x radial,)."""
    order: Tensor
    """Of each row among a frame of zeros, those of linear ones and those of radial ones, shape (row,)."""
    offsets: Tensor
    """Shape (stop,)."""
    colors: Tensor
    """Shape (4 x stop,)."""


@dataclass(frozen=True)
class Layout:
    """How the numbers of shapes and groups (``flat``) become attributes of a scene."""

    scene: Scene
    outlines: Scene
    """The same outlines, each in one colour."""
    fixed: dict[str, Tensor]
    """Attributes that stay as they are."""
    points: Sum
    """Control points of outlines in the shapes' units, shape (point, 2)."""
    rings: tuple[Ring, ...]
    order: Tensor | None
    """Where each point of the scene is among those of outlines and then of rings; None: the same order."""
    maps: Maps | None
    """None: no map changes anything."""
    paints: Tensor
    """Colours and opacities, black and 1 of gradients; shape (4 x row,)."""
    widths: Tensor | None
    """Shape (row,); None: there are no strokes of one width."""
    gradients: Gradients | None

    pictures: dict[int, Picture] = field(default_factory=dict, compare=False)
    """By the number of threads."""

    def picture(self, threads: int) -> Picture:
        """What draws it."""
        found = self.pictures.get(threads)
        if found is None:
            canvas, device = self.scene.canvas, self.paints.device
            viewport = Viewport(canvas.width, canvas.height)
            found = Picture(self.scene, viewport, EXACT, device, threads, opaque=True, straight=True)
            self.pictures[threads] = found
        return found


@functools.lru_cache(maxsize=1024)
def segments_of(form: Form, close: bool) -> Blend:
    """Control points of a shape's segments as cubics, among its points; with ``close`` one that closes it.

    Shape (segment, 4, 2).
    """
    index, weight = [], []
    at, count = 0, form.points
    thirds = ((2 / 3, 1 / 3), (1 / 3, 2 / 3))
    for controls in form.counts + (0,) * close:
        end = (at + controls + 1) % count
        if controls == 0:
            inner = [((at, end), thirds[0]), ((at, end), thirds[1])]
        elif controls == 1:
            inner = [((at, at + 1), thirds[1]), ((at + 1, end), thirds[0])]
        else:
            inner = [((at + 1, at + 1), (1.0, 0.0)), ((at + 2, at + 2), (1.0, 0.0))]
        both = [((at, at), (1.0, 0.0)), *inner, ((end, end), (1.0, 0.0))]
        index.append([pair for pair, _ in both])
        weight.append([pair for _, pair in both])
        at = end
    return Blend(np.array(index), np.array(weight, np.float32))


def _contour(form: Form, is_closed: bool) -> Blend:
    """Control points of a contour: a ring, or a chain. Shape (point, 2)."""
    which, weight = segments_of(form, is_closed and not form.closed)
    if is_closed:
        return Blend(which[:, :3].reshape(-1, 2), weight[:, :3].reshape(-1, 2))
    return Blend(
        np.concatenate([which[:, :3].reshape(-1, 2), which[-1, 3:]]),
        np.concatenate([weight[:, :3].reshape(-1, 2), weight[-1, 3:]]),
    )


def _rows(forms: tuple[Form, ...], plans: tuple[Plan, ...], uniform: bool) -> list[Row]:
    rows = []
    for number, plan in enumerate(plans):
        if plan.fill and plan.shapes:
            rows.append(Row(number, False, plan.shapes, False, plan.fill))
        if not plan.stroke:
            continue
        of_one_width = [i for i in plan.shapes if uniform and plan.uniform and not forms[i].tapers]
        together = [tuple(of_one_width)] if plan.one_width else [(i,) for i in of_one_width]
        rows += [Row(number, True, shapes, False, plan.stroke) for shapes in together if shapes]
        rows += [Row(number, True, (i,), True, plan.stroke) for i in plan.shapes if i not in of_one_width]
    return rows


def make_layout(
    structure: Structure,
    size: tuple[int, int],
    uniform: bool,
    device: torch.device,
) -> Layout:
    """The layout of scenes of this structure.

    Args:
        structure: of shapes and groups.
        size: of the picture [px], which are the scene's units.
        uniform: whether canvas units are as large along x as along y.
        device: of its tensors.
    """
    forms, plans = structure.forms, structure.plans
    places = places_of(structure)
    rows = _rows(forms, plans, uniform)
    outlines: list[list[Terms]] = []
    batches: dict[tuple[int, bool], list[int]] = {}
    for number, row in enumerate(rows):
        outlines.append([])
        if row.is_ring:
            form = forms[row.shapes[0]]
            batches.setdefault((len(form.counts), form.closed), []).append(number)
            continue
        for i in row.shapes:
            blend = _contour(forms[i], not row.is_stroke or forms[i].closed)
            outlines[-1].append(_coordinates(forms[i], places.outlines[i], blend))
    counts = [[len(terms.which) for terms in contours] for contours in outlines]
    closed = [[not row.is_stroke or forms[i].closed for i in row.shapes] for row in rows]
    rings, order = _rings(structure, places, rows, batches, counts, closed, device)
    scene = _scene(rows, plans, counts, closed, size)
    widths = [places.widths[row.shapes[0]] if row.is_stroke and not row.is_ring else ZERO for row in rows]
    groups = np.array([row.group for row in rows], np.int64)
    point_group = np.repeat(groups, [sum(each) for each in counts])
    paints = [places.strokes[row.group] if row.is_stroke else places.fills[row.group] for row in rows]
    flat = [terms for contours in outlines for terms in contours]
    return Layout(
        scene,
        _in_one_color(scene),
        {a.name: on(getattr(scene, a.name), device) for a in attributes_of(scene)},
        Sum(
            np.concatenate([terms.which for terms in flat] + [np.zeros((0, 2, 4), np.int64)]),
            np.concatenate([terms.weight for terms in flat] + [np.zeros((0, 2, 4), np.float32)]),
            device,
        ),
        rings,
        order,
        Maps(
            on(np.array(places.maps, np.int64).reshape(-1), device),
            on(point_group, device),
            on(groups, device),
        )
        if any(plan.is_mapped for plan in plans)
        else None,
        on(
            np.array(
                [
                    range(paint.first, paint.first + 4) if row.paint[0] == "flat" else BLACK
                    for row, paint in zip(rows, paints, strict=True)
                    if paint
                ],
                np.int64,
            ).reshape(-1),
            device,
        ),
        on(np.array(widths, np.int64), device) if any(widths) else None,
        _gradients(rows, paints, device) if any(row.paint[0] != "flat" for row in rows) else None,
    )


class Terms(NamedTuple):
    """Coordinates of points as sums of numbers of a scene."""

    which: npt.NDArray[np.int64]
    """Shape (..., 2, 4)."""
    weight: FloatArray
    """Shape (..., 2, 4)."""


def _coordinates(form: Form, first: int, blend: Blend) -> Terms:
    """Points that are means of two points of a shape each, whose numbers begin at ``first``."""
    axis = np.arange(2)
    if form.kind == "path":
        index = first + np.arange(2 * form.points).reshape(-1, 2, 1) + np.array([0, 0])
        weight = np.broadcast_to(np.array([1.0, 0.0]), index.shape)
    else:
        unit = SQUARE if form.kind == "rect" else CIRCLE
        behind = np.zeros(2, np.int64) if form.kind == "circle" else axis
        index = np.broadcast_to(np.stack([first + axis, first + 2 + behind], axis=-1), (len(unit), 2, 2))
        # From a corner to the other, or a radius about the centre.
        weight = np.stack([1 - unit if form.kind == "rect" else np.ones_like(unit), unit], axis=-1)
    # [point, which of the two, coordinate, term] -> [point, coordinate, all terms]
    which, share = index[blend.which], weight[blend.which] * blend.weight[..., None, None]
    shape = (*blend.which.shape[:-1], 2, 4)
    return Terms(
        np.moveaxis(which, -3, -2).reshape(shape).astype(np.int64),
        np.moveaxis(share, -3, -2).reshape(shape).astype(np.float32),
    )


def _rings(
    structure: Structure,
    places: Places,
    rows: list[Row],
    batches: dict[tuple[int, bool], list[int]],
    counts: list[list[int]],
    closed: list[list[bool]],
    device: torch.device,
) -> tuple[tuple[Ring, ...], Tensor | None]:
    """Strokes that are drawn as areas, and the order of all points; adds their contours to ``counts`` and
    ``closed``.
    """
    rings, order = [], {}
    at = sum(map(sum, counts))
    for (_, is_closed), numbers in batches.items():
        shapes = [rows[n].shapes[0] for n in numbers]
        blends = [segments_of(structure.forms[i], False) for i in shapes]
        terms = [
            _coordinates(structure.forms[i], places.outlines[i], blend)
            for i, blend in zip(shapes, blends, strict=True)
        ]
        # A stroke of one width has it at each point.
        widths = [
            places.widths[i] + blend.which * structure.forms[i].tapers
            for i, blend in zip(shapes, blends, strict=True)
        ]
        segments = Sum(np.stack([t.which for t in terms]), np.stack([t.weight for t in terms]), device)
        radii = Sum(np.stack(widths), np.stack([blend.weight for blend in blends]), device)
        rings.append(Ring(segments, radii, is_closed))
        sizes = [
            len(part) for part in ring_points(torch.zeros(1, len(blends[0].which), 4, 2), None, is_closed)
        ]
        for number in numbers:
            counts[number], closed[number] = sizes, [True] * len(sizes)
            order[number] = at
            at += sum(sizes)
    return tuple(rings), _order(counts, order, device) if rings else None


def _gradients(rows: list[Row], paints: list[PaintPlace | None], device: torch.device) -> Gradients:
    found: dict[str, list[int]] = {"linear": [], "radial": []}
    offsets, colors = [], []
    for row, paint in zip(rows, paints, strict=True):
        kind, stops = row.paint
        if kind != "flat" and paint is not None:
            found[kind].append(paint.first)
            offsets.append(paint.offsets + np.arange(stops))
            colors.append(paint.colors + np.arange(4 * stops))
    next_of = {"flat": itertools.repeat(0), "linear": itertools.count(1)}
    next_of["radial"] = itertools.count(1 + len(found["linear"]))

    def numbers(parts: list[np.ndarray]) -> Tensor:
        return on(np.concatenate(parts), device)

    corners = np.arange(4)
    linear, radial = (
        np.add.outer(np.array(first, np.int64), corners).reshape(-1) for first in found.values()
    )
    return Gradients(
        on(linear, device),
        on(radial, device),
        on(np.array([next(next_of[row.paint[0]]) for row in rows], np.int64), device),
        numbers(offsets),
        numbers(colors),
    )


def _order(counts: list[list[int]], places: dict[int, int], device: torch.device) -> Tensor:
    at, parts = 0, []
    for number, each in enumerate(counts):
        if number in places:
            parts.append(places[number] + np.arange(sum(each)))
        else:
            parts.append(at + np.arange(sum(each)))
            at += sum(each)
    return on(np.concatenate(parts).astype(np.int64), device)


KINDS = {"flat": Paint.FLAT, "linear": Paint.LINEAR, "radial": Paint.RADIAL}


def _scene(
    rows: list[Row],
    plans: tuple[Plan, ...],
    counts: list[list[int]],
    closed: list[list[bool]],
    size: tuple[int, int],
) -> Scene:
    """The structure; of what has tensors the values are any."""
    lines = [plans[row.group].line if row.is_stroke and not row.is_ring else None for row in rows]
    dashes = tuple(sorted({line.dashes for line in lines if line} - {()}))
    stops = np.array([row.paint[1] for row in rows], np.int32)

    def traits(values: list[int]) -> IntArray:
        return np.array(values, np.int32)

    scene = Scene.of(
        Canvas(*size, None),
        traits([Kind.STROKE if row.is_stroke and not row.is_ring else Kind.FILL for row in rows]),
        starts_of(np.array([sum(each) for each in counts], np.int32)),
        basis=np.full(len(rows), Basis.CUBIC, np.int32),
        starts=starts_of(np.array([n for each in counts for n in each], np.int32)),
        closed=np.array([c for each in closed for c in each], np.int32),
        points=np.zeros((sum(map(sum, counts)), 2), np.float32),
        rule=traits(
            [Rule.EVENODD if plans[r.group].even_odd and not r.is_stroke else Rule.NONZERO for r in rows]
        ),
        cap=traits([line.cap if line else Cap.ROUND for line in lines]),
        join=traits([line.join if line else Join.ROUND for line in lines]),
        miter_limits=np.array([line.miter_limit if line else 4.0 for line in lines], np.float32),
        dash=traits([dashes.index(line.dashes) if line and line.dashes else NO_DASHES for line in lines]),
        dashes=dashes,
        paint=traits([KINDS[row.paint[0]] for row in rows]),
        stop_first=starts_of(stops),
    )
    # A gradient whose axes are unlike: both of them get gradients of their own.
    return replace(scene, frames=np.tile(np.array([0, 0, 1, 0, 0, 2], np.float32), (len(rows), 1)))


def _in_one_color(scene: Scene) -> Scene:
    return replace(
        scene,
        paint=np.zeros(len(scene), np.int32),
        layer=np.ones(len(scene), np.int32),  # so that it has arrays of its own on the device
        stop_first=np.zeros(len(scene) + 1, np.int32),
        stop_offsets=np.zeros(0, np.float32),
        stop_colors=np.zeros((0, 3), np.float32),
        stop_opacities=np.zeros(0, np.float32),
    )
