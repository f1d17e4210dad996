"""Edges of a skeleton that a pen draws in one go, and the centre line along them."""

from __future__ import annotations

import itertools
from typing import NamedTuple

import numpy as np

from warpsplat.drawing.strokes.skeleton import Edge, Graph, contracted
from warpsplat.drawing.trace.grids import Floats, Ints
from warpsplat.drawing.trace.polylines import arc_lengths
from warpsplat.portable.elementary import arctan2, exp, hypot
from warpsplat.portable.sequences import convolve, interp

END = 2.0  # [rad²] what an end of a stroke costs, as the bending of a line that goes on instead

End = tuple[int, int]
"""An edge's number, and 0 where it begins or 1 where it ends."""

REACH = 4.0  # length of line that tells in which direction it leaves a junction, over half the ink's width
BENT = 1.3  # length of line beside a junction that the other lines there bend, over the same
SMOOTH = 1.2  # [px] standard deviation of the filter that takes the pixels' steps off a centre line


class Arm(NamedTuple):
    """A line where it leaves a junction, beyond what the other lines bend."""

    place: Floats
    """Shape (2,)."""
    direction: Floats
    """Unit vector away from the junction, shape (2,)."""


Pairs = list[tuple[int, int]]


class Chain(NamedTuple):
    """Edges of one pen that go straight on into one another."""

    edges: list[Edge]
    """In order and direction."""
    closed: bool
    """Whether the last one goes on as the first."""
    pen: int


def find_chains(graph: Graph, pens: Ints) -> list[Chain]:
    """Return the lines that are drawn without lifting the pen.

    Args:
        graph: A skeleton.
        pens: Of its edges.
    """
    following = _continued(graph, pens)
    chains: list[Chain] = []
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
            chains.append(Chain(edges, here == first, int(pens[first[0]])))
    return chains


def _continued(graph: Graph, pens: Ints) -> dict[End, End]:
    """Return the end of an edge at which each end of an edge goes on."""
    found: dict[End, End] = {}
    for node in range(len(graph.at)):
        ends = ends_at(graph, node)
        arms = [arm_of(graph.edges[n], e, float(graph.radii[node])) for n, e in ends]
        pairs = [(0, 1)] if len(ends) == 2 else joined_arms(arms, [int(pens[n]) for n, _ in ends])[0]
        for i, j in pairs:
            found[ends[i]], found[ends[j]] = ends[j], ends[i]
    return found


def ends_at(graph: Graph, node: int) -> list[End]:
    """Return the ends of edges at a node."""
    return [(n, e) for n in sorted(set(graph.at[node])) for e in (0, 1) if graph.edges[n].nodes[e] == node]


def arm_of(edge: Edge, end: int, radius: float) -> Arm:
    """Return an edge where it leaves a junction of a ``radius``."""
    points = edge.points if end == 0 else edge.points[::-1]
    along = arc_lengths(points)
    low, high = BENT * radius, BENT * radius + REACH * max(min(radius, edge.half_width), 1.5)
    if along[-1] < high:
        low, high = min(low, 0.3 * along[-1]), along[-1]
    near = points[np.searchsorted(along, low) : np.searchsorted(along, high) + 1]
    near = near if len(near) > 1 else points[[0, -1]]
    direction = near[-1] - near[0]
    return Arm(near[0], direction / max(float(hypot(*direction)), 1e-9))


def bending(one: Arm, other: Arm) -> float:
    """Return how much a line bends that comes along one arm and leaves along another [rad²].

    It is the bending energy of a flat cubic between both, times its length: the square of its turn on an arc.
    """
    chord = other.place - one.place
    if hypot(*chord) < 1:
        chord = other.direction - one.direction
    before, after = _turn(-one.direction, chord), _turn(chord, other.direction)
    return 4 * (before * before - before * after + after * after)


def _turn(one: Floats, other: Floats) -> float:
    """Return the angle from one vector to another [rad]."""
    return float(arctan2(one[0] * other[1] - one[1] * other[0], (one * other).sum()))


def joined_arms(arms: list[Arm], kinds: list[int]) -> tuple[Pairs, float]:
    """Return which arms of a junction are one line, by the least bending and ends, and what these cost.

    ``kinds``: arms of different kinds are not joined.
    """
    costs = {
        (i, j): bending(arms[i], arms[j])
        for i, j in itertools.combinations(range(len(arms)), 2)
        if kinds[i] == kinds[j]
    }
    left, pairs, total = set(range(len(arms))), [], 0.0
    for pair in sorted(costs, key=lambda pair: (costs[pair], pair)):
        if costs[pair] < 2 * END and left.issuperset(pair):
            left.difference_update(pair)
            pairs.append(pair)
            total += costs[pair]
    return pairs, total + END * len(left)


def traced(graph: Graph, chain: Chain) -> tuple[Floats, bool] | None:
    """Return points along a chain, and whether it is a ring; None if there is too little of it."""
    edges, closed = chain.edges, chain.closed
    points = np.concatenate([_unbent(graph, edge) for edge in edges])
    closed = closed and len(points) > 0
    if not closed:
        start, end = edges[0].points[0], edges[-1].points[-1]
        if len(points) > 3:
            radius = float(np.median([edge.half_width for edge in edges]))
            start, end = _ahead(points, start, radius), _ahead(points[::-1], end, radius)
        points = np.concatenate([start[None], points, end[None]])
    return smoothed(points, closed=closed) if len(points) > 1 else None


def _ahead(points: Floats, place: Floats, radius: float) -> Floats:
    """Return where a line that goes on with ``points`` begins, if it comes straight from beside ``place``."""
    direction = points[0] - points[min(len(points) - 1, max(4, round(2 * radius)))]
    direction = direction / max(float(hypot(*direction)), 1e-9)
    away = place - points[0]
    if abs(float(away[0] * direction[1] - away[1] * direction[0])) > max(radius, 1.5):
        return place
    return np.asarray(points[0] + max(float((away * direction).sum()), 0.0) * direction)


def _unbent(graph: Graph, edge: Edge) -> Floats:
    """Return the points of an edge that no junction bends, without its nodes: means of several pixels."""
    along = arc_lengths(edge.points)
    total = along[-1]
    reach = {1: 1.0, 2: 0.0}  # at a free end the corners of the outline bend it
    before, after = (reach.get(len(graph.at[node]), BENT) * float(graph.radii[node]) for node in edge.nodes)
    if before + after > 0.8 * total:
        scale = 0.8 * total / max(before + after, 1e-9)
        before, after = scale * before, scale * after
    inner = (along > 0) & (along < total) if edge.nodes[0] != edge.nodes[1] else along >= 0
    return np.asarray(edge.points[inner & (along >= before) & (along <= total - after)])


def smoothed(points: Floats, *, closed: bool) -> tuple[Floats, bool]:
    """Return a line with one point a pixel, without the steps of pixels; and whether it is still closed."""
    if closed and hypot(*(points[0] - points[-1])) > 1e-6:
        points = np.concatenate([points, points[:1]])
    along = arc_lengths(points)
    at = np.linspace(0, float(along[-1]), max(2, round(float(along[-1])) + 1))
    even = np.stack([interp(at, along, points[:, axis]) for axis in (0, 1)], axis=1)
    if closed:
        even = even[:-1]
    if len(even) < 4:
        return even, closed and len(even) > 2
    reach = min(round(3 * SMOOTH), len(even) - 1)
    kernel = exp(-0.5 * (np.arange(-reach, reach + 1) / SMOOTH) ** 2)
    if closed:
        padded = np.concatenate([even[-reach:], even, even[:reach]])
    else:  # mirrored at the ends, which so stay where they are
        padded = np.pad(even, ((reach, reach), (0, 0)), mode="reflect", reflect_type="odd")
    return np.stack([convolve(padded[:, axis], kernel / kernel.sum()) for axis in (0, 1)], axis=1), closed


def with_crossings(graph: Graph) -> Graph:
    """Return a skeleton in which lines that cross meet in one node each."""
    while True:
        used: set[int] = set()
        overlaps = []
        for number in np.argsort([edge.length() for edge in graph.edges], kind="stable").tolist():
            edge = graph.edges[number]
            if used.isdisjoint(edge.nodes) and _is_overlap(graph, number):
                overlaps.append(number)
                used.update(edge.nodes)
        if not overlaps:
            return graph
        graph = contracted(graph, overlaps)


def _is_overlap(graph: Graph, number: int) -> bool:
    """Return whether the lines that meet at both ends of an edge bend less, and end less often, without it.

    Together they must cover it.
    """
    edge = graph.edges[number]
    a, b = edge.nodes
    if a == b or min(len(graph.at[a]), len(graph.at[b])) < 3:
        return False
    sides = [[_arm(graph, end, node) for end in ends_at(graph, node) if end[0] != number] for node in (a, b)]
    together = sides[0] + sides[1]
    pairs, cost = joined_arms(together, [0] * len(together))
    own = [arm_of(edge, end, float(graph.radii[node])) for end, node in enumerate((a, b))]
    apart = sum(
        joined_arms([arm, *side], [0] * (len(side) + 1))[1] for arm, side in zip(own, sides, strict=True)
    )
    return cost + END <= apart and _are_covering(together, pairs, edge)


def _arm(graph: Graph, end: tuple[int, int], node: int) -> Arm:
    return arm_of(graph.edges[end[0]], end[1], float(graph.radii[node]))


def _are_covering(arms: list[Arm], pairs: Pairs, edge: Edge) -> bool:
    """Return whether the lines that join ``pairs`` of arms cover an edge with their ink at all its points."""
    away = np.full(len(edge.points), np.inf)
    for i, j in pairs:
        away = np.minimum(away, _distances(edge.points, arms[i].place, arms[j].place))
    return bool((away <= edge.half_width + 1).all())


def _distances(points: Floats, start: Floats, end: Floats) -> Floats:
    """Return the distance of each point from a line of two ends."""
    way = end - start
    share = np.clip(((points - start) * way).sum(axis=1) / max(float((way * way).sum()), 1e-9), 0, 1)
    return np.asarray(hypot(*(points - start - share[:, None] * way).T))
