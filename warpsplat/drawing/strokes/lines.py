"""Ink -> strokes along its centre lines, each with the width and the colour of its pen."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from itertools import chain

import numpy as np

from warpsplat.drawing.strokes.broad import Areas, Split, distance_from, split
from warpsplat.drawing.strokes.chains import find_chains, smoothed, with_corners, with_crossings
from warpsplat.drawing.strokes.ink import FAINT, Ink, across, middles, with_thin
from warpsplat.drawing.strokes.pens import find_pens, line_colors
from warpsplat.drawing.strokes.skeleton import find_graph
from warpsplat.drawing.trace.curves import fit_polylines
from warpsplat.drawing.trace.grids import Bools, Floats, Ints, at_pixels, dilated, eroded, nearest_in
from warpsplat.drawing.trace.polylines import arc_lengths
from warpsplat.drawing.trace.spans import Polyline
from warpsplat.portable import filters
from warpsplat.portable.elementary import hypot
from warpsplat.scene import Basis, Canvas, FloatArray, Kind, Scene
from warpsplat.scene.scene import starts_of

TOLERANCE = 0.4  # [px] largest distance of a centre line from its curve
FINE_PIXELS = 1_000_000  # of the largest image whose ink is thinned at twice the size


@dataclass(frozen=True)
class CenterLine:
    """A line drawn without lifting the pen."""

    points: Floats
    """Places on the centre line [px], shape (point, 2); the first one of a ring is not repeated."""
    closed: bool
    pen: int
    """Row of the pens' colours."""
    width: float = 0.0
    """[px]"""


@dataclass(frozen=True)
class TracedLines:
    """Traced line art."""

    lines: list[CenterLine]
    """Ordered by their pens."""
    canvas: Canvas
    pens: FloatArray
    """sRGB in [0, 1], shape (pen, 3)."""
    areas: Areas | None
    """Areas that are filled."""
    area_pens: Ints
    """The pen of each area."""

    def scene(self) -> Scene:
        """Return the lines as opaque strokes; ``layer`` is the pen of each."""
        runs = [
            Polyline(line.points, True)
            if line.closed
            else Polyline(line.points[1:-1], False, line.points[0], line.points[-1])
            for line in self.lines
        ]
        unsure = np.ones((1, 1), np.float32)  # how far off centre lines are at corners, anywhere [px]
        fitted = fit_polylines(runs, [TOLERANCE] * len(runs), unsure)
        # Closed chains do not repeat their first point.
        chains = [
            np.concatenate([pieces.cubics[:, :3].reshape(-1, 2), pieces.cubics[-1:, 3][line.closed :]])
            for line, pieces in zip(self.lines, fitted, strict=True)
        ]
        count, owner = len(chains), np.array([line.pen for line in self.lines], np.int32)
        return Scene(
            self.canvas,
            np.full(count, Kind.STROKE, np.int32),
            starts_of(np.array([len(points) for points in chains], np.int64)),
            np.full(count, Basis.CUBIC, np.int32),
            points=np.concatenate([*chains, np.zeros((0, 2))]).astype(np.float32),
            closed=np.array([line.closed for line in self.lines], np.int32),
            colors=self.pens[owner].reshape(-1, 3),
            opacities=np.ones(count, np.float32),
            widths=np.array([line.width for line in self.lines], np.float32),
            layer=owner,
        )


def trace_ink(
    ink: Ink, *, mixed: bool = False, only_lines: bool = False, ring_width: float | None = None
) -> TracedLines:
    """Find the centre lines of ink, and their pens; through junctions they go straight on.

    Args:
        ink: Of the image.
        mixed: Whether its broad parts stay areas, which are not traced.
        only_lines: Whether it has no broad parts, however wide it is.
        ring_width: As for ``split``.
    """
    parts = Split(ink) if only_lines else split(ink, mixed=mixed, ring_width=ring_width)
    fine = 2 if ink.mask.size <= FINE_PIXELS else 1
    graph = find_graph(parts.thin.mask if fine == 1 else _enlarged(parts.thin, fine))
    graph = with_corners(with_crossings(graph))
    places: list[list[Floats]] = [
        [edge.points / fine for edge in graph.edges],
        parts.rings,
        parts.areas.places() if parts.areas else [],
        [dot.place[None] for dot in parts.dots],
    ]
    pens, owners = find_pens(*line_colors(list(chain.from_iterable(places)), ink))
    bounds = np.cumsum([len(some) for some in places])[:-1]
    edge_pens, ring_pens, area_pens, dot_pens = np.split(owners, bounds)
    lines = [CenterLine(points / fine, closed, pen) for points, closed, pen in find_chains(graph, edge_pens)]
    lines = _measured(lines, parts.thin.cover)
    if parts.apart is not None:
        away = distance_from(parts.apart)
        lines = [joined for line in lines for joined in _joined_to(away, line)]
    for ring, pen in zip(parts.rings, ring_pens.tolist(), strict=True):
        lines.append(CenterLine(*smoothed(ring, closed=True), pen, parts.width))
    for dot, pen in zip(parts.dots, dot_pens.tolist(), strict=True):
        lines.append(CenterLine(np.stack([dot.place] * 2), False, pen, dot.width))
    height, width = ink.mask.shape
    lines.sort(key=lambda line: line.pen)
    return TracedLines(lines, Canvas(width, height, ink.paper), pens, parts.areas, area_pens)


def _joined_to(away: Floats, line: CenterLine) -> list[CenterLine]:
    """Return a line that reaches into the areas where it ends; none if it is just the rest of a corner.

    Args:
        away: Distance of each pixel from the areas [px], shape (height, width).
        line: Of ink beside the areas.
    """
    points, width = line.points, line.width
    if (at_pixels(away, points) <= width + 1).all():
        return []
    if line.closed:
        return [line]
    for _ in range(2):  # the end, and the other one
        apart = float(at_pixels(away, points[-1:])[0])
        if apart <= width + 1:
            back = points[-1] - points[max(0, len(points) - 2 - round(2 * width))]
            direction = back / max(float(hypot(*back)), 1e-9)
            points = np.concatenate([points, points[-1:] + (apart + width) * direction])
        points = points[::-1]
    return [replace(line, points=points)]


def _measured(lines: list[CenterLine], cover: FloatArray) -> list[CenterLine]:
    """Return lines with the widths at which they have the ink that is nearest to them, if there is any.

    Args:
        lines: Of an image.
        cover: Inked share of each pixel, shape (height, width).
    """
    if not lines:
        return lines
    owner = np.full(cover.shape, -1, np.intp)
    for number, line in enumerate(lines):
        columns, rows = np.clip(line.points.astype(np.intp).T, 0, np.array(cover.shape[::-1])[:, None] - 1)
        owner[rows, columns] = number
    nearest = owner.reshape(-1)[nearest_in(owner >= 0)]
    ink = np.bincount(nearest.reshape(-1), cover.reshape(-1), len(lines))
    found = []
    for line, area in zip(lines, ink.tolist(), strict=True):
        length = float(arc_lengths(line.points, closed=line.closed)[-1])
        # An open line has the area of its caps, too.
        open_width = 2 * (math.sqrt(length * length + math.pi * area) - length) / math.pi
        if area > 0:
            found.append(replace(line, width=area / length if line.closed else open_width))
    return found


def _enlarged(ink: Ink, factor: int) -> Bools:
    """Return the ink's mask at ``factor`` times the size, with its edge where half a pixel is covered."""
    size = (ink.mask.shape[1] * factor, ink.mask.shape[0] * factor)
    cover = filters.resize_cubic(ink.cover, size)
    held = np.kron(dilated(ink.mask, 3), np.ones((factor, factor), np.bool_))
    inked = ((cover > 0.5) & held) | eroded(np.kron(ink.mask, np.ones((factor, factor), np.bool_)), 3)
    thin = middles(across(ink.cover, factor), FAINT, factor)
    return with_thin(inked, thin & held, factor)
