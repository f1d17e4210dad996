"""Regions as shapes that lie on one another.

Each boundary is drawn by the upper one of its two regions; the lower one goes on under it,
by the shortest path.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from warpsplat.drawing.trace.grids import NO_REGION, Bools, Floats, Ints
from warpsplat.drawing.trace.hidden import Cover, hidden_path
from warpsplat.drawing.trace.outlines import Boundary
from warpsplat.drawing.trace.planar import STEPS, Loops
from warpsplat.drawing.trace.spans import Polyline
from warpsplat.portable.elementary import hypot
from warpsplat.scene.scene import ranges, starts_of

SEEN, EDGE, HIDDEN = range(3)
"""The side across a crack: a lower region, the outside of the image, a higher region."""

UNDER = 1.0  # [cell] how far an outline goes on under the region above it before it turns
TAIL = 3  # points at the end of a stretch that tell its direction there
Outline = list[Polyline | Floats]
"""A contour before its curves are fitted: runs, and corners (point, 2) between one run and the next."""


@dataclass(frozen=True)
class Layers:
    """Regions in the order of painting, and the boundaries between them."""

    loops: Loops
    boundary: Boundary
    ranks: Ints
    """Rank of each region in the order of painting, shape (region,)."""
    hiding: Ints
    """The same, -1 for regions under which nothing may lie, shape (region,)."""
    cover: Cover
    holed: Bools
    """Regions that are or contain something transparent, or lie in a hole with it, shape (region,)."""
    has_holes: bool
    """Whether a path under the cover may meet something transparent."""


@dataclass(frozen=True)
class Stretches:
    """Cracks in a row with the same kind of side across; those of a loop follow one another."""

    layers: Layers
    loop: Ints
    """The loop that each is a part of, shape (stretch,)."""
    kind: Ints
    """The side across, shape (stretch,)."""
    whole: Bools
    """Whether it is all of its loop, shape (stretch,)."""
    first: Ints
    """First of the ``cracks`` of each and, last, their number, shape (stretch + 1,)."""
    cracks: Ints
    """Numbers of cracks, shape (crack,)."""

    @cached_property
    def rank(self) -> Ints:
        """The rank of the region of each, shape (stretch,)."""
        return self.layers.ranks[self.layers.loops.region[self.loop]]

    @cached_property
    def owner(self) -> Ints:
        """The stretch that each crack is in, shape (crack,)."""
        return np.repeat(np.arange(len(self.loop)), np.diff(self.first))

    @cached_property
    def turns(self) -> Bools:
        """Whether a crack has another direction than that before it, around whole loops; shape (crack,)."""
        directions = self.layers.loops.directions[self.cracks]
        before = np.arange(len(directions)) - 1
        before[self.first[:-1]] = np.where(self.whole, self.first[1:], self.first[:-1] + 1) - 1
        return np.asarray(directions != directions[before])

    @cached_property
    def is_exact(self) -> Bools:
        """Whether a stretch lies where the pixels meet, and has few corners, shape (stretch,)."""
        begin, off = self.first[:-1], np.abs(self.layers.boundary.offsets[self.cracks])
        turns = np.add.reduceat(self.turns.astype(np.intp), begin) - self.turns[begin]
        return (np.maximum.reduceat(off, begin) == 0) & (turns <= 4 + np.diff(self.first) / 40)

    @cached_property
    def middles(self) -> Floats:
        """Points halfway through what hides a region beyond each crack, shape (crack, 2); known if hidden."""
        loops, hidden = self.layers.loops, np.flatnonzero(self.kind[self.owner] == HIDDEN)
        cracks = self.cracks[hidden]
        steps, trends = STEPS[loops.directions[cracks]], self.layers.boundary.trends[cracks]
        middles = np.zeros((len(self.cracks), 2))
        ranks = self.rank[self.owner[hidden]]
        middles[hidden] = self.layers.cover.middles(ranks, loops.vertices[cracks], steps, trends)
        return middles

    @cached_property
    def points(self) -> tuple[Floats, Ints]:
        """The good points; the first of each stretch and, last, their number.

        Of a hidden stretch, those between the boundary and the middles.
        """
        places = self.layers.boundary.points[self.cracks]
        hidden = (self.kind == HIDDEN)[self.owner, None]
        places = np.where(hidden, 0.5 * (places + self.middles), places)
        good = self.layers.boundary.is_good[self.cracks]
        counts = np.add.reduceat(good.astype(np.intp), self.first[:-1])
        keep = good | (counts == 0)[self.owner]
        return places[keep], np.searchsorted(np.flatnonzero(keep), self.first)

    @cached_property
    def vertices(self) -> list[Floats]:
        """The vertices where the cracks of each stretch turn."""
        vertices = self.layers.loops.vertices[self.cracks][self.turns].astype(np.float64)
        bounds = np.searchsorted(np.flatnonzero(self.turns), self.first).tolist()
        return [vertices[low:high] for low, high in itertools.pairwise(bounds)]

    @cached_property
    def neighbours(self) -> tuple[Ints, Ints]:
        """The stretches before and after each one, around its loop."""
        number = np.arange(len(self.loop))
        is_first = np.append(True, np.diff(self.loop) != 0)[: len(number)]
        is_last = np.append(is_first[1:], True)[: len(number)]
        before, after = number - 1, number + 1
        before[is_first], after[is_last] = number[is_last], number[is_first]
        return before, after


def find_stretches(layers: Layers) -> Stretches:
    """Cut the loops of what is painted into stretches; those that are hidden altogether are left out."""
    loops = layers.loops
    chosen = np.flatnonzero((loops.region >= 0) & (layers.ranks[loops.region] >= 0))
    counts = np.diff(loops.first)[chosen]
    cracks, owner = ranges(loops.first[chosen], counts), np.repeat(np.arange(len(chosen)), counts)
    others, ranks = loops.others[cracks], layers.ranks[loops.region[chosen]][owner]
    kinds = np.where(layers.hiding[others] > ranks, HIDDEN, SEEN)
    kinds[others == NO_REGION] = EDGE
    unseen = np.bincount(owner, kinds != HIDDEN, len(chosen)) == 0
    holed = np.bincount(owner, layers.holed[others], len(chosen)) > 0
    # What has no boundary that is seen is drawn all the same, if it is no hole. A hole of it is left open, a
    # little smaller than what lies over it, where that is transparent inside.
    kinds[(unseen & ~loops.is_hole[chosen])[owner]] = SEEN
    kept = ~(unseen & loops.is_hole[chosen] & ~holed)
    some = kept[owner]
    cracks, kinds, owner = cracks[some], kinds[some], np.repeat(np.arange(kept.sum()), counts[kept])
    loop, counts = chosen[kept], counts[kept]
    first, number = starts_of(counts)[:-1], ranges(np.zeros_like(counts), counts)
    before = first[owner] + (number - 1) % counts[owner]
    changes = np.flatnonzero(kinds != kinds[before])
    # Each loop begins where its kind changes first.
    begin = np.zeros(len(loop), np.intp)
    begin[owner[changes[::-1]]] = number[changes[::-1]]
    order = first[owner] + (number + begin[owner]) % counts[owner]
    cracks, kinds = cracks[order], kinds[order]
    starts = np.flatnonzero((number == 0) | (kinds != np.roll(kinds, 1)))
    whole = np.bincount(owner[starts], minlength=len(loop))[owner[starts]] == 1
    return Stretches(
        layers, loop[owner[starts]], kinds[starts], whole, np.append(starts, len(cracks)), cracks
    )


def find_outlines(layers: Layers) -> list[tuple[int, Outline]]:
    """Return the contours of all that is painted, with the region that each bounds."""
    stretches = find_stretches(layers)
    if not len(stretches.loop):
        return []
    starts, ends = _ends(stretches)
    paths = _hidden_paths(stretches, starts, ends)
    outlines: list[tuple[int, Outline]] = []
    regions = layers.loops.region[stretches.loop].tolist()
    is_first = np.append(True, np.diff(stretches.loop) != 0).tolist()
    for number, whole in enumerate(stretches.whole.tolist()):
        if is_first[number]:
            outlines.append((regions[number], []))
        if whole:
            part = _ring(stretches, number)
        elif stretches.kind[number] == HIDDEN:
            part = paths[number]
        else:
            part = _part(stretches, number, starts[number], ends[number])
        outlines[-1][1].append(part)
    return outlines


def _ring(stretches: Stretches, number: int) -> Polyline | Floats:
    """Return a loop that is all of one kind."""
    if stretches.is_exact[number] and stretches.kind[number] != HIDDEN:
        return stretches.vertices[number]
    points, first = stretches.points
    return Polyline(points[first[number] : first[number + 1]], closed=True)


def _part(stretches: Stretches, number: int, start: Floats, end: Floats) -> Polyline | Floats:
    """Return a part of a loop that is seen or at the edge of the image."""
    if stretches.is_exact[number]:
        corners = np.concatenate([start[None], stretches.vertices[number], end[None]])
        # Beside the edge, what is seen ends there.
        before, after = (stretches.kind[[number, beside[number]]] for beside in stretches.neighbours)
        return corners[int((before == (EDGE, SEEN)).all()) : -1 if (after == (EDGE, SEEN)).all() else None]
    points, first = stretches.points
    return Polyline(points[first[number] : first[number + 1]], False, start, end)


def _ends(stretches: Stretches) -> tuple[Floats, Floats]:
    """Return where stretches begin and end, (stretch, 2) each; those that are seen go on under others."""
    loops = stretches.layers.loops
    head, last = (stretches.cracks[index] for index in (stretches.first[:-1], stretches.first[1:] - 1))
    starts = loops.vertices[head].astype(np.float64)
    ends = (loops.vertices[last] + STEPS[loops.directions[last]]).astype(np.float64)
    seen = np.flatnonzero((stretches.kind == SEEN) & ~stretches.whole)
    points, first = stretches.points
    begin, end = first[seen], first[seen + 1] - 1
    ranks, inwards = stretches.rank[seen], np.minimum(end - begin, TAIL - 1)
    cover = stretches.layers.cover
    starts[seen] = _extended(cover, ranks, points[begin + inwards], points[begin], starts[seen])
    ends[seen] = _extended(cover, ranks, points[end - inwards], points[end], ends[seen])
    return starts, ends


def _extended(cover: Cover, ranks: Ints, inner: Floats, tips: Floats, vertices: Floats) -> Floats:
    """Return where stretches end that go from ``inner`` points to their last ones: under what lies above.

    Where nothing does, they end beside the ``vertices`` where their last cracks end.
    """
    way = tips - inner
    length = hypot(*way.T)[:, None]
    direction = way / np.maximum(length, 1e-9)
    ahead = ((vertices - tips) * direction).sum(axis=1, keepdims=True)
    reached = tips + np.maximum(ahead, 0.1) * direction
    reached = np.where(hypot(*(reached - vertices).T)[:, None] > 1, vertices, reached)
    hidden = cover.hides(ranks, reached + UNDER * direction)[:, None]
    # At the edge of the image all ends on it.
    size = np.array(cover.ranks.shape[::-1])
    room = np.where(direction > 0, size - reached, reached) / np.maximum(np.abs(direction), 1e-9)
    reached = reached + np.clip(room.min(axis=1, keepdims=True), -1, UNDER * hidden) * direction
    return np.where((length > 0) & (vertices > 0) & (vertices < size), reached, vertices)


def _hidden_paths(stretches: Stretches, starts: Floats, ends: Floats) -> dict[int, Floats]:
    """Return the corners of each hidden stretch, from the stretch before to the one after."""
    hidden = np.flatnonzero((stretches.kind == HIDDEN) & ~stretches.whole)
    if not len(hidden):
        return {}
    before, after = (beside[hidden] for beside in stretches.neighbours)
    begin, counts = stretches.first[hidden], np.diff(stretches.first)[hidden]
    index, first = ranges(begin, counts), starts_of(counts + 2)
    goals, vertices = np.empty((2, first[-1], 2))
    inner = ranges(first[:-1] + 1, counts)
    goals[first[:-1]], goals[inner], goals[first[1:] - 1] = (
        ends[before],
        stretches.middles[index],
        starts[after],
    )
    layers, last = stretches.layers, stretches.cracks[begin + counts - 1]
    vertices[inner - 1] = layers.loops.vertices[stretches.cracks[index]]
    vertices[first[1:] - 2] = vertices[first[1:] - 1] = layers.loops.vertices[last]
    ranks, bounds = stretches.rank[hidden].tolist(), zip(first[:-1].tolist(), first[1:].tolist(), strict=True)
    return {
        number: hidden_path(layers.cover, rank, layers.has_holes, goals[low:high], vertices[low:high])
        for number, rank, (low, high) in zip(hidden.tolist(), ranks, bounds, strict=True)
    }
