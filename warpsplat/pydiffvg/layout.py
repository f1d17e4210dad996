"""The structure of a scene as our renderer has it, made once for all scenes of one structure."""

from __future__ import annotations

import functools
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import torch

from warpsplat.pydiffvg.arguments import Form, Plan
from warpsplat.pydiffvg.tapered import ring_points
from warpsplat.scene import NO_DASHES, Basis, Canvas, Cap, Join, Kind, Paint, Rule, Scene
from warpsplat.scene.scene import IntArray, starts_of

Tensor = torch.Tensor
FloatArray = npt.NDArray[np.float32]


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


@dataclass(frozen=True)
class Layout:
    """How tensors of shapes and groups become those of a scene."""

    scene: Scene
    outlines: Scene
    """The same outlines, each in one colour."""
    rows: tuple[Row, ...]
    index: Tensor
    """Of the two points that each outline's control point is a mean of, shape (2, point)."""
    weight: Tensor | None
    """Theirs, shape (2, point, 1); None: each point is the first."""
    rings: tuple[tuple[Tensor, Tensor, bool], ...]
    """Strokes that are drawn as areas, of equally many segments, all closed or all open: index and weight of
    the control points of the segments as means of two points, shape (ring, segment, 4, 2); whether closed."""
    order: Tensor | None
    """Where each point of the scene is among those of outlines and then of rings; None: the same order."""
    point_group: Tensor
    """Shape (point,)."""


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
    forms: tuple[Form, ...],
    plans: tuple[Plan, ...],
    size: tuple[int, int],
    uniform: bool,
    device: torch.device,
) -> Layout:
    """The layout of scenes of this structure.

    Args:
        forms: of the shapes.
        plans: of the groups.
        size: of the picture [px], which are the scene's units.
        uniform: whether canvas units are as large along x as along y.
        device: of its tensors.
    """
    rows = _rows(forms, plans, uniform)
    first = starts_of(np.array([form.points for form in forms], np.int32))
    outlines: list[list[Blend]] = []
    batches: dict[tuple[int, bool], list[int]] = {}
    for number, row in enumerate(rows):
        if row.is_ring:
            form = forms[row.shapes[0]]
            batches.setdefault((len(form.counts), form.closed), []).append(number)
            outlines.append([])
            continue
        blends = [(_contour(forms[i], not row.is_stroke or forms[i].closed), first[i]) for i in row.shapes]
        outlines.append([Blend(blend.which + start, blend.weight) for blend, start in blends])
    counts = [[len(blend.which) for blend in contours] for contours in outlines]
    closed = [[not row.is_stroke or forms[i].closed for i in row.shapes] for row in rows]
    rings, places = [], {}
    at = sum(map(sum, counts))
    for (_, is_closed), numbers in batches.items():
        blends = [(segments_of(forms[rows[n].shapes[0]], False), first[rows[n].shapes[0]]) for n in numbers]
        index = np.stack([blend.which + start for blend, start in blends])
        weight = np.stack([blend.weight for blend, _ in blends])
        rings.append((_on(index, device), _on(weight, device), is_closed))
        sizes = [len(part) for part in ring_points(torch.zeros(1, *index.shape[1:3], 2), None, is_closed)]
        for number in numbers:
            counts[number], closed[number] = sizes, [True] * len(sizes)
            places[number] = at
            at += sum(sizes)
    flat = [blend for contours in outlines for blend in contours]
    index = np.concatenate([blend.which for blend in flat] + [np.zeros((0, 2), np.int64)])
    weight = np.concatenate([blend.weight for blend in flat] + [np.zeros((0, 2), np.float32)])
    scene = _scene(rows, plans, counts, closed, size)
    return Layout(
        scene,
        _in_one_color(scene),
        tuple(rows),
        _on(np.ascontiguousarray(index.T), device),
        _on(np.ascontiguousarray(weight.T)[:, :, None], device) if (weight[:, 1] != 0).any() else None,
        tuple(rings),
        _order(counts, places, device) if rings else None,
        _on(np.repeat([row.group for row in rows], [sum(each) for each in counts]), device),
    )


def _on(array: np.ndarray, device: torch.device) -> Tensor:
    return torch.from_numpy(array if array.dtype != np.intp else array.astype(np.int64)).to(device)


def _order(counts: list[list[int]], places: dict[int, int], device: torch.device) -> Tensor:
    at, parts = 0, []
    for number, each in enumerate(counts):
        if number in places:
            parts.append(places[number] + np.arange(sum(each)))
        else:
            parts.append(at + np.arange(sum(each)))
            at += sum(each)
    return _on(np.concatenate(parts).astype(np.int64), device)


PAINTS = {"flat": Paint.FLAT, "linear": Paint.LINEAR, "radial": Paint.RADIAL}


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
        paint=traits([PAINTS[row.paint[0]] for row in rows]),
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
