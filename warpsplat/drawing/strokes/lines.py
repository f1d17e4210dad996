"""Ink -> strokes along its centre lines, each with the width and the colour of its pen."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import chain

import numpy as np

from warpsplat.drawing.strokes.broad import Areas, Split, distance_from, split
from warpsplat.drawing.strokes.chains import find_chains, smoothed, traced, with_crossings
from warpsplat.drawing.strokes.ink import FAINT, Ink, across, middles, with_thin
from warpsplat.drawing.strokes.measure import measured
from warpsplat.drawing.strokes.pens import find_pens, line_colors
from warpsplat.drawing.strokes.skeleton import find_graph
from warpsplat.drawing.trace.curves import Pieces, fit_polylines
from warpsplat.drawing.trace.grids import Bools, Floats, Ints, at_pixels, dilated, eroded
from warpsplat.drawing.trace.spans import Polyline
from warpsplat.portable import filters
from warpsplat.portable.elementary import hypot
from warpsplat.scene import Basis, Canvas, FloatArray, Kind, Scene
from warpsplat.scene.scene import starts_of

TOLERANCE = 0.45  # [px] largest distance of a centre line from its curve
THINNEST, LONG = 0.3, 6.0
"""Width of a thin stroke, at the least, if it is so long [px]; otherwise one pixel."""
FINE = 1100  # [px] longer side of an image up to which its ink is thinned at twice the size


@dataclass(frozen=True)
class CenterLine:
    """A line drawn without lifting the pen."""

    points: Floats
    """Places on the centre line [px], shape (point, 2); the first one of a ring is not repeated."""
    widths: Floats
    """There [px], shape (point,)."""
    closed: bool
    pen: int
    """Row of the pens' colours."""

    def polyline(self) -> Polyline:
        """Return the line as curves are fitted to it."""
        if self.closed:
            return Polyline(self.points, True)
        return Polyline(self.points[1:-1], False, self.points[0], self.points[-1])


@dataclass(frozen=True)
class Strokes:
    """Lines, what they are drawn with, and filled areas where these were asked for."""

    lines: list[CenterLine]
    pens: FloatArray
    """sRGB in [0, 1], shape (pen, 3)."""
    areas: Areas | None
    area_pens: Ints
    """Row of the pens' colours of each area."""


@dataclass(frozen=True)
class TracedLines:
    """Traced line art."""

    scene: Scene
    """Strokes; ``layer`` is the pen of each."""
    pens: FloatArray
    """sRGB in [0, 1], shape (pen, 3)."""
    areas: Areas | None
    """Areas that are filled."""
    area_pens: Ints
    """The pen of each area."""


def trace_ink(ink: Ink, *, mixed: bool = False, only_lines: bool = False) -> TracedLines:
    """Trace the centre lines of ink as opaque strokes, with a layer for each pen.

    Args:
        ink: Of the image.
        mixed: Whether its broad parts stay areas, which are not traced.
        only_lines: Whether it has no broad parts, however wide it is.
    """
    found = find_lines(ink, mixed=mixed, only_lines=only_lines)
    strokes = [stroke for line in found.lines for stroke in _strokes(line, thin=not ink.textured)]
    strokes.sort(key=lambda stroke: stroke.pen)
    fitted = fit_polylines([stroke.polyline() for stroke in strokes], TOLERANCE)
    height, width = ink.mask.shape
    scene = _scene(Canvas(width, height, ink.paper), strokes, fitted, found.pens)
    return TracedLines(scene, found.pens, found.areas, found.area_pens)


def find_lines(ink: Ink, *, mixed: bool = False, only_lines: bool = False) -> Strokes:
    """Find the centre lines of ink; through junctions they go straight on. Arguments as ``trace_ink``."""
    parts = Split(ink) if only_lines else split(ink, mixed=mixed)
    fine = 2 if max(ink.mask.shape) <= FINE else 1
    graph, radii = find_graph(parts.thin.mask if fine == 1 else _enlarged(parts.thin, fine))
    graph = with_crossings(graph)
    places: list[list[Floats]] = [
        [edge.points / fine for edge in graph.edges],
        parts.rings,
        parts.areas.places() if parts.areas else [],
        [dot.place[None] for dot in parts.dots],
    ]
    pens, owners = find_pens(*line_colors(list(chain.from_iterable(places)), ink))
    bounds = np.cumsum([len(some) for some in places])[:-1]
    edge_pens, ring_pens, area_pens, dot_pens = np.split(owners, bounds)
    away = None if parts.apart is None else distance_from(parts.apart)
    lines = []
    for edges, pen in find_chains(graph, edge_pens):
        line = traced(graph, edges, radii)
        if line is not None:
            points, widths, closed = line
            measure = measured(points / fine, widths / fine, closed, parts.thin.cover)
            drawn = CenterLine(*measure, closed, pen)
            lines += [drawn] if away is None else _joined_to(away, drawn)
    for ring, pen in zip(parts.rings, ring_pens.tolist(), strict=True):
        lines.append(CenterLine(*smoothed(ring, np.full(len(ring), parts.width), closed=True), pen))
    for dot, pen in zip(parts.dots, dot_pens.tolist(), strict=True):
        lines.append(CenterLine(np.stack([dot.place] * 2), np.full(2, dot.width), False, pen))
    return Strokes(lines, pens, parts.areas, area_pens)


def _joined_to(away: Floats, line: CenterLine) -> list[CenterLine]:
    """Return a line that reaches into the areas where it ends; none if it is just the rest of a corner.

    Args:
        away: Distance of each pixel from the areas [px], shape (height, width).
        line: Of ink beside the areas.
    """
    points, widths = line.points, line.widths
    if (at_pixels(away, points) <= widths + 1).all():
        return []
    if line.closed:
        return [line]
    for _ in range(2):  # the end, and the other one
        wide, apart = float(widths[-1]), float(at_pixels(away, points[-1:])[0])
        if apart <= wide + 1:
            back = points[-1] - points[max(0, len(points) - 2 - round(2 * wide))]
            direction = back / max(float(hypot(*back)), 1e-9)
            points = np.concatenate([points, points[-1:] + (apart + wide) * direction])
            widths = np.append(widths, wide)
        points, widths = points[::-1], widths[::-1]
    return [CenterLine(points, widths, False, line.pen)]


def _enlarged(ink: Ink, factor: int) -> Bools:
    """Return the ink's mask at ``factor`` times the size, with its edge where half a pixel is covered."""
    size = (ink.mask.shape[1] * factor, ink.mask.shape[0] * factor)
    cover = filters.resize_cubic(ink.cover, size)
    held = np.kron(dilated(ink.mask, 3), np.ones((factor, factor), np.bool_))
    inked = ((cover > 0.5) & held) | eroded(np.kron(ink.mask, np.ones((factor, factor), np.bool_)), 3)
    if ink.textured:
        return inked
    thin = middles(across(ink.cover, factor), FAINT, factor)
    return with_thin(inked, thin & held, factor)


def _strokes(line: CenterLine, *, thin: bool) -> list[CenterLine]:
    """Return a line in parts of one width, which may be less than a pixel if ``thin``."""
    length = float(hypot(*np.diff(line.points, axis=0).T).sum())
    least = THINNEST if thin and length >= LONG else 1.0
    widths = np.maximum(line.widths, least)
    return [CenterLine(line.points, np.full(len(widths), np.median(widths)), line.closed, line.pen)]


def _scene(canvas: Canvas, strokes: list[CenterLine], fitted: list[Pieces], pens: FloatArray) -> Scene:
    """Return strokes as a ``Scene``, in which closed chains do not repeat their first point."""
    chains = [
        np.concatenate([pieces.cubics[:, :3].reshape(-1, 2), pieces.cubics[-1:, 3][stroke.closed :]])
        for stroke, pieces in zip(strokes, fitted, strict=True)
    ]
    owner = np.array([stroke.pen for stroke in strokes], np.int32)
    return Scene(
        canvas,
        np.full(len(strokes), Kind.STROKE, np.int32),
        starts_of(np.array([len(points) for points in chains], np.int64)),
        np.full(len(strokes), Basis.CUBIC, np.int32),
        points=np.concatenate([*chains, np.zeros((0, 2))]).astype(np.float32),
        closed=np.array([stroke.closed for stroke in strokes], np.int32),
        colors=pens[owner].reshape(-1, 3),
        opacities=np.ones(len(strokes), np.float32),
        widths=np.array([stroke.widths[0] for stroke in strokes], np.float32),
        layer=owner,
    )
