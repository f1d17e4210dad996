"""The skeleton of ink as a graph: nodes where lines end or meet, edges of pixels between them."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import cached_property

import cv2
import numpy as np

from warpsplat.drawing.trace.grids import Bools, Floats, depth, joined
from warpsplat.portable.elementary import hypot

End = tuple[int, int]
"""An edge's number, and 0 where it begins or 1 where it ends."""


@dataclass
class Edge:
    """Pixels between two nodes."""

    points: Floats
    """Places [px of the skeleton], with the nodes', shape (point, 2); in a ring the last is the first."""
    radii: Floats
    """Half the width of the ink at each [px of the skeleton], shape (point,)."""
    nodes: tuple[int, int]
    """Where it begins and ends; a ring has a node of its own, and so has a lone pixel."""

    @cached_property
    def half_width(self) -> float:
        """Half the width of the ink along most of it [px of the skeleton]."""
        return float(np.median(self.radii))

    def length(self) -> float:
        """Return the length in pixels of the skeleton."""
        return float(hypot(*np.diff(self.points, axis=0).T).sum())


@dataclass
class Graph:
    """Edges and the places of their nodes."""

    edges: list[Edge]
    places: Floats
    """Shape (node, 2)."""
    radii: Floats
    """Half the width of the ink at each node [px of the skeleton], shape (node,)."""
    at: list[list[End]] = field(init=False)
    """The ends of edges at each node."""

    def __post_init__(self) -> None:
        self.at = [[] for _ in self.places]
        for number, edge in enumerate(self.edges):
            for end, node in enumerate(edge.nodes):
                self.at[node].append((number, end))

    def edge_from(self, end: End) -> Edge:
        """Return an edge that begins at an end of its."""
        edge = self.edges[end[0]]
        return Edge(edge.points[::-1], edge.radii[::-1], edge.nodes[::-1]) if end[1] else edge


def find_graph(mask: Bools) -> Graph:
    """Return the skeleton of ``mask`` without burrs."""
    inside = np.pad(mask.astype(np.uint8), 1)
    radii = np.maximum(depth(mask) - 0.5, 0.5)
    thin = cv2.ximgproc.thinning(255 * inside, thinningType=cv2.ximgproc.THINNING_GUOHALL)[1:-1, 1:-1] > 0
    graph = _of_pixels(thin, radii)
    crowded = [len(ends) > 2 for ends in graph.at]
    inner = [
        number for number, edge in enumerate(graph.edges) if crowded[edge.nodes[0]] and crowded[edge.nodes[1]]
    ]
    return _without_burrs(contracted(graph, inner))


def _of_pixels(thin: Bools, radii: Floats) -> Graph:
    """Return the graph whose nodes are the pixels of a skeleton, and whose edges lead to their neighbours.

    A diagonal neighbour counts only where no straight step leads to a neighbour of both.
    """
    padded = np.pad(thin, 1)
    number = np.full(padded.shape, -1, np.int64)
    number[padded] = np.arange(padded.sum())
    rows, columns = np.nonzero(padded)
    pairs = []
    for down, across in ((0, 1), (1, 0), (1, 1), (1, -1)):
        linked = padded[rows + down, columns + across]
        if down and across:
            linked &= ~(padded[rows + down, columns] | padded[rows, columns + across])
        pairs.append(np.stack([number[rows, columns], number[rows + down, columns + across]], axis=1)[linked])
    lone = np.setdiff1d(number[padded], np.concatenate(pairs))
    links = np.concatenate([*pairs, np.stack([lone, lone], axis=1)])
    places, half = np.stack([columns, rows], axis=1) - 0.5, radii[thin]
    ends = zip(places[links], half[links], links.tolist(), strict=True)
    return Graph([Edge(points, widths, (a, b)) for points, widths, (a, b) in ends], places, half)


def _without_burrs(graph: Graph) -> Graph:
    """Return the graph without free ends that hardly reach beyond the ink they begin in; lone lines stay."""
    while True:
        free = [len(ends) == 1 for ends in graph.at]
        kept = []
        for edge in graph.edges:
            tip, root = edge.nodes if free[edge.nodes[0]] else edge.nodes[::-1]
            reach = edge.length() + graph.radii[tip]
            # A blunt end's corner is farther from its middle than its side.
            if not free[tip] or free[root] or reach > math.sqrt(2) * graph.radii[root] + 1:
                kept.append(edge)
        if len(kept) == len(graph.edges):
            return graph
        held = {node for edge in kept for node in edge.nodes}
        # Where only burrs meet there is a dot: the longest of them is kept.
        for node, ends in enumerate(graph.at):
            if len(ends) > 1 and node not in held:
                kept.append(max((graph.edges[n] for n, _ in ends), key=Edge.length))
        graph = _joined(Graph(kept, graph.places, graph.radii))


def contracted(graph: Graph, numbers: Iterable[int]) -> Graph:
    """Return the graph with each of some edges as one node with its ends."""
    gone = set(numbers)
    ends = np.array([graph.edges[number].nodes for number in gone], np.intp).reshape(-1, 2)
    names = joined(len(graph.places), *ends.T)
    sizes = np.bincount(names)
    places = np.stack([np.bincount(names, graph.places[:, axis]) / sizes for axis in (0, 1)], axis=1)
    radii = np.zeros(len(places))
    np.maximum.at(radii, names, graph.radii + hypot(*(graph.places - places[names]).T))
    edges = []
    for number, edge in enumerate(graph.edges):
        a, b = (int(names[node]) for node in edge.nodes)
        is_loop = a == b and edge.nodes[0] != edge.nodes[1]
        if number in gone or (is_loop and (hypot(*(edge.points - places[a]).T) <= radii[a]).all()):
            continue
        points = edge.points.copy()
        points[0], points[-1] = places[a], places[b]
        edges.append(Edge(points, edge.radii, (a, b)))
    bare = {int(names[graph.edges[n].nodes[0]]) for n in gone} - {
        node for edge in edges for node in edge.nodes
    }
    edges += [Edge(places[[node] * 2], radii[[node] * 2], (node, node)) for node in sorted(bare)]
    return _joined(Graph(edges, places, radii))


def _joined(graph: Graph) -> Graph:
    """Make one edge of two that meet at a node where no other does."""
    following: dict[End, End] = {}
    for ends in graph.at:
        if len(ends) == 2 and ends[0][0] != ends[1][0]:
            following |= {ends[0]: ends[1], ends[1]: ends[0]}
    edges = []
    for run, _ in runs_of(len(graph.edges), following):
        parts = [graph.edge_from(end) for end in run]
        points = np.concatenate([parts[0].points[:1], *(part.points[1:] for part in parts)])
        radii = np.concatenate([parts[0].radii[:1], *(part.radii[1:] for part in parts)])
        edges.append(Edge(points, radii, (parts[0].nodes[0], parts[-1].nodes[1])))
    return Graph(edges, graph.places, graph.radii)


def runs_of(count: int, following: dict[End, End]) -> list[tuple[list[End], bool]]:
    """Return the ends from which edges go on into one another, and whether the last goes on as the first.

    Args:
        count: Of the edges.
        following: The end at which each end goes on, if it does.
    """
    starts = [(n, end) for n in range(count) for end in (0, 1) if (n, end) not in following]
    seen = [False] * count
    runs = []
    for first in (*starts, *((n, 0) for n in range(count))):
        run: list[End] = []
        here: End | None = first
        while here is not None and not seen[here[0]]:
            seen[here[0]] = True
            run.append(here)
            here = following.get((here[0], 1 - here[1]))
        if run:
            runs.append((run, here == first))
    return runs
