"""Lines of ink as centre lines: what a pen drew in one go, and how wide."""

from __future__ import annotations

from dataclasses import dataclass, field

import cv2
import numpy as np

from warpsplat.drawing.strokes.areas import Areas, away_from, is_beside, parted, reaching
from warpsplat.drawing.strokes.blobs import BROAD, hollowed, pen_width
from warpsplat.drawing.strokes.dots import Dot, bare_dots, round_dots, without
from warpsplat.drawing.strokes.ink import Ink
from warpsplat.drawing.strokes.measure import measured
from warpsplat.drawing.strokes.pens import find_pens, line_colors
from warpsplat.drawing.strokes.ridges import FAINT, across, middles, with_thin
from warpsplat.drawing.strokes.skeleton import Edge, Graph, find_graph
from warpsplat.drawing.trace.grids import Bools, Floats, Ints
from warpsplat.portable import filters
from warpsplat.portable.elementary import exp, hypot
from warpsplat.portable.sequences import convolve, interp
from warpsplat.scene import FloatArray

STRAIGHT = 0.6427876
"""Cosine of the turn up to which a line goes on through a junction: 50 degrees."""

REACH = 4.0
"""Length of line that says in which direction it leaves a junction, over half the width of the ink there."""

DRAWN = 1.3
"""Length of line beside a junction that the other lines there draw aside, over the same."""

FORKED = 1.0
"""The same at a free end, where the outline's corners draw it."""

SMOOTH = 1.2
"""Standard deviation of the filter that takes the pixels' steps off a centre line [px]."""

MOST = 20_000
"""Lines at the most: the longest."""


@dataclass(frozen=True)
class Line:
    """What is drawn without lifting the pen."""

    points: Floats
    """Places on the centre line [px], shape (point, 2); of a ring without the first one again."""
    widths: Floats
    """There [px], shape (point,)."""
    closed: bool
    pen: int
    """Row of the pens' colours."""


@dataclass(frozen=True)
class Drawing:
    """Lines and what they are drawn with."""

    lines: list[Line]
    pens: FloatArray
    """sRGB in [0, 1], shape (pen, 3)."""
    areas: Areas | None = None
    """What is filled instead, where that was asked for and there is some."""
    area_pens: Ints = field(default_factory=lambda: np.zeros(0, np.intp))
    """Row of the pens' colours of each area."""


def find_lines(ink: Ink, *, mixed: bool = False) -> Drawing:
    """Centre lines of ``ink``, through junctions where they go straight on.

    Args:
        ink: of the picture.
        mixed: whether its broad parts stay areas; else rings fill them.
    """
    whole = ink
    rings: list[Floats] = []
    dots: list[Dot] = []
    width, areas = 0.0, None
    apart: Bools | None = None
    if mixed:
        ink, areas = parted(whole)
        apart = areas.labels > 0 if areas else None
    else:
        if not whole.textured:
            dots, dotted = round_dots(whole, pen_width(whole.mask))
            ink, apart = without(whole, dotted), dotted if dots else None
        ink, rings, width = hollowed(ink)
    outlines, away = areas.outlines() if areas else [], None if apart is None else away_from(apart)
    fine = 2 if max(ink.mask.shape) <= FINE else 1
    mask = ink.mask if fine == 1 else _enlarged(ink, fine)
    graph, radii = find_graph(mask)
    if len(graph.edges) > MOST:
        longest = np.argsort([-edge.length() for edge in graph.edges], kind="stable")[:MOST]
        graph = Graph([graph.edges[i] for i in np.sort(longest)], graph.places, graph.radii)
    edges = [edge.points / fine for edge in graph.edges]
    colors, weights = line_colors([*edges, *rings, *outlines, *(dot.ends for dot in dots)], whole)
    pens, owner = find_pens(colors, weights)
    lines = []
    for chain in _chains(graph, owner):
        line = _line(graph, chain, radii)
        if line is not None:
            points, widths, closed = line
            points, widths = measured(points / fine, widths / fine, closed, ink.cover)
            if rings and _is_around(points, whole.cover - ink.cover):
                widths = np.maximum(widths, width)
            if away is not None and is_beside(points, widths, away):
                continue
            if away is not None and not closed:
                points, widths = reaching(points, widths, away)
            lines.append(Line(points, widths, closed, int(owner[chain[0][0]])))
    filled = owner[len(edges) :]
    for ring, pen in zip(rings, filled[: len(rings)].tolist(), strict=True):
        points, widths, closed = _smoothed(ring, np.full(len(ring), width), closed=True)
        lines.append(Line(points, widths, closed, pen))
    area_pens, dot_pens = np.split(filled[len(rings) :], [len(outlines)])
    lines += [_dot(dot, pen) for dot, pen in zip(dots, dot_pens.tolist(), strict=True)]
    if len(pens) and not whole.textured:
        broadest = 2 * BROAD * pen_width(whole.mask)
        drawn = [(line.points, line.widths, line.closed) for line in lines]
        for dot in bare_dots(ink if areas else whole, drawn, broadest):
            lines.append(_dot(dot, _pen_at(dot, whole, pens)))
    if areas:  # which show their colour better than lines do
        for pen in np.unique(area_pens):
            pens[pen] = areas.color(whole.shown, 1 + np.flatnonzero(area_pens == pen))
    return Drawing(lines, pens, areas, area_pens)


def _dot(dot: Dot, pen: int) -> Line:
    return Line(dot.ends, np.full(2, dot.width), False, pen)


def _pen_at(dot: Dot, ink: Ink, pens: FloatArray) -> int:
    """The pen whose colour is the most like that in the middle of a dot."""
    size = np.array(ink.mask.shape[::-1])
    column, row = np.clip(dot.ends.mean(axis=0).astype(np.intp), 0, size - 1)
    return int(np.linalg.norm(pens - ink.shown[row, column], axis=1).argmin())


def _is_around(points: Floats, hollow: FloatArray) -> bool:
    """Whether most of a line is the edge of what is ``hollow``, shape (height, width)."""
    near = cv2.dilate(hollow, np.ones((5, 5), np.uint8))
    columns, rows = np.clip(points.T.astype(np.intp), 0, np.array(near.shape[::-1])[:, None] - 1)
    return bool((near[rows, columns] > 0).mean() > 0.5)


FINE = 1100
"""Longer side of a picture up to which its ink is thinned at twice the size [px]."""


def _enlarged(ink: Ink, factor: int) -> np.ndarray:
    """The ink's mask at ``factor`` times the size, its edge where half a pixel is covered."""
    size = (ink.mask.shape[1] * factor, ink.mask.shape[0] * factor)
    cover = filters.resize_cubic(ink.cover, size)
    mask, kernel = ink.mask.astype(np.uint8), np.ones((3, 3), np.uint8)
    held = cv2.resize(cv2.dilate(mask, kernel), size, interpolation=cv2.INTER_NEAREST)
    core = cv2.erode(cv2.resize(mask, size, interpolation=cv2.INTER_NEAREST), kernel)
    if ink.textured:
        return np.asarray(((cover > 0.5) & (held > 0)) | (core > 0), np.bool_)
    thin = middles(across(ink.cover, factor), FAINT, factor)
    return with_thin(((cover > 0.5) & (held > 0)) | (core > 0), thin & (held > 0), factor)


Chain = list[tuple[int, bool]]
"""Edges in the order in which they are drawn, and whether from their ends."""


def _chains(graph: Graph, owner: Ints) -> list[Chain]:
    """Edges of one pen that go straight on into one another."""
    following = _continued(graph, owner)
    chains: list[Chain] = []
    seen = [False] * len(graph.edges)
    starts = [(n, end) for n in range(len(graph.edges)) for end in (0, 1) if (n, end) not in following]
    rest = [(n, 0) for n in range(len(graph.edges))]
    for number, end in (*starts, *rest):
        if seen[number]:
            continue
        chain: Chain = []
        here: tuple[int, int] | None = (number, end)
        while here is not None and not seen[here[0]]:
            seen[here[0]] = True
            chain.append((here[0], here[1] == 1))
            here = following.get((here[0], 1 - here[1]))
        chains.append(chain)
    return chains


def _continued(graph: Graph, owner: Ints) -> dict[tuple[int, int], tuple[int, int]]:
    """The end of an edge (its number; 0: where it begins, 1: where it ends) at which each end goes on."""
    found: dict[tuple[int, int], tuple[int, int]] = {}
    for node, numbers in enumerate(graph.at):
        if len(numbers) < 2:
            continue
        ends = [(n, e) for n in sorted(set(numbers)) for e in (0, 1) if graph.edges[n].nodes[e] == node]
        if len(ends) == 2 and ends[0][0] == ends[1][0]:
            continue
        ways = [_way(graph.edges[n], e, float(graph.radii[node])) for n, e in ends]
        bends = sorted(
            (-_straightness(ways[i], ways[j]), i, j)
            for i in range(len(ends))
            for j in range(i)
            if owner[ends[i][0]] == owner[ends[j][0]]
        )
        for bend, i, j in bends:
            if -bend >= STRAIGHT and ends[i] not in found and ends[j] not in found:
                found[ends[i]], found[ends[j]] = ends[j], ends[i]
    return found


def _way(edge: Edge, end: int, radius: float) -> Floats:
    """Unit vector in which an edge leaves its node, past what the junction draws aside."""
    points = edge.points if end == 0 else edge.points[::-1]
    along = np.concatenate([[0.0], np.cumsum(hypot(*np.diff(points, axis=0).T))])
    low, high = DRAWN * radius, REACH * max(radius, 1.5)
    if along[-1] < high:
        low, high = 0.3 * along[-1], along[-1]
    near = points[np.searchsorted(along, low) : np.searchsorted(along, high) + 1]
    way = near[-1] - near[0] if len(near) > 1 else points[-1] - points[0]
    return np.asarray(way / max(float(hypot(*way)), 1e-9))


def _straightness(one: Floats, other: Floats) -> float:
    """Cosine of the turn of a line that comes against one unit vector and leaves along another."""
    return min(-float((one * other).sum()), 1.0)


def _line(graph: Graph, chain: Chain, radii: Floats) -> tuple[Floats, Floats, bool] | None:
    """Points, widths, and whether they are a ring."""
    parts, widths = [], []
    nodes = []
    for number, is_backwards in chain:
        edge = graph.edges[number].backwards() if is_backwards else graph.edges[number]
        nodes.append(edge.nodes)
        keep = _undrawn(graph, edge)
        part = edge.points[keep]
        rows, columns = (np.clip(part[:, a].astype(np.intp), 0, radii.shape[1 - a] - 1) for a in (1, 0))
        parts.append(part)
        widths.append(2 * radii[rows, columns])
    closed = nodes[0][0] == nodes[-1][1] and len(parts[0]) > 0 and _goes_round(graph, chain)
    points = np.concatenate(parts)
    width = np.concatenate(widths)
    if not closed:
        start, end = _outer(graph, chain[0], 0), _outer(graph, chain[-1], 1)
        if len(points) > 3:
            radius = float(np.median(width)) / 2
            start, end = _ahead(points, start, radius), _ahead(points[::-1], end, radius)
        points = np.concatenate([start[None], points, end[None]])
        width = (
            np.pad(width, 1, mode="edge") if len(width) else np.full(2, 2 * float(graph.radii[nodes[0][0]]))
        )
    if len(points) < 2:
        return None
    return _smoothed(points, width, closed)


def _outer(graph: Graph, link: tuple[int, bool], end: int) -> Floats:
    """The place where a chain's first edge begins (``end`` 0), or its last one ends (1)."""
    number, is_backwards = link
    points = graph.edges[number].points
    return np.asarray(points[-1] if is_backwards == (end == 0) else points[0])


def _ahead(points: Floats, place: Floats, radius: float) -> Floats:
    """Where a line that begins with ``points`` begins if it came straight from beside ``place``."""
    way = points[0] - points[min(len(points) - 1, max(4, round(2 * radius)))]
    way = way / max(float(hypot(*way)), 1e-9)
    away = place - points[0]
    aside = abs(float(away[0] * way[1] - away[1] * way[0]))
    return np.asarray(
        points[0] + max(float((away * way).sum()), 0.0) * way if aside <= max(radius, 1.5) else place
    )


def _goes_round(graph: Graph, chain: Chain) -> bool:
    """Whether a chain that ends where it began is one smooth ring."""
    (first, first_back), (last, last_back) = chain[0], chain[-1]
    node = graph.edges[first].nodes[1 if first_back else 0]
    if len(graph.at[node]) <= 2:
        return True
    radius = float(graph.radii[node])
    one, other = (
        _way(graph.edges[first], int(first_back), radius),
        _way(graph.edges[last], int(not last_back), radius),
    )
    return _straightness(one, other) >= STRAIGHT


def _undrawn(graph: Graph, edge: Edge) -> Floats:
    """The points of an edge that no junction draws aside."""
    along = np.concatenate([[0.0], np.cumsum(hypot(*np.diff(edge.points, axis=0).T))])
    total = along[-1]
    shares = (
        DRAWN if len(graph.at[node]) > 2 else FORKED if len(graph.at[node]) == 1 else 0.0
        for node in edge.nodes
    )
    before, after = (share * float(graph.radii[node]) for share, node in zip(shares, edge.nodes, strict=True))
    if before + after > 0.8 * total:
        scale = 0.8 * total / max(before + after, 1e-9)
        before, after = scale * before, scale * after
    # The places of nodes are means of pixels: lines that end there get them as ends.
    inner = (along > 0) & (along < total) if edge.nodes[0] != edge.nodes[1] else along >= 0
    return np.asarray(inner & (along >= before) & (along <= total - after))


def _smoothed(points: Floats, widths: Floats, closed: bool) -> tuple[Floats, Floats, bool]:
    """One point a pixel of length, without the steps of pixels."""
    if closed and hypot(*(points[0] - points[-1])) > 1e-6:
        points, widths = np.concatenate([points, points[:1]]), np.concatenate([widths, widths[:1]])
    along = np.concatenate([[0.0], np.cumsum(hypot(*np.diff(points, axis=0).T))])
    total = float(along[-1])
    count = max(2, round(total) + 1)
    at = np.linspace(0, total, count)
    even = np.stack([interp(at, along, points[:, axis]) for axis in (0, 1)], axis=1)
    wide = interp(at, along, widths)
    if closed:
        even, wide = even[:-1], wide[:-1]
    if len(even) < 4:
        return even, wide, closed and len(even) > 2
    reach = min(round(3 * SMOOTH), len(even) - 1)
    kernel = exp(-0.5 * (np.arange(-reach, reach + 1) / SMOOTH) ** 2)
    kernel /= kernel.sum()
    if closed:
        padded = np.concatenate([even[-reach:], even, even[:reach]])
    else:  # mirrored in the ends, which so stay where they are
        padded = np.concatenate(
            [2 * even[0] - even[reach:0:-1], even, 2 * even[-1] - even[-2 : -reach - 2 : -1]]
        )
    smooth = np.stack([convolve(padded[:, axis], kernel) for axis in (0, 1)], axis=1)
    return smooth, wide, closed
