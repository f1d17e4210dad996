"""Fills whose contours cross neither themselves nor one another.

Where two pieces of a shape's contours cross, both are cut, and each goes on along the other: that makes rings
that meet but do not cross, and wind around every place as often as before (Seifert circles). Those with paint
on both sides, or on neither, are left out.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from warpsplat.portable import elementary
from warpsplat.scene.attributes import Basis, Kind, Rule
from warpsplat.scene.geometry import beziers
from warpsplat.scene.intersections import cross, flattened, intersections, parts
from warpsplat.scene.scene import Bools, FloatArray, Floats, IndexArray, Scene, ranges, starts_of

PIECES, SAMPLES = 8, 9
"""Lines that take the place of a cubic where areas are computed, and places where a ring is looked at."""

GROWN = 0.02
"""By how much shapes are grown while crossings are looked for [units]: edges that coincide then cross."""

Painted = Callable[[IndexArray], Bools]
"""Whether there is paint, by how often contours wind around a place."""

PAINTED: dict[Rule, Painted] = {
    Rule.NONZERO: lambda turns: turns != 0,
    Rule.EVENODD: lambda turns: turns % 2 == 1,
}


def simple(scene: Scene, per_pixel: float) -> Scene:
    """Return a scene whose fills look the same, but have contours that do not cross.

    Those of shapes that change are cubics, rounded to the grid of a file with ``per_pixel`` units to a pixel,
    as those of the scene should be. Shapes that are filled and stroked, and those of a form, stay.
    """
    least, made = least_area(per_pixel), {}
    for shape in free_fills(scene):
        rings = rings_of(scene, shape, per_pixel)
        changed = simple_rings(rings, PAINTED[Rule(scene.rule[shape])], least)
        if changed is not rings:
            made[shape] = changed
    return with_rings(scene, made, per_pixel) if made else scene


def free_fills(scene: Scene) -> list[int]:
    """Return the fills of cubics or splines that are not stroked as well."""
    free = (scene.kind == Kind.FILL) & (scene.basis <= Basis.SPLINE) & scene.are_alone()
    return np.flatnonzero(free).tolist()


def rings_of(scene: Scene, shape: int, per_pixel: float) -> list[Floats]:
    """Return the contours of a fill as cubics, shape (cubic, 4, 2), in a file's units."""
    basis = Basis(scene.basis[shape])
    found = []
    for points, _ in scene.contours_of(shape):
        ring = per_pixel * beziers(points[None], True, basis)[0].astype(np.float64)
        ring[:, ::3] = np.round(ring[:, ::3])  # exactly, as single precision is not
        found.append(ring)
    return found


def with_rings(scene: Scene, made: dict[int, list[Floats]], per_pixel: float) -> Scene:
    """Return a scene in which some shapes have other contours, as ``rings_of``; those without any go."""
    points: list[FloatArray] = []
    closed: list[bool] = []
    counts = []
    for shape in range(len(scene)):
        own = scene.contours_of(shape)
        if shape in made:
            rings = ((ring[:, :3].reshape(-1, 2) / per_pixel).astype(np.float32) for ring in made[shape])
            own = [(ring, True) for ring in rings]
        points += [contour for contour, _ in own]
        closed += [is_closed for _, is_closed in own]
        counts.append(len(own))
    starts = starts_of(np.array([len(contour) for contour in points], np.intp))
    basis = scene.basis.copy()
    basis[list(made)] = Basis.CUBIC
    left = np.flatnonzero(counts)
    return replace(
        scene.take(left),
        basis=basis[left],
        points=np.concatenate(points) if points else np.zeros((0, 2), np.float32),
        starts=starts,
        closed=np.array(closed, np.int32),
        first=starts[starts_of(np.array(counts, np.intp)[left])],
    )


def simple_rings(rings: list[Floats], painted: Painted, least: float) -> list[Floats]:
    """Return rings of cubics that do not cross and fill the same; the same list if these do not.

    New ends are whole numbers. Rings with an area below ``least`` are left out. Paint is to the right of
    a ring on a screen: outer ones run clockwise.

    Args:
        rings: Of one shape, each of shape (cubic, 4, 2), in units.
        painted: Where there is paint.
        least: Area [units²].
    """
    # Times that a shape is made simple and rounded: rounding may make contours cross again, by a hair.
    rounds = 8
    for _ in range(rounds):
        kept, new = uncrossed(_cut_at_nodes(rings))
        seen = large(kept, least)
        if not new and len(seen) == len(rings):
            break
        rings = [*seen, *bounding(large(new, least), painted, seen)]
    return rings


def merged(scene: Scene, shape: int, per_pixel: float) -> list[Floats]:
    """Return simple rings around the paint of a fill, as ``rings_of``; rings may share edges, too."""
    rings = _grown(rings_of(scene, shape, per_pixel))
    return joined(rings, PAINTED[Rule(scene.rule[shape])], least_area(per_pixel))


def least_area(per_pixel: float) -> float:
    """Return the area of rings that are left out because nobody sees them [units²]."""
    least = 0.1  # [px²]
    return least * per_pixel * per_pixel


def _grown(rings: list[Floats]) -> list[Floats]:
    """Return rings and, beside them, what is a little to their left, (cubic, 4, 4), as for ``uncrossed``."""
    grown = (moved_left(ring, GROWN * (1 + i * 0.618 % 1)) for i, ring in enumerate(rings))
    return [np.concatenate(both, axis=2) for both in zip(rings, grown, strict=True)]


def joined(rings: list[Floats], painted: Painted, least: float) -> list[Floats]:
    """Return simple rings that run around what is painted; ``rings``: (cubic, 4, 4), as for ``uncrossed``."""
    kept, new = uncrossed(rings)
    made = [ring[..., :2] for ring in bounding([*kept, *large(new, least)], painted)]
    return simple_rings(made, PAINTED[Rule.NONZERO], least)


def large(rings: list[Floats], least: float) -> list[Floats]:
    """Return the rings with an area of at least ``least`` [units²]."""
    if not rings:
        return rings
    lines = flattened(np.concatenate(rings)[..., :2], PIECES)
    twice = cross(lines[:, :-1], lines[:, 1:]).sum(axis=1)
    areas = 0.5 * np.bincount(np.repeat(np.arange(len(rings)), [len(ring) for ring in rings]), twice)
    return [ring for ring, found in zip(rings, areas, strict=True) if abs(found) >= least]


def uncrossed(rings: list[Floats]) -> tuple[list[Floats], list[Floats]]:
    """Return the rings without crossings and repeated nodes, and what becomes of the others.

    ``rings``: shape (cubic, 4, 2); or (cubic, 4, 4), where the last two are coordinates near the first two,
    by which is told what crosses.
    """
    if not rings:
        return [], []
    cubics, counts = np.concatenate(rings), np.array([len(ring) for ring in rings])
    first, owner = starts_of(counts), np.repeat(np.arange(len(rings)), counts)
    following = np.arange(1, len(cubics) + 1)
    following[first[1:] - 1] = first[:-1]
    pairs, places = intersections(cubics[..., -2:])
    crossed = np.isin(np.arange(len(rings)), owner[pairs])
    parted: list[Floats] = []
    if cubics.shape[2] == 2:
        # Rings may cross in their nodes as well, or along an edge: between these, where they are grown.
        may_cross = crossed | _meeting_twice(cubics, owner)
        suspects = [ring for ring, is_one in zip(rings, may_cross, strict=True) if is_one]
        others, made = uncrossed(_grown(suspects))
        if made or crossed.any():
            crossed, parted = may_cross, [ring[..., :2] for ring in (*others, *made)]
    touching = np.array([len(set(map(tuple, ring[:, 0, :2].tolist()))) < len(ring) for ring in rings])
    if not (crossed | touching).any():
        return rings, []
    new = [ring for ring, is_new in zip(rings, touching & ~crossed, strict=True) if is_new]
    new += _joined(cubics, following, owner, pairs, places) if cubics.shape[2] > 2 and len(pairs) else parted
    kept = [ring for ring, is_new in zip(rings, crossed | touching, strict=True) if not is_new]
    return kept, [part for ring in new for part in _apart(ring)]


def _meeting_twice(cubics: Floats, owner: IndexArray) -> Bools:
    """Return which rings have two nodes in common with another one, in which they may cross, (ring,)."""
    count = int(owner[-1]) + 1
    order = np.lexsort((owner, *cubics[:, 0].T))
    is_same = (cubics[order[1:], 0] == cubics[order[:-1], 0]).all(axis=1)
    pairs = owner[np.stack([order[:-1], order[1:]])[:, is_same]]
    pairs, times = np.unique(pairs[:, pairs[0] != pairs[1]], axis=1, return_counts=True)
    return np.isin(np.arange(count), pairs[:, times > 1])


def _joined(
    cubics: Floats, following: IndexArray, owner: IndexArray, pairs: IndexArray, places: Floats
) -> Iterator[Floats]:
    """Yield the rings that cubics make which are cut where ``pairs`` cross, each going on along the other."""
    ends = np.round(parts(cubics[pairs[:, 0]], places[:, 0], places[:, 0])[:, 0, :2])
    # Visits of the same crossing are neighbours: 0 and 1, 2 and 3 ...
    cubic, t, end = pairs.reshape(-1), places.reshape(-1), np.repeat(ends, 2, axis=0)
    order = np.lexsort((t, cubic))
    begins = np.flatnonzero(np.diff(owner[cubic[order]], prepend=-1))
    arriving = np.arange(1, len(order) + 1)
    arriving[np.append(begins[1:], len(order)) - 1] = begins
    after, rank = np.empty_like(order), np.empty_like(order)
    after[order], rank[order] = order[arriving], np.arange(len(order))

    def arc(visit: int) -> list[Floats]:
        """Return the pieces from a crossing to the next one along its ring."""
        goal = int(after[visit])
        (a, b), (s, e) = cubic[[visit, goal]].tolist(), t[[visit, goal]].tolist()
        pieces = []
        if a == b and rank[visit] < rank[goal]:
            pieces.append(_part(cubics[a], s, e))
        else:
            pieces.append(_part(cubics[a], s, 1))
            a = int(following[a])
            while a != b:
                pieces.append(cubics[a])
                a = int(following[a])
            pieces.append(_part(cubics[b], 0, e))
        pieces[0] = _held(pieces[0], 0, end[visit])
        pieces[-1] = _held(pieces[-1], 3, end[goal])
        return [piece for piece in pieces if (piece[:, :2] != piece[0, :2]).any()]

    left = set(range(len(order)))
    while left:
        visit, pieces = min(left), []
        while visit in left:
            left.remove(visit)
            pieces += arc(visit)
            visit = int(after[visit]) ^ 1  # the other visit of the crossing
        yield np.array(pieces).reshape(-1, *cubics.shape[1:])


def _apart(ring: Floats) -> Iterator[Floats]:
    """Yield a ring that touches itself in nodes as several."""
    pieces: list[Floats] = []
    places: dict[tuple[float, ...], int] = {}
    for piece in ring:
        places[tuple(piece[0, :2].tolist())] = len(pieces)
        pieces.append(piece)
        begin = places.get(tuple(piece[3, :2].tolist()))
        if begin is not None:
            yield np.stack(pieces[begin:])
            del pieces[begin:]
            places = {place: index for place, index in places.items() if index < begin}


def _cut_at_nodes(rings: list[Floats]) -> list[Floats]:
    """Return rings with their lines cut where other nodes of the same ring lie on them."""
    if not rings:
        return rings
    cubics, owner = np.concatenate(rings), np.repeat(np.arange(len(rings)), [len(ring) for ring in rings])
    rows = np.flatnonzero(_are_lines(cubics))
    start, along = cubics[rows, 0], cubics[rows, 3] - cubics[rows, 0]
    # Rings side by side meet no others' nodes.
    place = cubics[:, 0, 0] + owner * (1 + np.ptp(cubics[:, 0, 0]))
    order = np.argsort(place, kind="stable")
    first = np.searchsorted(place[order], place[rows] + np.minimum(along[:, 0], 0), "left")
    last = np.searchsorted(place[order], place[rows] + np.maximum(along[:, 0], 0), "right")
    line, node = np.repeat(np.arange(len(rows)), last - first), order[ranges(first, last - first)]
    way, whole = cubics[node, 0] - start[line], along[line]
    inside = (way * whole).sum(axis=1)
    # Nodes are whole numbers: this is exact.
    is_on = (cross(way, whole) == 0) & (inside > 0) & (inside < (whole * whole).sum(axis=1))
    if not is_on.any():
        return rings
    line, node, inside = line[is_on], node[is_on], inside[is_on]
    pieces = {}
    for i in np.unique(line).tolist():
        cuts = node[line == i][np.argsort(inside[line == i], kind="stable")]
        ends = np.stack([start[i], *cubics[cuts, 0], start[i] + along[i]])
        pieces[int(rows[i])] = ends[:-1, None] + np.diff(ends, axis=0)[:, None] * np.arange(4)[:, None] / 3
    cut = [pieces.get(i, cubics[i : i + 1]) for i in range(len(cubics))]
    begins = starts_of(np.array([len(ring) for ring in rings])).tolist()
    return [np.concatenate(cut[i:j]) for i, j in itertools.pairwise(begins)]


def _part(cubic: Floats, start: float, end: float) -> Floats:
    return parts(cubic[None], np.array([start]), np.array([end]))[0]


def _held(cubic: Floats, row: int, end: Floats) -> Floats:
    """Return a cubic in whole numbers with one ``end`` there; a line has its handles at the thirds."""
    is_line = _are_lines(cubic[None])[0]
    made = cubic.copy()
    made[:, :2] = np.round(made[:, :2])
    made[row, :2] = end
    if is_line:
        made[1, :2], made[2, :2] = (2 * made[0] + made[3])[:2] / 3, (made[0] + 2 * made[3])[:2] / 3
    return made


def _are_lines(cubics: Floats) -> Bools:
    """Return which cubics have their handles at the thirds of a line."""
    steps = np.diff(cubics[..., :2], axis=1)
    uneven = 0.01  # by how much the thirds of a line may differ [units]: more than single precision does
    return np.asarray(np.abs(steps - steps[:, 1:2]).max(axis=(1, 2)) <= uneven)


def reversed_ring(ring: Floats) -> Floats:
    """Return a ring of cubics in the other direction."""
    return ring[::-1, ::-1]


def bounding(rings: list[Floats], painted: Painted, kept: Sequence[Floats] = ()) -> list[Floats]:
    """Return the rings with paint on one side only, turned so that they run around it.

    Args:
        rings: That do not cross, as ``uncrossed`` takes them.
        painted: Where there is paint.
        kept: Rings beside them.
    """
    if not rings:
        return []
    lines = [polygon(ring[..., -2:]) for ring in (*rings, *kept)]
    # Another ring may lie on a part of one: the places along it vote, by their lengths.
    chosen = lines[: len(rings)]
    places = [np.arange(0, len(line), -(-len(line) // SAMPLES)) for line in chosen]
    owner = np.repeat(np.arange(len(rings)), [len(own) for own in places])
    one = np.concatenate([line[own] for line, own in zip(chosen, places, strict=True)])
    other = np.concatenate([np.roll(line, -1, axis=0)[own] for line, own in zip(chosen, places, strict=True)])
    around = windings(lines, 0.5 * (one + other), owner)
    is_clockwise = np.array([area(line) > 0 for line in chosen])
    inside = painted(around + np.where(is_clockwise[owner], 1, -1))
    length, outside = elementary.hypot(*(other - one).T), painted(around)
    outer, inner, total = (
        np.bincount(owner, length * side, len(rings)) for side in (inside & ~outside, outside & ~inside, 1.0)
    )
    bounds = 2 * np.maximum(outer, inner) > total
    runs_so = is_clockwise == (outer > inner)
    return [ring if runs_so[i] else reversed_ring(ring) for i, ring in enumerate(rings) if bounds[i]]


def windings(lines: list[Floats], points: Floats, owner: IndexArray | None = None) -> IndexArray:
    """Return how often polygons wind around each point, positive from x towards y.

    ``owner``: the polygon that each point is on, which does not count.
    """
    one, other = np.concatenate(lines), np.concatenate([np.roll(line, -1, axis=0) for line in lines])
    ring = np.repeat(np.arange(len(lines)), [len(line) for line in lines])
    low, high = np.minimum(one[:, 1], other[:, 1]), np.maximum(one[:, 1], other[:, 1])
    # Only the lines in a point's row count.
    count = 1 + int(np.sqrt(len(one)))
    top, height = low.min(), max(float(high.max() - low.min()), 1e-9) / count
    first, last, at = (
        np.clip(((y - top) / height).astype(np.intp), 0, count - 1) for y in (low, high, points[:, 1])
    )
    rows, line = ranges(first, last - first + 1), np.repeat(np.arange(len(one)), last - first + 1)
    order = np.argsort(rows, kind="stable")
    begins = np.searchsorted(rows[order], np.arange(count + 1))
    counts = begins[at + 1] - begins[at]
    point, line = np.repeat(np.arange(len(points)), counts), line[order][ranges(begins[at], counts)]
    if owner is not None:
        others = ring[line] != owner[point]
        point, line = point[others], line[others]
    a, b = one[line] - points[point], other[line] - points[point]
    side = a[:, 0] * b[:, 1] - b[:, 0] * a[:, 1]
    up, down = (a[:, 1] <= 0) & (b[:, 1] > 0) & (side > 0), (a[:, 1] > 0) & (b[:, 1] <= 0) & (side < 0)
    return np.bincount(point[up], minlength=len(points)) - np.bincount(point[down], minlength=len(points))


def polygon(ring: Floats) -> Floats:
    """Return a ring of cubics as a polygon: (cubic, 4, 2) -> (point, 2)."""
    return flattened(ring, PIECES)[:, :-1].reshape(-1, 2)


def polygon_ring(corners: Floats) -> Floats:
    """Return a polygon as a ring of cubics: (point, 2) -> (cubic, 4, 2)."""
    steps = np.roll(corners, -1, axis=0) - corners
    return np.asarray(corners[:, None] + np.arange(4)[:, None] / 3 * steps[:, None])


def area(ring: Floats) -> float:
    """Return the area inside a polygon [units²], negative if it runs from y towards x."""
    x, y = ring[:, 0], ring[:, 1]
    return 0.5 * float((x * np.roll(y, -1) - np.roll(x, -1) * y).sum())


def moved_left(ring: Floats, distance: float) -> Floats:
    """Return a ring of cubics with its nodes moved to the left on a screen, and the handles with them."""
    ends = [ring[:, 1:] - ring[:, :1], (ring[:, 3:] - ring[:, 2::-1])]
    after, before = (_first_directions(steps) for steps in ends)
    side = after + np.roll(before, 1, axis=0)
    normal = np.stack([side[:, 1], -side[:, 0]], axis=1)
    normal = distance * normal / np.maximum(elementary.hypot(*normal.T), 1e-9)[:, None]
    following = np.roll(normal, -1, axis=0)
    return ring + np.stack([normal, normal, following, following], axis=1)


def _first_directions(steps: Floats) -> Floats:
    """Return the direction of the first step that has one: (cubic, step, 2) -> (cubic, 2)."""
    lengths = elementary.hypot(steps[..., 0], steps[..., 1])
    rows, first = np.arange(len(steps)), (lengths > 0).argmax(axis=1)
    return np.asarray(steps[rows, first] / np.maximum(lengths[rows, first], 1e-9)[:, None])
