"""Edges of a skeleton that a pen draws in one go, and the centre line along them."""

from __future__ import annotations

import itertools
import math
from typing import NamedTuple

import numpy as np

from warpsplat.drawing.strokes.skeleton import Edge, End, Graph, contracted, runs_of
from warpsplat.drawing.trace.grids import Floats, Ints
from warpsplat.drawing.trace.polylines import arc_lengths
from warpsplat.portable.elementary import arctan2, exp, hypot
from warpsplat.portable.sequences import convolve, interp

END = 2.0  # [rad²] what an end of a stroke costs, as the bending of a line that goes on instead

REACH = 4.0  # length of line that tells in which direction it leaves a junction, over half the ink's width


class Arm(NamedTuple):
    """A line where it leaves a junction, beyond what the other lines bend."""

    place: Floats
    """Shape (2,)."""
    direction: Floats
    """Unit vector away from the junction, shape (2,)."""


Pairs = list[tuple[int, int]]


def find_chains(graph: Graph, pens: Ints) -> list[tuple[Floats, bool, int]]:
    """Return the lines that are drawn without lifting the pen: points, whether it is a ring, and its pen.

    Args:
        graph: A skeleton.
        pens: Of its edges.
    """
    following: dict[End, End] = {}
    for node, ends in enumerate(graph.at):
        arms, kinds = [_arm(graph, end, node) for end in ends], [int(pens[n]) for n, _ in ends]
        # Two are those of a ring, or of a corner.
        pairs = [(0, 1)] if len(ends) == 2 and kinds[0] == kinds[1] else joined_arms(arms, kinds)[0]
        for i, j in pairs:
            following |= {ends[i]: ends[j], ends[j]: ends[i]}
    tips = {node for node, ends in enumerate(graph.at) if len(ends) > 1 and following.keys().isdisjoint(ends)}
    chains = []
    for run, closed in runs_of(len(graph.edges), following):
        points, is_ring = _traced(graph, run, tips, closed=closed)
        chains.append((points, is_ring, int(pens[run[0][0]])))
    return chains


def _arm(graph: Graph, end: End, node: int) -> Arm:
    """Return an edge where it leaves its node."""
    edge, radius = graph.edge_from(end), float(graph.radii[node])
    points, along = edge.points, arc_lengths(edge.points)
    low, high = radius, radius + REACH * max(min(radius, edge.half_width), 1.5)
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


def _traced(graph: Graph, run: list[End], tips: set[int], *, closed: bool) -> tuple[Floats, bool]:
    """Return points along edges that no junction bends, and whether they are a ring.

    ``tips``: nodes where several lines end and none goes on, to which they lead; other ends are straight.
    """
    edges, parts = [graph.edge_from(end) for end in run], []
    for edge in edges:
        along = arc_lengths(edge.points)
        before, after = (graph.radii[n] if len(graph.at[n]) != 2 else 0.0 for n in edge.nodes)
        parts.append(edge.points[(along >= before) & (along <= along[-1] - after)])
    points = np.concatenate(parts)
    closed = closed and len(points) > 1
    if not closed:
        ends = (run[0], edges[0].nodes[0]), ((run[-1][0], 1 - run[-1][1]), edges[-1].nodes[1])
        begin, stop = (
            graph.places[node] if node in tips else _ahead(_arm(graph, end, node), graph.places[node])
            for end, node in ends
        )
        points = np.concatenate([begin[None], points, stop[None]])
    return smoothed(points, closed=closed)


def _ahead(arm: Arm, place: Floats) -> Floats:
    """Return the point beside a junction's place to which an arm leads straight."""
    return arm.place + min(float(((place - arm.place) * arm.direction).sum()), 0.0) * arm.direction


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
    reach = min(3, len(even) - 1)
    steps = np.arange(-reach, reach + 1)
    kernel = exp(-0.5 * steps * steps)  # of one pixel's deviation
    sides = ((reach, reach), (0, 0))
    if closed:
        padded = np.pad(even, sides, mode="wrap")
    else:  # mirrored at the ends, which so stay where they are
        padded = np.pad(even, sides, mode="reflect", reflect_type="odd")
    return np.stack([convolve(padded[:, axis], kernel / kernel.sum()) for axis in (0, 1)], axis=1), closed


def with_crossings(graph: Graph) -> Graph:
    """Return a skeleton in which lines that cross meet in one node each."""
    while True:
        used: set[int] = set()
        overlaps: list[int] = []
        arms = [[_arm(graph, end, node) for end in ends] for node, ends in enumerate(graph.at)]
        costs = [joined_arms(own, [0] * len(own))[1] if len(own) > 2 else 0.0 for own in arms]
        for numbers in _inner(graph):
            nodes = {node for number in numbers for node in graph.edges[number].nodes}
            if used.isdisjoint(nodes) and _are_overlaps(graph, numbers, nodes, arms, costs):
                overlaps += numbers
                used |= nodes
        if not overlaps:
            return graph
        graph = contracted(graph, overlaps)


def _inner(graph: Graph) -> list[tuple[int, ...]]:
    """Return the edges from one junction to another, the shortest first.

    Pairs that meet follow, of edges that are no longer than the ink of their junctions is wide.
    """
    crowded = [len(ends) > 2 for ends in graph.at]
    lengths = {
        number: edge.length()
        for number, edge in enumerate(graph.edges)
        if edge.nodes[0] != edge.nodes[1] and crowded[edge.nodes[0]] and crowded[edge.nodes[1]]
    }
    short = {
        n for n, length in lengths.items() if length <= 1 + graph.radii[list(graph.edges[n].nodes)].sum()
    }
    pairs = {
        pair
        for ends in graph.at
        for pair in itertools.combinations(sorted(short.intersection(number for number, _ in ends)), 2)
    }
    chosen = [*((number,) for number in lengths), *pairs]
    return sorted(chosen, key=lambda each: (len(each), sum(lengths[number] for number in each), each))


def _are_overlaps(
    graph: Graph, numbers: tuple[int, ...], nodes: set[int], arms: list[list[Arm]], costs: list[float]
) -> bool:
    """Return whether the lines that meet at edges bend less, and end less often, without these.

    Together they must cover them, and other edges that ``contracted`` leaves out with them.

    Args:
        graph: A skeleton.
        numbers: Of the edges.
        nodes: Where they begin and end.
        arms: Of each node, in the order of its ends.
        costs: Of joining the arms of each node.
    """
    together = [
        arm
        for node in sorted(nodes)
        for arm, end in zip(arms[node], graph.at[node], strict=True)
        if end[0] not in numbers
    ]
    pairs, cost = joined_arms(together, [0] * len(together))
    if cost + END > sum(costs[node] for node in sorted(nodes)):
        return False
    place = graph.places[sorted(nodes)].mean(axis=0)
    radius = max(float(graph.radii[node] + hypot(*(graph.places[node] - place))) for node in nodes)
    inner = {
        number
        for node in nodes
        for number, _ in graph.at[node]
        if nodes.issuperset(graph.edges[number].nodes)
    }
    gone = [n for n in sorted(inner) if (hypot(*(graph.edges[n].points - place).T) <= radius).all()]
    return all(_are_covering(together, pairs, graph.edges[n]) for n in {*gone, *numbers})


def with_corners(graph: Graph) -> Graph:
    """Return a skeleton in which lines that meet at an acute angle do so where their ink ends.

    On the way there they are one edge, past whose tip both lead, if they go straight on, within their ink.
    """
    edges, places, gone = list(graph.edges), graph.places.copy(), set[int]()
    for node, ends in enumerate(graph.at):
        tips = {end: graph.edge_from(end).nodes[1] for end in ends if len(ends) == 3}
        stems = [
            (_missed(graph, node, end, tip), end) for end, tip in tips.items() if len(graph.at[tip]) == 1
        ]
        away, stem = min(stems, default=(math.inf, (0, 0)))
        radius = float(graph.radii[node])
        if away <= radius + 1:
            gone.add(stem[0])
            places[node] = graph.places[tips[stem]]
            for number, begin in tips.keys() - {stem}:
                edges[number] = _led_to(edges[number], begin, places[node], radius)
    kept = [edge for number, edge in enumerate(edges) if number not in gone]
    return Graph(kept, places, graph.radii)


def _missed(graph: Graph, node: int, stem: End, tip: int) -> float:
    """Return how far past the tip of an edge lines lead that come from both sides of it, the farther of both.

    Infinite if they go on in one another.
    """
    arms = [_arm(graph, end, node) for end in graph.at[node] if end != stem]
    if bending(*arms) < 2 * END:
        return math.inf
    ways = [(graph.places[tip] - arm.place, arm.direction) for arm in arms]
    return max(abs(float(way[0] * ahead[1] - way[1] * ahead[0])) for way, ahead in ways)


def _led_to(edge: Edge, end: int, tip: Floats, radius: float) -> Edge:
    """Return an edge that ends at a tip instead, to which it goes straight from a radius before its end."""
    points, radii = edge.points[:: 1 - 2 * end], edge.radii[:: 1 - 2 * end]
    low = min(int(np.searchsorted(arc_lengths(points), radius)), len(points) - 1)
    points, radii = np.concatenate([tip[None], points[low:]]), np.concatenate([radii[:1], radii[low:]])
    return Edge(points[:: 1 - 2 * end], radii[:: 1 - 2 * end], edge.nodes)


def _are_covering(arms: list[Arm], pairs: Pairs, edge: Edge) -> bool:
    """Return whether the lines that join ``pairs`` of arms cover an edge with their ink at all its points."""
    away = np.full(len(edge.points), np.inf)
    for i, j in pairs:
        start, way = arms[i].place, arms[j].place - arms[i].place
        along = ((edge.points - start) * way).sum(axis=1)
        share = np.clip(along / max(float((way * way).sum()), 1e-9), 0, 1)
        away = np.minimum(away, hypot(*(edge.points - start - share[:, None] * way).T))
    return bool((away <= edge.half_width + 1).all())
