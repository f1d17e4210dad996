"""Edges of a skeleton that a pen draws in one go, and the centre line along them."""

from __future__ import annotations

import numpy as np

from warpsplat.drawing.strokes.skeleton import Edge, Graph
from warpsplat.drawing.trace.grids import Floats, Ints, at_pixels
from warpsplat.drawing.trace.polylines import arc_lengths
from warpsplat.portable.elementary import exp, hypot
from warpsplat.portable.sequences import convolve, interp

STRAIGHT = 0.6427876  # cosine of the turn up to which a line goes on through a junction: 50 degrees

End = tuple[int, int]
"""An edge's number, and 0 where it begins or 1 where it ends."""

REACH = 4.0  # length of line that tells in which direction it leaves a junction, over half the ink's width
BENT = 1.3  # length of line beside a junction that the other lines there bend, over the same
FORKED = 1.0  # the same at a free end, where the corners of the outline bend it
SMOOTH = 1.2  # [px] standard deviation of the filter that takes the pixels' steps off a centre line


def find_chains(graph: Graph, pens: Ints) -> list[tuple[list[Edge], int]]:
    """Return edges of one pen that go straight on into one another, in order and direction, and their pen.

    Args:
        graph: A skeleton.
        pens: Of its edges.
    """
    following = _continued(graph, pens)
    chains: list[tuple[list[Edge], int]] = []
    seen = [False] * len(graph.edges)
    starts = [(n, end) for n in range(len(graph.edges)) for end in (0, 1) if (n, end) not in following]
    rest = [(n, 0) for n in range(len(graph.edges))]
    for first in (*starts, *rest):
        edges: list[Edge] = []
        here: End | None = first
        while here is not None and not seen[here[0]]:
            number, end = here
            seen[number] = True
            edges.append(graph.edges[number].backwards() if end else graph.edges[number])
            here = following.get((number, 1 - end))
        if edges:
            chains.append((edges, int(pens[first[0]])))
    return chains


def _continued(graph: Graph, pens: Ints) -> dict[End, End]:
    """Return the end of an edge at which each end of an edge goes straight on."""
    found: dict[End, End] = {}
    for node, numbers in enumerate(graph.at):
        if len(numbers) < 2:
            continue
        ends = [(n, e) for n in sorted(set(numbers)) for e in (0, 1) if graph.edges[n].nodes[e] == node]
        if len(ends) == 2 and ends[0][0] == ends[1][0]:
            continue
        directions = [_heading(graph.edges[n], e, float(graph.radii[node])) for n, e in ends]
        bends = sorted(
            (-_straightness(directions[i], directions[j]), i, j)
            for i in range(len(ends))
            for j in range(i)
            if pens[ends[i][0]] == pens[ends[j][0]]
        )
        for bend, i, j in bends:
            if -bend >= STRAIGHT and ends[i] not in found and ends[j] not in found:
                found[ends[i]], found[ends[j]] = ends[j], ends[i]
    return found


def _heading(edge: Edge, end: int, radius: float) -> Floats:
    """Return the unit vector in which an edge leaves its node, beyond what the junction bends."""
    points = edge.points if end == 0 else edge.points[::-1]
    along = arc_lengths(points)
    low, high = BENT * radius, REACH * max(radius, 1.5)
    if along[-1] < high:
        low, high = 0.3 * along[-1], along[-1]
    near = points[np.searchsorted(along, low) : np.searchsorted(along, high) + 1]
    direction = near[-1] - near[0] if len(near) > 1 else points[-1] - points[0]
    return np.asarray(direction / max(float(hypot(*direction)), 1e-9))


def _straightness(one: Floats, other: Floats) -> float:
    """Return the cosine of the turn of a line that comes against one unit vector and leaves along another."""
    return min(-float((one * other).sum()), 1.0)


def traced(graph: Graph, edges: list[Edge], radii: Floats) -> tuple[Floats, Floats, bool] | None:
    """Return points and widths along a chain, and whether it is a ring; None where there is too little of it.

    Args:
        graph: Of the edges.
        edges: A chain.
        radii: Half the width of the ink at each pixel.
    """
    parts = [_unbent(graph, edge) for edge in edges]
    points = np.concatenate(parts)
    widths = 2 * at_pixels(radii, points)
    first = edges[0].nodes[0]
    closed = first == edges[-1].nodes[1] and len(parts[0]) > 0 and _is_smooth_ring(graph, edges)
    if not closed:
        start, end = edges[0].points[0], edges[-1].points[-1]
        if len(points) > 3:
            radius = float(np.median(widths)) / 2
            start, end = _ahead(points, start, radius), _ahead(points[::-1], end, radius)
        points = np.concatenate([start[None], points, end[None]])
        empty = np.full(2, 2 * float(graph.radii[first]))
        widths = np.pad(widths, 1, mode="edge") if len(widths) else empty
    return smoothed(points, widths, closed) if len(points) > 1 else None


def _ahead(points: Floats, place: Floats, radius: float) -> Floats:
    """Return where a line that goes on with ``points`` begins, if it comes straight from beside ``place``."""
    direction = points[0] - points[min(len(points) - 1, max(4, round(2 * radius)))]
    direction = direction / max(float(hypot(*direction)), 1e-9)
    away = place - points[0]
    if abs(float(away[0] * direction[1] - away[1] * direction[0])) > max(radius, 1.5):
        return place
    return np.asarray(points[0] + max(float((away * direction).sum()), 0.0) * direction)


def _is_smooth_ring(graph: Graph, edges: list[Edge]) -> bool:
    """Return whether a chain that ends where it began goes straight on there."""
    node = edges[0].nodes[0]
    if len(graph.at[node]) <= 2:
        return True
    radius = float(graph.radii[node])
    return _straightness(_heading(edges[0], 0, radius), _heading(edges[-1], 1, radius)) >= STRAIGHT


def _unbent(graph: Graph, edge: Edge) -> Floats:
    """Return the points of an edge that no junction bends, without its nodes: means of several pixels."""
    along = arc_lengths(edge.points)
    total = along[-1]
    reach = {1: FORKED, 2: 0.0}
    before, after = (reach.get(len(graph.at[node]), BENT) * float(graph.radii[node]) for node in edge.nodes)
    if before + after > 0.8 * total:
        scale = 0.8 * total / max(before + after, 1e-9)
        before, after = scale * before, scale * after
    inner = (along > 0) & (along < total) if edge.nodes[0] != edge.nodes[1] else along >= 0
    return np.asarray(edge.points[inner & (along >= before) & (along <= total - after)])


def smoothed(points: Floats, widths: Floats, closed: bool) -> tuple[Floats, Floats, bool]:
    """Return a line with one point a pixel, without the steps of pixels; and whether it is still closed."""
    if closed and hypot(*(points[0] - points[-1])) > 1e-6:
        points, widths = np.concatenate([points, points[:1]]), np.concatenate([widths, widths[:1]])
    along = arc_lengths(points)
    total = float(along[-1])
    at = np.linspace(0, total, max(2, round(total) + 1))
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
    else:  # mirrored at the ends, which so stay where they are
        padded = np.pad(even, ((reach, reach), (0, 0)), mode="reflect", reflect_type="odd")
    smooth = np.stack([convolve(padded[:, axis], kernel) for axis in (0, 1)], axis=1)
    return smooth, wide, closed
