"""The skeleton of ink as a graph: nodes where lines end or meet, edges of pixels between them."""

from __future__ import annotations

import itertools
from dataclasses import dataclass, field, replace

import cv2
import numpy as np

from warpsplat.drawing.trace.grids import Bools, Floats, Ints, Sets, at_pixels, depth
from warpsplat.portable.elementary import hypot

SPUR = 1.5  # how far the ink of a burr reaches, over half the width where it begins, and a pixel


@dataclass
class Edge:
    """Pixels between two nodes."""

    points: Floats
    """Places [px of the skeleton], with the nodes', shape (point, 2); in a ring the last is the first."""
    nodes: tuple[int, int]
    """Where it begins and ends; a ring has a node of its own."""
    half_width: float
    """Half the width of the ink along most of it [px of the skeleton]."""

    def length(self) -> float:
        """Return the length in pixels of the skeleton."""
        return float(hypot(*np.diff(self.points, axis=0).T).sum())

    def backwards(self) -> Edge:
        """Return the same edge from its end."""
        return replace(self, points=self.points[::-1], nodes=self.nodes[::-1])


@dataclass
class Graph:
    """Edges and the places of their nodes."""

    edges: list[Edge]
    places: Floats
    """Shape (node, 2)."""
    radii: Floats
    """Half the width of the ink at each node [px of the skeleton], shape (node,)."""
    at: list[list[int]] = field(init=False)
    """Edges at each node; those that begin and end there are named twice."""

    def __post_init__(self) -> None:
        self.at = [[] for _ in self.places]
        for number, edge in enumerate(self.edges):
            for node in edge.nodes:
                self.at[node].append(number)


def find_graph(mask: Bools) -> Graph:
    """Return the skeleton of ``mask`` without burrs."""
    inside = np.pad(mask.astype(np.uint8), 1)
    radii = np.maximum(depth(mask) - 0.5, 0.5)
    thin = cv2.ximgproc.thinning(255 * inside, thinningType=cv2.ximgproc.THINNING_GUOHALL)[1:-1, 1:-1] > 0
    return _without_burrs(_graph(thin, radii))


def _neighbours(thin: Bools) -> tuple[Ints, list[list[int]]]:
    """Return the pixels of a skeleton (row, column), and the numbers of the neighbours of each.

    A diagonal neighbour counts only where no straight step leads to a neighbour of both.
    """
    # The straight steps first.
    steps = sorted(itertools.product((-1, 0, 1), repeat=2), key=lambda step: abs(step[0]) + abs(step[1]))[1:]
    padded = np.pad(thin, 1)
    number = np.full(padded.shape, -1, np.int64)
    pixels = np.argwhere(padded)
    number[padded] = np.arange(len(pixels))
    rows, columns = pixels.T
    found = np.stack([number[rows + down, columns + across] for down, across in steps], axis=1)
    for slot, (down, across) in enumerate(steps[4:], 4):
        found[padded[rows + down, columns] | padded[rows, columns + across], slot] = -1
    return pixels - 1, [[n for n in row if n >= 0] for row in found.tolist()]


def _graph(thin: Bools, radii: Floats) -> Graph:
    """Return the graph of a skeleton that is one pixel wide."""
    pixels, near = _neighbours(thin)
    degrees = [len(row) for row in near]
    sets = Sets(len(pixels))
    for i, row in enumerate(near):
        for j in row:
            if degrees[i] > 2 and degrees[j] > 2:
                sets.join(i, j)
    names: dict[int, int] = {}
    node_of = [
        -1 if degree == 2 else names.setdefault(sets.find(i), len(names)) for i, degree in enumerate(degrees)
    ]
    places = pixels[:, ::-1] + 0.5
    members = [i for i, node in enumerate(node_of) if node >= 0]
    owners = np.array([node_of[i] for i in members], np.int64)
    half = radii[pixels[:, 0], pixels[:, 1]]
    centers, width = _merged(places[members], half[members], owners, len(names))
    walks, rings = _walks(near, node_of, members)
    chains = [
        (np.concatenate([centers[a : a + 1], places[path], centers[b : b + 1]]), (a, b))
        for path, a, b in walks
    ]
    own = [ring[0] for ring in rings]
    chains += [(places[[*ring, ring[0]]], (len(names) + i,) * 2) for i, ring in enumerate(rings)]
    lone = sorted(set(range(len(names))) - {node for _, nodes in chains for node in nodes})
    chains += [(np.repeat(centers[node : node + 1], 2, axis=0), (node, node)) for node in lone]
    edges = [Edge(points, nodes, float(np.median(at_pixels(radii, points)))) for points, nodes in chains]
    return Graph(edges, np.concatenate([centers, places[own]]), np.concatenate([width, half[own]]))


def _merged(places: Floats, radii: Floats, owners: Ints, count: int) -> tuple[Floats, Floats]:
    """Return the mean place and the largest radius of each of ``count`` nodes, from its pixels."""
    sizes = np.maximum(np.bincount(owners, minlength=count), 1)
    means = np.stack([np.bincount(owners, places[:, axis], count) / sizes for axis in (0, 1)], axis=1)
    largest = np.zeros(count)
    np.maximum.at(largest, owners, radii)
    return means, largest


def _walks(
    near: list[list[int]], node_of: list[int], members: list[int]
) -> tuple[list[tuple[list[int], int, int]], list[list[int]]]:
    """Return the paths of pixels from node to node, with these, and the rings without a node.

    ``near``: neighbours of each pixel; ``node_of``: its node or -1; ``members``: the pixels of nodes.
    """
    seen = [node >= 0 for node in node_of]

    def walk(before: int, here: int) -> tuple[list[int], int]:
        """Return the pixels from ``here`` up to a node or to one seen, away from ``before``; and that one."""
        path = []
        while not seen[here]:
            seen[here] = True
            path.append(here)
            before, here = here, next(n for n in near[here] if n != before)
        return path, here

    walks: list[tuple[list[int], int, int]] = []
    for start in members:
        for first in near[start]:
            if node_of[first] < 0 and not seen[first]:
                path, last = walk(start, first)
                walks.append((path, node_of[start], node_of[last]))
            elif node_of[first] >= 0 and node_of[first] != node_of[start] and first > start:
                walks.append(([], node_of[start], node_of[first]))
    rings = []
    for start in range(len(near)):
        if not seen[start]:
            seen[start] = True
            rings.append([start, *walk(start, near[start][0])[0]])
    return walks, rings


def _without_burrs(graph: Graph) -> Graph:
    """Return the graph without free ends that hardly reach beyond the ink they begin in; lone lines stay."""
    while True:
        free = [len(edges) == 1 for edges in graph.at]

        def is_burr(edge: Edge, free: list[bool] = free, radii: Floats = graph.radii) -> bool:
            a, b = edge.nodes
            if a == b or free[a] == free[b]:
                return False
            tip, root = (float(radii[node]) for node in ((a, b) if free[a] else (b, a)))
            return edge.length() + tip <= SPUR * root + 1

        kept = [edge for edge in graph.edges if not is_burr(edge)]
        if len(kept) == len(graph.edges):
            return graph
        held = {node for edge in kept for node in edge.nodes}
        # Where only burrs meet there is a dot: the longest of them is kept.
        for node, numbers in enumerate(graph.at):
            if len(numbers) > 1 and node not in held:
                kept.append(max((graph.edges[n] for n in numbers), key=Edge.length))
        graph = with_joined_edges(Graph(kept, graph.places, graph.radii))


def contracted(graph: Graph, overlaps: list[int]) -> Graph:
    """Return the graph with each of some edges, in which lines overlap, as one node with its ends."""
    sets = Sets(len(graph.places))
    for number in overlaps:
        sets.join(*graph.edges[number].nodes)
    names = sets.numbers()
    places, _ = _merged(graph.places, graph.radii, names, int(names.max(initial=-1)) + 1)
    radii = np.zeros(len(places))
    np.maximum.at(radii, names, graph.radii + hypot(*(graph.places - places[names]).T))
    edges = []
    for number in sorted(set(range(len(graph.edges))) - set(overlaps)):
        edge = graph.edges[number]
        a, b = (int(names[node]) for node in edge.nodes)
        points = edge.points
        if edge.nodes[0] != edge.nodes[1]:
            if a == b and (hypot(*(points - places[a]).T) <= radii[a]).all():
                continue
            points = np.concatenate([places[a : a + 1], points[1:-1], places[b : b + 1]])
        edges.append(replace(edge, points=points, nodes=(a, b)))
    return with_joined_edges(Graph(edges, places, radii))


def with_joined_edges(graph: Graph) -> Graph:
    """Make one edge of two that meet at a node where no other does."""
    at = [list(edges) for edges in graph.at]
    edges: list[Edge | None] = list(graph.edges)
    for node, numbers in enumerate(at):
        if len(numbers) != 2 or numbers[0] == numbers[1]:
            continue
        one, other = edges[numbers[0]], edges[numbers[1]]
        assert one is not None and other is not None
        one = one if one.nodes[1] == node else one.backwards()
        other = other if other.nodes[0] == node else other.backwards()
        longer = max(one, other, key=Edge.length)
        both = replace(
            longer,
            points=np.concatenate([one.points, other.points[1:]]),
            nodes=(one.nodes[0], other.nodes[1]),
        )
        edges[numbers[0]], edges[numbers[1]] = both, None
        far = at[other.nodes[1]]
        far[far.index(numbers[1])] = numbers[0]
        numbers.clear()
    return Graph([edge for edge in edges if edge is not None], graph.places, graph.radii)
