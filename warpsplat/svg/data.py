"""Points of shapes as path data (SVG 1.1, 8.3), in whole units of the view box.

Relative coordinates refer to the rounded position before, so that rounding errors do not add up.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator

import numpy as np

from warpsplat.scene import Basis, Bools, Floats, IndexArray, Kind, Scene
from warpsplat.svg.commands import (
    SMALL,
    Pair,
    Rings,
    Segment,
    minus,
    segments_of,
    shortest,
    shortest_smooth,
)
from warpsplat.svg.forms import held_values
from warpsplat.svg.primitives import held_primitives, primitives


def integers(pairs: Iterable[Pair]) -> str:
    """Return whole numbers in a row with the fewest separators."""
    return " ".join([f"{x} {y}" for x, y in pairs]).replace(" -", "-")


NEAR_THIRD, ROUNDED_THIRD = 0.05, 0.5 + 1e-9
"""Largest distances of a line's handles from its thirds, in units of the view box: of exact points, and of
rounded ones, as far as rounding moves handles, which moves the outline by less."""


def straight_cubics(scene: Scene, exact: Floats) -> Bools:
    """Return which cubics a file shows as straight lines, by their first points, shape (point,).

    Those are cubics with handles at the thirds, or with rounded handles on the line. ``exact``: the points in
    units of the view box, shape (point, 2).
    """
    found = np.zeros(len(exact), np.bool_)
    rows = cubic_rows(scene)
    for corners, near in ((exact[rows], NEAR_THIRD), (np.round(exact[rows]), ROUNDED_THIRD)):
        vectors = corners[:, 1:] - corners[:, :1]
        chord = vectors[:, 2:]
        handles, thirds = vectors[:, :2], np.array([[1 / 3], [2 / 3]]) * chord
        at_thirds = (np.abs(handles - thirds) <= near).all(axis=(1, 2))
        along, square = (handles * chord).sum(axis=2), (chord * chord).sum(axis=2)
        across = handles[..., 0] * chord[..., 1] - handles[..., 1] * chord[..., 0]
        on_chord = ((across == 0) & (along >= 0) & (along <= square)).all(axis=1) & (square[:, 0] > 0)
        found[rows[at_thirds | on_chord, 0]] = True
    return found


def held_points(scene: Scene, exact: Floats) -> Floats:
    """Return the points of a file: whole numbers, but for handles of lines, at the thirds, and of arcs."""
    rows = cubic_rows(scene)
    rows = rows[straight_cubics(scene, exact)[rows[:, 0]]]
    held = np.round(exact)
    a, b = held[rows[:, 0]], held[rows[:, 3]]
    held[rows[:, 1]], held[rows[:, 2]] = (2 * a + b) / 3, (a + 2 * b) / 3
    for own, points in held_primitives(scene, exact):
        held[own] = points
    for rows, values in held_values(scene, exact):
        held[rows] = values
    return held


def cubic_rows(scene: Scene) -> IndexArray:
    """Return the indices of each cubic's points, shape (cubic, 4)."""
    rows = []
    for group in scene.alike():
        if group.basis == Basis.CUBIC:
            count = group.points.shape[1]
            inner = (np.arange(0, count - 1, 3)[:, None] + np.arange(4)) % count
            rows.append((scene.starts[group.contours][:, None, None] + inner).reshape(-1, 4))
    return np.concatenate(rows).astype(np.intp) if rows else np.zeros((0, 4), np.intp)


def units(scene: Scene, per_pixel: float) -> Floats:
    """Return the units of a file to a pixel for each point, shape (point, 1).

    Points of a spline lie on even numbers, so that its quadratics meet on whole ones.
    """
    spline = np.repeat(scene.basis, scene.point_counts()) == Basis.SPLINE
    return np.where(spline, per_pixel / 2, per_pixel)[:, None]


def path_data(scene: Scene, per_pixel: float) -> Iterator[str]:
    """Yield the ``d`` attributes of a scene's shapes, with ``per_pixel`` units of the view box to a pixel."""
    exact = scene.points.astype(np.float64) * units(scene, per_pixel)
    straight = straight_cubics(scene, exact).tolist()
    grid: list[Pair] = [(x, y) for x, y in np.round(exact).astype(np.int64).tolist()]
    starts, closed = scene.starts.tolist(), scene.closed.astype(np.bool_).tolist()
    contours = scene.first_contours().tolist()
    strokes = scene.kind == Kind.STROKE
    # A stroke's dashes depend on where it starts.
    arcs = {i: made for i, made in primitives(scene, exact, whole=True) if made.radii[0] > 0}
    rings = Rings()
    stroked = (strokes | scene.has_twin()).tolist()
    for shape, is_spline in enumerate((scene.basis == Basis.SPLINE).tolist()):
        texts = []
        pen: Pair | None = None
        for contour in range(*contours[shape : shape + 2]):
            rows = slice(*starts[contour : contour + 2])
            if is_spline:
                texts.append(spline_data(grid[rows], closed[contour], may_rotate=not stroked[shape]))
                texts.append("z" if closed[contour] else "")
                continue
            made = None if stroked[shape] else arcs.get(contour)
            if made:
                text, pen = made.data(pen)
                texts.append(text)
                continue
            segments = segments_of(
                grid[rows], straight[rows][: rows.stop - rows.start - 2 : 3], closed[contour]
            )
            if not strokes[shape]:  # only in a stroke does a dot show
                segments = [segment for segment in segments if segment.has_extent()]
            text, pen = cubic_data(
                segments, grid[rows.start], closed[contour], None if stroked[shape] else rings, pen
            )
            texts.append(text)
        yield "".join(texts)


def cubic_data(
    segments: list[Segment], start: Pair, closed: bool, rings: Rings | None, pen: Pair | None
) -> tuple[str, Pair]:
    """Return the path data of a contour of lines and cubics from ``start``, and where the pen is then.

    ``rings``: of the fill; None for a stroke, where a ring's joint is visible, and its start matters.
    ``pen``: where the pen is before, if any.
    """
    if not segments:
        return f"M{integers([start])}z", start
    if not closed:
        return shortest(pen, segments), segments[-1].end
    if rings:
        return rings.data(pen, segments)
    if segments[-1].handles is None and len(segments) > 1:
        segments.pop()
    return f"{shortest(pen, segments)}z", start


def spline_data(half: list[Pair], closed: bool, *, may_rotate: bool) -> str:
    """Return the path data of a spline: one quadratic, and smooth ones (SVG 1.1, 8.3.7).

    ``half``: its points, in half of the numbers that are written. ``may_rotate``: a ring may start where that
    takes the fewest characters.
    """
    if closed and may_rotate:
        start = _cheapest_start(half)
        half = half[start:] + half[:start]
    joints, control = spline_joints(half, closed)
    if max(abs(value) for joint in joints for value in joint) <= SMALL:
        return shortest_smooth(joints, control)
    return relative_smooth(joints, control)


def spline_joints(half: list[Pair], closed: bool) -> tuple[list[Pair], Pair]:
    """Return where the quadratics of a spline meet, and the first one's control point."""
    ring = [half[-1], *half, half[0]] if closed else half
    joints = [(a + c, b + d) for (a, b), (c, d) in itertools.pairwise(ring)]
    if not closed:
        joints = [(2 * half[0][0], 2 * half[0][1]), *joints[1:-1], (2 * half[-1][0], 2 * half[-1][1])]
    return joints, (2 * ring[1][0], 2 * ring[1][1])


def relative_smooth(joints: list[Pair], control: Pair) -> str:
    """Return path data of smooth quadratics through ``joints`` in relative commands only."""
    steps = [minus(after, before) for before, after in itertools.pairwise(joints)]
    text = f"M{integers(joints[:1])}q{integers([minus(control, joints[0]), steps[0]])}"
    return f"{text}t{integers(steps[1:])}" if len(steps) > 1 else text


def _cheapest_start(half: list[Pair]) -> int:
    """Return the point of a ring before which its text should start.

    There the start and the one control point that is written are shortest; the steps are always the same, but
    the second needs no separator.
    """
    near = zip([half[-1], *half[:-1]], half, [*half[2:], *half[:2]], strict=True)
    lengths = [
        len(f"{a + c} {b + d} {c - a} {d - b}") - (b + d < 0) - (d - b < 0) - (e >= c)
        for (a, b), (c, d), (e, _) in near
    ]
    return lengths.index(min(lengths))
