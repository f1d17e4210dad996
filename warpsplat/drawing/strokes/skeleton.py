"""The skeleton of ink as a graph: nodes where lines end or meet, edges of pixels between them."""

from __future__ import annotations

from dataclasses import dataclass, field

import cv2
import numpy as np

from warpsplat.drawing.trace.grids import Bools, Floats, Ints, Sets
from warpsplat.portable.elementary import hypot
from warpsplat.portable.filters import distance

STEPS = ((0, 1), (1, 0), (0, -1), (-1, 0), (1, 1), (1, -1), (-1, -1), (-1, 1))
"""Rows and columns to the neighbours of a pixel, the straight ones first."""

SPUR = 1.5
"""Length of a free end up to which it is a burr of the outline, over half the width where it begins."""

NEAR = 1.6
"""Length of an edge up to which its two nodes are one, over half the width there."""


@dataclass
class Edge:
    """Pixels between two nodes."""

    points: Floats
    """Places [px of the skeleton], the nodes' included, shape (point, 2); of a ring the last is the first."""
    nodes: tuple[int, int]
    """Where it begins and ends; a ring has a node of its own."""

    def length(self) -> float:
        """In pixels of the skeleton."""
        return float(hypot(*np.diff(self.points, axis=0).T).sum())

    def backwards(self) -> Edge:
        """The same, from its end."""
        return Edge(self.points[::-1], self.nodes[::-1])


@dataclass
class Graph:
    """Edges and the places of their nodes."""

    edges: list[Edge]
    places: Floats
    """Shape (node, 2)."""
    radii: Floats
    """Half the width of the ink at each node [px of the skeleton], shape (node,)."""
    at: list[list[int]] = field(default_factory=list)
    """Edges at each node; those that begin and end there are named twice."""

    def __post_init__(self) -> None:
        self.at = [[] for _ in self.places]
        for number, edge in enumerate(self.edges):
            for node in edge.nodes:
                self.at[node].append(number)


def find_graph(mask: Bools) -> tuple[Graph, Floats]:
    """The skeleton of ``mask`` without burrs, and half the width of the ink at each pixel."""
    inside = cv2.copyMakeBorder(mask.astype(np.uint8), 1, 1, 1, 1, cv2.BORDER_CONSTANT, value=0)
    radii = np.maximum(distance(inside)[1:-1, 1:-1] - 0.5, 0.5)
    thin = cv2.ximgproc.thinning(255 * inside, thinningType=cv2.ximgproc.THINNING_GUOHALL)[1:-1, 1:-1] > 0
    graph = _traced(thin, radii)
    for _ in range(3):
        before = len(graph.edges)
        graph = _joined(_near_together(_without_burrs(graph)))
        if len(graph.edges) == before:
            break
    return graph, radii


def _neighbours(thin: Bools) -> tuple[Ints, Ints]:
    """Pixels (row, column) and the numbers of the neighbours of each, -1 for none, shape (pixel, 8).

    A diagonal step counts only where no two straight ones lead to the same pixel.
    """
    padded = np.pad(thin, 1)
    number = np.full(padded.shape, -1, np.int64)
    pixels = np.argwhere(padded)
    number[padded] = np.arange(len(pixels))
    rows, columns = pixels.T
    found = np.stack([number[rows + down, columns + across] for down, across in STEPS], axis=1)
    for slot, (down, across) in enumerate(STEPS[4:], 4):
        beside = padded[rows + down, columns] | padded[rows, columns + across]
        found[beside, slot] = -1
    return pixels - 1, found


def _traced(thin: Bools, radii: Floats) -> Graph:
    """The graph of a skeleton, one pixel wide."""
    pixels, table = _neighbours(thin)
    degrees = (table >= 0).sum(axis=1)
    near: list[list[int]] = [[n for n in row if n >= 0] for row in table.tolist()]
    sets = Sets(len(pixels))
    for i in np.flatnonzero(degrees > 2).tolist():
        for j in near[i]:
            if degrees[j] > 2:
                sets.join(i, j)
    names: dict[int, int] = {}
    node_of = [-1] * len(pixels)
    for i in np.flatnonzero(degrees != 2).tolist():
        node_of[i] = names.setdefault(sets.find(i), len(names))
    places = pixels[:, ::-1] + 0.5
    members = [i for i, node in enumerate(node_of) if node >= 0]
    owners = np.array([node_of[i] for i in members], np.int64)
    count = np.maximum(np.bincount(owners, minlength=len(names)), 1)
    centers = np.stack(
        [np.bincount(owners, places[members, axis], len(names)) / count for axis in (0, 1)], axis=1
    )
    width = np.zeros(len(names))
    np.maximum.at(width, owners, radii[pixels[members, 0], pixels[members, 1]])
    walks, rings = _walks(near, node_of, members)
    edges = [
        Edge(
            np.concatenate([centers[a : a + 1], places[path], centers[b : b + 1]]),
            (a, b),
        )
        for path, a, b in walks
    ]
    own: list[int] = []
    for ring in rings:
        edges.append(Edge(places[[*ring, ring[0]]], (len(centers) + len(own),) * 2))
        own.append(ring[0])
    lone = sorted(set(range(len(names))) - {node for edge in edges for node in edge.nodes})
    edges += [Edge(np.repeat(centers[node : node + 1], 2, axis=0), (node, node)) for node in lone]
    alone = radii[pixels[own, 0], pixels[own, 1]] if own else np.zeros(0)
    return Graph(edges, np.concatenate([centers, places[own]]), np.concatenate([width, alone]))


def _walks(
    near: list[list[int]], node_of: list[int], members: list[int]
) -> tuple[list[tuple[list[int], int, int]], list[list[int]]]:
    """Paths of pixels from node to node, and rings without one."""
    seen = [node >= 0 for node in node_of]
    walks: list[tuple[list[int], int, int]] = []
    for start in members:
        for first in near[start]:
            if node_of[first] >= 0:
                if node_of[first] != node_of[start] and first > start:
                    walks.append(([], node_of[start], node_of[first]))
                continue
            if seen[first]:
                continue
            path, before, here = [], start, first
            while node_of[here] < 0:
                seen[here] = True
                path.append(here)
                before, here = here, next(n for n in near[here] if n != before)
            walks.append((path, node_of[start], node_of[here]))
    rings = []
    for start in range(len(near)):
        if seen[start]:
            continue
        ring, before, here = [start], start, near[start][0]
        seen[start] = True
        while here != start:
            seen[here] = True
            ring.append(here)
            before, here = here, next(n for n in near[here] if n != before)
        rings.append(ring)
    return walks, rings


def _without_burrs(graph: Graph) -> Graph:
    """Without free ends that are no longer than the line is wide; a line that is nothing else stays."""
    free = [len(edges) == 1 for edges in graph.at]

    def is_burr(edge: Edge) -> bool:
        a, b = edge.nodes
        if a == b or free[a] == free[b]:
            return False
        return edge.length() <= SPUR * max(float(graph.radii[b if free[a] else a]), 1.0)

    kept = [edge for edge in graph.edges if not is_burr(edge)]
    held = {node for edge in kept for node in edge.nodes}
    # Where all that meets is burrs there is a dot: the longest of them is kept.
    for node, numbers in enumerate(graph.at):
        if len(numbers) > 1 and node not in held:
            kept.append(max((graph.edges[n] for n in numbers), key=Edge.length))
    return Graph(kept, graph.places, graph.radii)


def _near_together(graph: Graph) -> Graph:
    """Nodes that the width of the lines has drawn apart are one: crossings have four arms."""
    sets = Sets(len(graph.places))
    meets = [len(edges) > 2 for edges in graph.at]

    def is_short(edge: Edge) -> bool:
        a, b = edge.nodes
        reach = NEAR * float(max(graph.radii[a], graph.radii[b]))
        return a != b and meets[a] and meets[b] and edge.length() <= max(reach, 1.5)

    short = [is_short(edge) for edge in graph.edges]
    for edge, gone in zip(graph.edges, short, strict=True):
        if gone:
            sets.join(*edge.nodes)
    names = sets.numbers()
    count = np.bincount(names)
    places = np.stack([np.bincount(names, graph.places[:, axis]) / count for axis in (0, 1)], axis=1)
    radii = np.zeros(len(count))
    np.maximum.at(radii, names, graph.radii)
    edges = []
    for edge, gone in zip(graph.edges, short, strict=True):
        a, b = (int(names[node]) for node in edge.nodes)
        if not gone and not (a == b and edge.nodes[0] != edge.nodes[1] and edge.length() < 4 * radii[a]):
            points = edge.points.copy()
            points[0], points[-1] = (places[a], places[b]) if a != b else (points[0], points[-1])
            edges.append(Edge(points, (a, b)))
    return Graph(edges, places, radii)


def _joined(graph: Graph) -> Graph:
    """Edges that alone meet at a node are one."""
    at = [list(edges) for edges in graph.at]
    edges: list[Edge | None] = list(graph.edges)
    for node, numbers in enumerate(at):
        if len(numbers) != 2 or numbers[0] == numbers[1]:
            continue
        one, other = edges[numbers[0]], edges[numbers[1]]
        assert one is not None and other is not None
        one = one if one.nodes[1] == node else one.backwards()
        other = other if other.nodes[0] == node else other.backwards()
        both = Edge(np.concatenate([one.points, other.points[1:]]), (one.nodes[0], other.nodes[1]))
        edges[numbers[0]], edges[numbers[1]] = both, None
        far = at[other.nodes[1]]
        far[far.index(numbers[1])] = numbers[0]
        numbers.clear()
    return Graph([edge for edge in edges if edge is not None], graph.places, graph.radii)
