"""Edges of a skeleton in which two lines overlap: a slanted crossing has two forks."""

from __future__ import annotations

import numpy as np

from warpsplat.drawing.strokes.chains import END, Arm, Pairs, arm_of, ends_at, joined_arms
from warpsplat.drawing.strokes.skeleton import Edge, Graph, contracted
from warpsplat.drawing.trace.grids import Floats
from warpsplat.portable.elementary import hypot


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
