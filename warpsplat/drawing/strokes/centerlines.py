"""Lines of ink as centre lines: what a pen drew in one go, and how wide."""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import chain

import cv2
import numpy as np

from warpsplat.drawing.strokes.areas import (
    Areas,
    distance_from,
    is_beside,
    split_areas,
    with_ends_in_areas,
)
from warpsplat.drawing.strokes.blobs import BROAD, hollowed, pen_width
from warpsplat.drawing.strokes.chains import find_chains, smoothed, traced
from warpsplat.drawing.strokes.crossings import with_crossings
from warpsplat.drawing.strokes.dots import Dot, bare_dots, round_dots
from warpsplat.drawing.strokes.ink import Ink
from warpsplat.drawing.strokes.measure import measured
from warpsplat.drawing.strokes.pens import find_pens, line_colors
from warpsplat.drawing.strokes.ridges import FAINT, across, middles, with_thin
from warpsplat.drawing.strokes.skeleton import Graph, find_graph
from warpsplat.drawing.trace.grids import Bools, Floats, Ints, at_pixels, dilated, eroded
from warpsplat.portable import filters
from warpsplat.scene import FloatArray


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
class _Split:
    """Ink by how it is drawn."""

    thin: Ink
    """The ink that is drawn along its centre lines."""
    rings: list[Floats] = field(default_factory=list)
    """Closed lines that fill what is broad, shape (point, 2) each [px]."""
    ring_width: float = 0.0
    dots: list[Dot] = field(default_factory=list)
    areas: Areas | None = None
    apart: Bools | None = None
    """The pixels of areas or of dots; None if there are none."""


def _split(ink: Ink, *, mixed: bool) -> _Split:
    """Tell lines from filled areas if ``mixed``, else from dots and from what rings fill."""
    if mixed:
        thin, areas = split_areas(ink)
        return _Split(thin, areas=areas, apart=areas.labels > 0 if areas else None)
    dots, covered = ([], None) if ink.textured else round_dots(ink, pen_width(ink.mask))
    hollow, rings, width = hollowed(ink if covered is None else ink.without(covered))
    return _Split(hollow, rings, width, dots, apart=covered if dots else None)


FINE = 1100  # [px] longer side of an image up to which its ink is thinned at twice the size
MOST = 20_000  # lines: the longest


def find_lines(ink: Ink, *, mixed: bool = False, only_lines: bool = False) -> Strokes:
    """Find the centre lines of ``ink``; through junctions they go straight on.

    Args:
        ink: Of the image.
        mixed: Whether its broad parts stay areas; otherwise rings fill them.
        only_lines: Whether it has no broad parts, however wide it is.
    """
    split = _Split(ink) if only_lines else _split(ink, mixed=mixed)
    fine = 2 if max(ink.mask.shape) <= FINE else 1
    graph, radii = find_graph(split.thin.mask if fine == 1 else _enlarged(split.thin, fine))
    graph = with_crossings(graph)
    if len(graph.edges) > MOST:
        longest = np.argsort([-edge.length() for edge in graph.edges], kind="stable")[:MOST]
        graph = Graph([graph.edges[i] for i in np.sort(longest)], graph.places, graph.radii)
    outlines = split.areas.outlines() if split.areas else []
    centers: list[Floats] = [edge.points / fine for edge in graph.edges]
    parts: list[list[Floats]] = [centers, split.rings, outlines, [dot.ends for dot in split.dots]]
    pens, owners = find_pens(*line_colors(list(chain.from_iterable(parts)), ink))
    bounds = np.cumsum([len(part) for part in parts])[:-1]
    edge_pens, ring_pens, area_pens, dot_pens = np.split(owners, bounds)
    lines = _center_lines(ink, split, graph, radii, fine, edge_pens)
    for ring, pen in zip(split.rings, ring_pens.tolist(), strict=True):
        lines.append(CenterLine(*smoothed(ring, np.full(len(ring), split.ring_width), closed=True), pen))
    lines += [_dot(dot, pen) for dot, pen in zip(split.dots, dot_pens.tolist(), strict=True)]
    if len(pens) and not ink.textured:
        broadest = 2 * BROAD * pen_width(ink.mask)
        drawn = [(line.points, line.widths, line.closed) for line in lines]
        for dot in bare_dots(split.thin if split.areas else ink, drawn, broadest):
            lines.append(_dot(dot, _pen_at(dot, ink, pens)))
    if split.areas:  # which show their colour better than lines do
        for pen in np.unique(area_pens):
            pens[pen] = split.areas.color(ink.shown, 1 + np.flatnonzero(area_pens == pen))
    return Strokes(lines, pens, split.areas, area_pens)


def _center_lines(
    ink: Ink, split: _Split, graph: Graph, radii: Floats, fine: int, pens: Ints
) -> list[CenterLine]:
    """Return the lines along a skeleton that is ``fine`` times as large as the ink; ``pens``: its edges'."""
    around = cv2.dilate(ink.cover - split.thin.cover, np.ones((5, 5), np.uint8)) > 0
    away = None if split.apart is None else distance_from(split.apart)
    lines = []
    for edges, pen in find_chains(graph, pens):
        line = traced(graph, edges, radii)
        if line is None:
            continue
        points, widths, closed = line
        points, widths = measured(points / fine, widths / fine, closed, split.thin.cover)
        if split.rings:
            # Most of the line may go around what rings fill.
            is_around = at_pixels(around, points).mean() > 0.5
            widths = np.maximum(widths, split.ring_width) if is_around else widths
        if away is not None and is_beside(points, widths, away):
            continue
        if away is not None and not closed:
            points, widths = with_ends_in_areas(points, widths, away)
        lines.append(CenterLine(points, widths, closed, pen))
    return lines


def _dot(dot: Dot, pen: int) -> CenterLine:
    return CenterLine(dot.ends, np.full(2, dot.width), False, pen)


def _pen_at(dot: Dot, ink: Ink, pens: FloatArray) -> int:
    """Return the pen whose colour is the most like that in the middle of a dot."""
    color = at_pixels(ink.shown, dot.ends.mean(axis=0)[None])
    return int(np.linalg.norm(pens - color, axis=1).argmin())


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
