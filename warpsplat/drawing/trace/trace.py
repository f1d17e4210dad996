"""A drawing -> a scene: regions, their outlines, their order."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from warpsplat.alpha import straight as straight_color
from warpsplat.drawing.trace.colors import with_best_colors
from warpsplat.drawing.trace.contours import Fill, assembled, joints_of, merged
from warpsplat.drawing.trace.curves import Pieces, fit_polylines
from warpsplat.drawing.trace.fewer import fewer_regions
from warpsplat.drawing.trace.grids import Bools, Ints, at_pixels, unchecked
from warpsplat.drawing.trace.hidden import HIDES_ALL, Cover
from warpsplat.drawing.trace.nesting import OPAQUE, find_nesting
from warpsplat.drawing.trace.order import (
    Tree,
    bare_ground,
    enclosed,
    find_ranks,
    find_tree,
    has_inside,
    in_holes_with,
)
from warpsplat.drawing.trace.outlines import Boundary, find_boundary
from warpsplat.drawing.trace.palette import Coloring
from warpsplat.drawing.trace.partition import Partition, find_partition
from warpsplat.drawing.trace.planar import Loops, find_loops
from warpsplat.drawing.trace.ramps import Gradients
from warpsplat.drawing.trace.regions import Regions, find_regions
from warpsplat.drawing.trace.spans import Polyline
from warpsplat.drawing.trace.stack import Layers, Outline, find_outlines
from warpsplat.scene import Basis, Canvas, FloatArray, Kind, Paint, Scene
from warpsplat.scene.attributes import GRADIENTS
from warpsplat.scene.scene import numbers_in, starts_of

LEAST_AREA = 64  # [px] of an image for each of its regions: a letter that can be read takes as much
FEW_REGIONS = 3000  # which any image may have


@dataclass(frozen=True)
class Traced:
    """A traced drawing."""

    scene: Scene
    joints: npt.NDArray[np.int32]
    """``Joint`` of each control point, shape (point,)."""


RUNS_TOGETHER = 250
"""Parts of outlines to which curves are fitted from one check to the next."""


def trace(
    image: FloatArray,
    *,
    most: int | None = None,
    price: float = 1.0,
    check: Callable[[], None] = unchecked,
    gradients: Gradients = GRADIENTS,
    noise: float | None = None,
    removal: str | None = None,
) -> Traced:
    """Trace a drawing.

    Args:
        image: sRGB in [0, 1], shape (height, width, 3); premultiplied with opacity, shape (height, width, 4).
        most: Paths at the most; the least visible regions are given up. None: no limit.
        price: Of a byte, over its usual one: the higher, the fewer regions are worth theirs.
        check: Called now and then; it may raise an exception to give up.
        gradients: Kinds of gradients that regions may have, where they are worth their bytes.
        noise: Of mixtures of colours [levels], in an image whose flat colours have none; None: measured.
        removal: Of the ground of an opaque image, as in the settings: nothing is drawn there, and the canvas,
            which has its colour, shows.
    """
    levels = np.asarray(image, np.float32) * 255
    is_opaque = levels.shape[2] == 3
    if is_opaque:
        levels = np.concatenate([levels, np.full_like(levels[..., :1], 255)], axis=2)
    height, width = levels.shape[:2]
    regions = find_regions(levels, price, check, gradients, noise)
    regions = fewer_regions(regions, max(FEW_REGIONS, height * width // LEAST_AREA), price)

    def outlined(regions: Regions) -> Traced:
        partition = with_best_colors(find_partition(regions, check), regions)
        return trace_partition(
            partition, may_have_ground=is_opaque, check=check, removal=removal if is_opaque else None
        )

    traced, target = outlined(regions), len(regions.paint)
    while most is not None and len(traced.scene) > most and target > 2:
        # Regions of one colour may be one path, so that there may be more of them than paths.
        target = max(2, min(target - 1, int(target * most / len(traced.scene))))
        regions = fewer_regions(regions, target)
        traced = outlined(regions)
    return traced


def trace_partition(
    partition: Partition,
    *,
    may_have_ground: bool = True,
    check: Callable[[], None] = unchecked,
    removal: str | None = None,
) -> Traced:
    """Trace the outlines of partition.

    Args:
        partition: Of an image.
        may_have_ground: Whether the canvas may have a colour, where all is opaque.
        check: As for ``trace``.
        removal: As for ``trace``.
    """
    check()
    nesting, count = find_nesting(partition), len(partition.paint)
    painted = partition.painted
    flat = replace(partition, labels=partition.labels.mapped(nesting.shown(0)))
    loops = find_loops(flat.labels, painted)
    boundary = find_boundary(loops, flat)
    tree = find_tree(loops, count)
    unpainted, ground = _ground(partition, tree, may_have_ground=may_have_ground)
    if removal:
        unpainted, ground = _removed(partition, removal)
    sizes = flat.labels.sizes(count)
    ranks = nesting.ordered(find_ranks(loops, tree, sizes, unpainted))
    is_clear = np.array([coloring.color[3] < OPAQUE for coloring in flat.colorings])[flat.paint]
    layers = _layers(flat, loops, boundary, tree, ranks, is_clear | unpainted if removal else is_clear)
    check()
    outlines = find_outlines(layers)
    for depth in range(1, int(nesting.depth.max()) + 1):
        check()
        layer = replace(partition, labels=partition.labels.mapped(nesting.shown(depth)))
        inner = find_loops(layer.labels, painted, nesting.depth == depth)
        # Bands hide nothing, so that the cover is the same at all depths.
        layers = replace(layers, loops=inner, boundary=find_boundary(inner, layer), has_holes=True)
        outlines += find_outlines(layers)
    contours: dict[int, list[Pieces]] = {}
    for region, contour in _fitted(outlines, partition, check):
        contours.setdefault(region, []).append(contour)
    shapes = [
        Fill(nesting.colorings[region], contours[region])
        for region in sorted(contours, key=lambda region: ranks[region])
    ]
    height, width = partition.doubt.shape
    background = None if ground is None else (ground.color[:3] / 255).astype(np.float32)
    return _scene(Canvas(width, height, background), merged(shapes))


def _fitted(
    outlines: list[tuple[int, Outline]], partition: Partition, check: Callable[[], None]
) -> list[tuple[int, Pieces]]:
    """Return the contour of each outline, in pixels; those of less than two curves are left out."""
    size = 1 / partition.scale
    scaled = [
        (region, [part.scaled(size) if isinstance(part, Polyline) else part * size for part in outline])
        for region, outline in outlines
    ]
    runs = [part for _, outline in scaled for part in outline if isinstance(part, Polyline)]
    tolerances = [TOLERANCE + float(at_pixels(partition.doubt, run.points).mean()) for run in runs]
    curves = list[Pieces]()
    for first in range(0, len(runs), RUNS_TOGETHER):
        check()
        some = slice(first, first + RUNS_TOGETHER)
        curves += fit_polylines(runs[some], tolerances[some], partition.doubt)
    fitted = iter(curves)
    found = [
        (region, assembled([next(fitted) if isinstance(part, Polyline) else part for part in outline]))
        for region, outline in scaled
    ]
    return [(region, contour) for region, contour in found if contour and len(contour.cubics) > 1]


def _layers(
    partition: Partition, loops: Loops, boundary: Boundary, tree: Tree, ranks: Ints, is_clear: Bools
) -> Layers:
    """Return regions as they lie on one another by their ranks; nothing may lie under those ``is_clear``."""
    hiding = np.where(is_clear, -1, ranks)
    holed = has_inside(tree, is_clear)
    # Something transparent may lie between regions as well as inside one; what reaches the border of the
    # image is not between them.
    has_holes = bool(enclosed(loops, holed).any())
    cover = Cover(partition.labels.mapped(hiding, HIDES_ALL))
    return Layers(loops, boundary, ranks, hiding, cover, in_holes_with(loops, holed), has_holes)


TOLERANCE = 0.1
"""Largest distance of an outline of known place from its curve [px]."""


def _ground(partition: Partition, tree: Tree, *, may_have_ground: bool) -> tuple[Bools, Coloring | None]:
    """Return which regions are not painted, and the colour of the canvas; None if it is transparent."""
    clear = np.array([coloring.is_clear for coloring in partition.colorings])[partition.paint]
    opaque = all(partition.colorings[paint].color[3] >= OPAQUE for paint in numbers_in(partition.paint))
    if not may_have_ground or not opaque or clear.any():
        return clear, None
    edge = partition.paint[partition.labels.border()]
    sizes = partition.labels.sizes(len(partition.paint))
    areas = np.bincount(partition.paint, sizes, len(partition.colorings))
    paint = int((areas * np.isin(np.arange(len(areas)), edge)).argmax())
    if partition.colorings[paint].ramp is not None:
        return np.zeros(len(partition.paint), np.bool_), None
    return bare_ground(tree, partition.paint == paint), partition.colorings[paint]


ALIKE = 6.0
"""How far colours that pass for the ground's are off it [levels]: in a JPEG, parts of one colour differ."""


def _removed(partition: Partition, removal: str) -> tuple[Bools, Coloring]:
    """Return which regions are not painted as the ground is removed, and its colouring, the border's."""
    edge = partition.labels.border()
    ground = partition.colorings[int(np.bincount(partition.paint[edge]).argmax())]
    off = np.array([np.abs(coloring.color - ground.color).max() for coloring in partition.colorings])
    is_ground = (off <= ALIKE)[partition.paint]
    if removal == "outside":
        is_ground &= np.isin(np.arange(len(is_ground)), edge)
    return is_ground, ground


def _scene(canvas: Canvas, shapes: list[Fill]) -> Traced:
    contours = [contour for shape in shapes for contour in shape.contours]
    counts = np.array([3 * len(contour.cubics) for contour in contours], np.int64)
    by_shape = np.array([sum(3 * len(c.cubics) for c in shape.contours) for shape in shapes], np.int64)
    points = [contour.cubics[:, :3].reshape(-1, 2) for contour in contours]
    colors = np.array([shape.coloring.color for shape in shapes]).reshape(-1, 4)
    has_ramp = np.array([shape.coloring.ramp is not None for shape in shapes], np.bool_)
    joints = joints_of(contours)
    scene = Scene(
        canvas,
        np.full(len(shapes), Kind.FILL, np.int32),
        starts_of(by_shape),
        np.full(len(shapes), Basis.CUBIC, np.int32),
        points=np.concatenate([*points, np.zeros((0, 2))]).astype(np.float32),
        starts=starts_of(counts),
        closed=np.ones(len(counts), np.int32),
        colors=straight_color((colors / 255).astype(np.float32)),
        # The opacity of a gradient is that of its stops.
        opacities=np.where(has_ramp | (colors[:, 3] >= OPAQUE), 1, colors[:, 3] / 255).astype(np.float32),
        **_paints(shapes),
    )
    return Traced(scene, joints.astype(np.int32))


def _paints(shapes: list[Fill]) -> dict[str, Any]:
    """Return the gradients as fields of a ``Scene``."""
    ramps = [shape.coloring.ramp for shape in shapes]
    known = [ramp for ramp in ramps if ramp is not None]
    stops = np.concatenate([*(ramp.colors for ramp in known), np.zeros((0, 4))]).astype(np.float32) / 255
    flat = np.zeros(6)
    opacity = np.where(stops[:, 3] * 255 >= OPAQUE, 1, stops[:, 3])
    return {
        "paint": np.array([Paint.FLAT if r is None else r.paint for r in ramps], np.int32),
        "frames": np.array([flat if r is None else r.frame for r in ramps], np.float32).reshape(-1, 6),
        "stop_first": starts_of(np.array([0 if r is None else len(r.offsets) for r in ramps], np.int64)),
        "stop_offsets": np.concatenate([*(r.offsets for r in known), np.zeros(0)]).astype(np.float32),
        "stop_colors": straight_color(stops),
        "stop_opacities": opacity.astype(np.float32),
    }
