"""A drawing -> a scene: regions, their outlines, their order."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from warpsplat.alpha import straight as straight_color
from warpsplat.drawing.trace.curves import Pieces, fit_runs
from warpsplat.drawing.trace.fewer import fewer_regions
from warpsplat.drawing.trace.grids import Bools, Floats, Ints
from warpsplat.drawing.trace.joints import ALONE, CORNER, FREE, LINE_HANDLE, SMOOTH
from warpsplat.drawing.trace.order import Layers, Tree, bare_ground, find_layers, find_tree, over_clear
from warpsplat.drawing.trace.outlines import crack_offsets, places, trends
from warpsplat.drawing.trace.planar import Loops, find_loops
from warpsplat.drawing.trace.regions import Coloring, Regions, find_regions
from warpsplat.drawing.trace.stack import Outline, Tracer, assembled
from warpsplat.portable.elementary import hypot
from warpsplat.scene import Basis, Canvas, FloatArray, Kind, Paint, Scene
from warpsplat.scene.scene import IntArray, starts_of

OPAQUE = 253.0
"""Opacity from which on a region is opaque [levels]."""

TOLERANCE = 0.2
"""Largest distance of an antialiased outline from its curve [px]."""

COARSE = 0.62
"""The same where pixels are not antialiased: staircases are half a pixel off."""

NOISY = 0.02
"""What a level of noise adds to it [px]."""

MOVED = 0.6
"""How far a handle may be from that line [px]."""

BENT = 0.14054083
"""Tangent of the angle between handles up to which they lie on one line: 8 degrees."""

MOST_REGIONS = 3000
"""Of any picture; one with more is no drawing."""

MERGED = 1500
"""Shapes among which those of one colour are looked for."""


@dataclass(frozen=True)
class Traced:
    """What a drawing was traced to."""

    scene: Scene
    joints: npt.NDArray[np.int32]
    """What each control point is (``joints``), shape (point,)."""
    same: npt.NDArray[np.int32]
    """Points with one number are one place in several shapes; ALONE for others. Shape (point,)."""


@dataclass
class _Shape:
    coloring: Coloring
    contours: list[Pieces]

    def box(self) -> Floats:
        points = np.concatenate([contour.cubics.reshape(-1, 2) for contour in self.contours])
        return np.concatenate([points.min(axis=0), points.max(axis=0)])


def trace(image: FloatArray, *, most: int | None = None) -> Traced:
    """Trace a drawing.

    Args:
        image: sRGB in [0, 1], shape (height, width, 3); premultiplied with opacity, shape (height, width, 4).
        most: the most paths; the regions that are seen least are given up. None: as many as there are.
    """
    levels = np.asarray(image, np.float32) * 255
    grounded = levels.shape[2] == 3
    if grounded:
        levels = np.concatenate([levels, np.full_like(levels[..., :1], 255)], axis=2)
    regions = fewer_regions(find_regions(levels), MOST_REGIONS)
    traced = trace_regions(levels, regions, grounded=grounded)
    target = len(regions.paint)
    while most is not None and len(traced.scene) > most and target > 2:
        # Regions of one colour may be one path, so that there may be more of them than paths.
        target = max(2, min(target - 1, int(target * most / len(traced.scene))))
        regions = fewer_regions(regions, target)
        traced = trace_regions(levels, regions, grounded=grounded)
    return traced


def trace_regions(image: Floats, regions: Regions, *, grounded: bool = True) -> Traced:
    """Trace regions that are known.

    Args:
        image: premultiplied, 0..255, shape (height, width, 4).
        regions: of the image.
        grounded: whether the canvas may have a colour, where all is opaque.
    """
    loops = find_loops(regions.labels, image)
    offsets = crack_offsets(loops, image, regions.labels, regions.pure)
    points, good = places(loops, offsets)
    tree = find_tree(loops, len(regions.paint))
    unpainted, ground = _ground(regions, tree, grounded=grounded)
    sizes = np.bincount(regions.labels.reshape(-1), minlength=len(regions.paint))
    layers = find_layers(loops, tree, sizes, unpainted)
    opacity = np.array([coloring.color[3] for coloring in regions.colorings])[regions.paint]
    see_through = (opacity < OPAQUE) | unpainted
    tracer = Tracer(
        loops,
        regions.labels,
        layers,
        see_through,
        over_clear(tree, opacity < OPAQUE),
        points,
        good,
        offsets,
        trends(loops),
        [],
    )
    outlines = _outlines(tracer, layers, loops)
    fitted = fit_runs(tracer.runs, tolerance_of(offsets, loops, regions.noise))
    shapes = []
    for region in layers.order.tolist():
        contours = [assembled(outline, fitted) for outline in outlines[region]]
        kept = [contour for contour in contours if contour is not None and len(contour.cubics) > 1]
        if kept:
            shapes.append(_Shape(regions.colorings[regions.paint[region]], kept))
    height, width = regions.labels.shape
    background = None if ground is None else (ground.color[:3] / 255).astype(np.float32)
    return _scene(Canvas(width, height, background), _merged(shapes))


def tolerance_of(offsets: Floats, loops: Loops, noise: float) -> float:
    """How near curves follow the points: not antialiased outlines are staircases."""
    inner = loops.others >= 0
    moved = np.abs(offsets[inner]) > 0.03
    return (COARSE if moved.mean() < 0.1 else TOLERANCE) + NOISY * noise if len(moved) else TOLERANCE


def _ground(regions: Regions, tree: Tree, *, grounded: bool) -> tuple[Bools, Coloring | None]:
    """Regions that are not painted, and the colour of the canvas, None if it is transparent."""
    clear = np.array([coloring.clear for coloring in regions.colorings])
    opaque = all(regions.colorings[paint].color[3] >= OPAQUE for paint in np.unique(regions.paint))
    if not grounded or not opaque or clear[regions.paint].any():
        return clear[regions.paint], None
    painted = regions.paint[regions.labels]
    edge = np.concatenate([painted[0], painted[-1], painted[:, 0], painted[:, -1]])
    areas = np.bincount(painted.reshape(-1), minlength=len(regions.colorings))
    areas = areas * np.isin(np.arange(len(areas)), edge)
    paint = int(areas.argmax())
    if regions.colorings[paint].ramp is not None:
        return np.zeros(len(regions.paint), np.bool_), None
    return bare_ground(tree, regions.paint == paint), regions.colorings[paint]


def _outlines(tracer: Tracer, layers: Layers, loops: Loops) -> dict[int, list[Outline]]:
    found: dict[int, list[Outline]] = {region: [] for region in layers.order.tolist()}
    for loop in range(len(loops)):
        region = int(loops.region[loop])
        if region in found:
            found[region].extend(tracer.outlines(loop))
    return found


def _merged(shapes: list[_Shape]) -> list[_Shape]:
    """Shapes of one colour are one where nothing lies between them."""
    if not 1 < len(shapes) <= MERGED:
        return shapes
    boxes = [shape.box() for shape in shapes]
    result: list[_Shape] = []
    kept: list[Floats] = []
    for shape, box in zip(shapes, boxes, strict=True):
        target = None
        for number in range(len(result) - 1, -1, -1):
            if result[number].coloring is shape.coloring:
                target = number
                break
            other = kept[number]
            if (box[:2] < other[2:]).all() and (other[:2] < box[2:]).all():
                break
        if target is None:
            result.append(_Shape(shape.coloring, list(shape.contours)))
            kept.append(box)
            continue
        result[target].contours.extend(shape.contours)
        both = np.stack([kept[target], box])
        kept[target] = np.concatenate([both[:, :2].min(axis=0), both[:, 2:].max(axis=0)])
    return result


def _joints(contour: Pieces) -> Ints:
    """What the points of a contour are, three for each piece."""
    cubics, lines = contour.cubics, contour.lines
    before, straight_before = np.roll(cubics, 1, axis=0), np.roll(lines, 1)
    arriving, leaving = before[:, 3] - before[:, 2], cubics[:, 1] - cubics[:, 0]
    cross = arriving[:, 0] * leaving[:, 1] - arriving[:, 1] * leaving[:, 0]
    cross, dot = np.abs(cross), (arriving * leaving).sum(axis=1)
    # What bends a long handle by a small angle moves a curve by pixels.
    length, length_before = hypot(*leaving.T), hypot(*arriving.T)
    sine = cross / np.maximum(length * length_before, 1e-12)
    length, length_before = np.where(lines, np.inf, length), np.where(straight_before, np.inf, length_before)
    moved = np.minimum(length, length_before) < MOVED / np.maximum(sine, 1e-12)
    smooth = (cross <= BENT * dot) & moved & ~(lines & straight_before)
    joints = np.full((len(cubics), 3), FREE, np.int32)
    joints[:, 0] = np.where(smooth, SMOOTH, CORNER)
    joints[lines, 1:] = LINE_HANDLE
    return joints.reshape(-1)


def _scene(canvas: Canvas, shapes: list[_Shape]) -> Traced:
    contours = [contour for shape in shapes for contour in shape.contours]
    counts = np.array([3 * len(contour.cubics) for contour in contours], np.int64)
    points = [contour.cubics[:, :3].reshape(-1, 2) for contour in contours]
    by_shape = np.array([sum(3 * len(c.cubics) for c in shape.contours) for shape in shapes], np.int64)
    colors = np.array([shape.coloring.color for shape in shapes]).reshape(-1, 4)
    ramps = np.array([shape.coloring.ramp is not None for shape in shapes], np.bool_)
    joints = [_joints(contour) for contour in contours]
    total = int(counts.sum())
    scene = Scene.of(
        canvas,
        np.full(len(shapes), Kind.FILL, np.int32),
        starts_of(by_shape),
        np.full(len(shapes), Basis.CUBIC, np.int32),
        points=np.concatenate([*points, np.zeros((0, 2))]).astype(np.float32),
        starts=starts_of(counts),
        closed=np.ones(len(counts), np.int32),
        colors=straight_color((colors / 255).astype(np.float32)),
        # That of a gradient is its stops'.
        opacities=np.where(ramps | (colors[:, 3] >= OPAQUE), 1, colors[:, 3] / 255).astype(np.float32),
        **_paints(shapes),
    )
    return Traced(
        scene,
        np.concatenate([*joints, np.zeros(0, np.int32)]).astype(np.int32),
        np.full(total, ALONE, np.int32),
    )


def _paints(shapes: list[_Shape]) -> dict[str, IntArray | FloatArray]:
    """Gradients as ``Scene`` has them."""
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
