"""Outlines of cubics that are exactly ellipses, or upright rectangles with sharp or rounded corners.

All of them are boxes with corners of some radii: 0 for sharp ones, half the sides for an ellipse.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from warpsplat.scene import Basis, Bools, Floats, IndexArray, Kind, Scene
from warpsplat.scene.geometry import ARC_HANDLE
from warpsplat.scene.scene import numbers_in
from warpsplat.svg.commands import Pair, minus, row
from warpsplat.svg.numbers import number

NEAR = 0.01
"""Largest distance of an exact outline's points from their places, in units of the view box: single precision
is as coarse. Those of other outlines lie on whole numbers, where the handles of arcs hardly ever do."""

POINT_COUNTS = (12, 18, 24)
"""Numbers of points of outlines of four arcs or lines, of four arcs and two lines, and of four of each."""


@dataclass(frozen=True)
class Primitive:
    """An ellipse or rectangle."""

    low: tuple[float, float]
    high: tuple[float, float]
    radii: tuple[float, float]
    """Radii of the corners."""
    is_clockwise: bool = True
    """Whether it runs from x towards y, which is clockwise on a screen."""

    @property
    def is_round(self) -> tuple[bool, bool]:
        """Return whether the corners take up all of its width, and of its height."""
        x, y = (
            r > 0 and b - a - 2 * r < NEAR for a, b, r in zip(self.low, self.high, self.radii, strict=True)
        )
        return x, y

    def cubics(self) -> Floats:
        """Return its arcs and sides, the first one an arc at the upper left, shape (piece, 4, 2)."""
        boxes = np.array([(*self.low, *self.high, *self.radii)], np.float64)
        ((_, cubics),) = _cubics(boxes, np.array([self.is_clockwise]))
        return np.asarray(cubics[0])

    def nodes(self) -> list[tuple[float, float]]:
        """Return where its arcs and sides begin."""
        ends = _ends(*self.low, *self.high, *self.radii)
        shown = [i for i in range(8) if (not self.is_round[i // 2 % 2] if i % 2 else self.radii[0] > 0)]
        if self.is_clockwise:
            return [ends[i] for i in shown]
        return [ends[(i + 1) % 8] for i in reversed(shown)]

    def element(self) -> str:
        """Return the element without brackets and style, such as ``circle cx="9" cy="9" r="5"``."""
        (x0, y0), (x1, y1), (rx, ry) = self.low, self.high, self.radii
        if all(self.is_round):
            tag, values = "ellipse", {"cx": (x0 + x1) / 2, "cy": (y0 + y1) / 2, "rx": rx, "ry": ry}
            if rx == ry:
                tag, values = "circle", {"cx": values["cx"], "cy": values["cy"], "r": rx}
        else:
            tag, values = "rect", {"x": x0, "y": y0, "width": x1 - x0, "height": y1 - y0}
            values |= {"rx": rx} if rx > 0 else {}
            values |= {"ry": ry} if ry != rx else {}
        return " ".join([tag, *(f'{name}="{number(value, 1)}"' for name, value in values.items())])

    def data(self, pen: Pair | None) -> tuple[str, Pair]:
        """Return path data in whole numbers, and where the pen is then.

        ``pen``: where it is before, if any.
        """
        rx, ry = (round(r) for r in self.radii)
        nodes = [(round(x), round(y)) for x, y in self.nodes()]
        start = nodes[0]
        steps = [minus(b, a) for a, b in zip(nodes, [*nodes[1:], start], strict=True)]
        if all(self.is_round):
            steps = [(steps[i][0] + steps[i + 1][0], steps[i][1] + steps[i + 1][1]) for i in (0, 2)]
        large, sweep = int(len(steps) == 2), int(self.is_clockwise)
        text, last = f"M{row(start, False)}", "M"
        if pen is not None:
            text = min(text, f"m{row(minus(start, pen), False)}", key=len)
        for x, y in steps:
            letter, numbers = "a", [rx, ry, 0, large, sweep, x, y]
            if not large and 0 in (x, y):
                letter, numbers = ("v", [y]) if x == 0 else ("h", [x])
            text += row(numbers, True) if letter == last else letter + row(numbers, False)
            last = letter
        return f"{text}z", start


def _ends(x0: Any, y0: Any, x1: Any, y1: Any, rx: Any, ry: Any) -> list[tuple[Any, Any]]:
    """Return where the arcs of corners begin and end, clockwise from the left; of numbers or of arrays."""
    upper = [(x0, y0 + ry), (x0 + rx, y0), (x1 - rx, y0), (x1, y0 + ry)]
    return [*upper, (x1, y1 - ry), (x1 - rx, y1), (x0 + rx, y1), (x0, y1 - ry)]


def _are_round(boxes: Floats) -> Bools:
    """Return ``Primitive.is_round`` of boxes, shape (box, 2)."""
    radii = boxes[:, 4:]
    return np.asarray((radii > 0) & (boxes[:, 2:4] - boxes[:, :2] - 2 * radii < NEAR))


def _cubics(boxes: Floats, clockwise: Bools) -> Iterator[tuple[IndexArray, Floats]]:
    """Yield which boxes have the same kinds of pieces, and these, shape (box, piece, 4, 2).

    ``boxes``: lows, highs and radii, shape (box, 6).
    """
    kinds = np.concatenate([_are_round(boxes), boxes[:, 4:5] > 0, clockwise[:, None]], axis=1)
    kind_numbers = (kinds * np.array([8, 4, 2, 1])).sum(axis=1)
    for kind in numbers_in(kind_numbers).tolist():
        chosen = np.flatnonzero(kind_numbers == kind)
        *is_round, has_arcs, is_clockwise = kinds[chosen[0]].tolist()
        x0, y0, x1, y1, rx, ry = boxes[chosen].T
        corners = [np.stack(own, axis=1) for own in ((x0, y0), (x1, y0), (x1, y1), (x0, y1))]
        nodes = _ends(x0, y0, x1, y1, rx, ry)
        places = [np.stack(own, axis=1) for own in (*nodes, nodes[0])]
        pieces: list[Floats] = []
        for i, corner in enumerate(corners):
            a, b, c = places[2 * i : 2 * i + 3]
            if has_arcs:
                pieces += [a, a + ARC_HANDLE * (corner - a), b + ARC_HANDLE * (corner - b), b]
            if not is_round[i % 2]:
                pieces += [b, (2 * b + c) / 3, (b + 2 * c) / 3, c]
        cubics = np.stack(pieces, axis=1).reshape(len(chosen), -1, 4, 2)
        yield chosen, cubics if is_clockwise else cubics[:, ::-1, ::-1]


def primitives(scene: Scene, exact: Floats, *, whole: bool = False) -> Iterator[tuple[int, Primitive]]:
    """Yield the contours of fills that are ellipses or rectangles.

    ``exact``: the scene's points in units of the view box, shape (point, 2). ``whole``: in whole numbers,
    without those of which nothing would be left.
    """
    for contours, boxes, clockwise, _ in _alike(scene, exact):
        held, left = _rounded(boxes) if whole else (boxes, np.ones(len(boxes), np.bool_))
        rows = zip(contours[left].tolist(), held[left].tolist(), clockwise[left].tolist(), strict=True)
        for contour, (x0, y0, x1, y1, rx, ry), is_clockwise in rows:
            yield contour, Primitive((x0, y0), (x1, y1), (rx, ry), is_clockwise)


def _alike(scene: Scene, exact: Floats) -> Iterator[tuple[IndexArray, Floats, Bools, IndexArray]]:
    """Yield contours of equally many points that are ellipses or rectangles, and what these are.

    That is their lows, highs and radii, shape (outline, 6), whether they are clockwise, and by how many
    points a contour's start is behind that of the shape's cubics.
    """
    for group in scene.alike():
        count = group.points.shape[1]
        if group.kind != Kind.FILL or group.basis != Basis.CUBIC or count not in POINT_COUNTS:
            continue
        points = exact[scene.starts[group.contours][:, None] + np.arange(count)]
        low, high = points.min(axis=1), points.max(axis=1)
        pieces = points.reshape(len(points), -1, 3, 2)
        steps = np.roll(pieces[:, :, 0], -1, axis=1) - pieces[:, :, 0]
        is_arc = (np.abs(steps) > NEAR).all(axis=2)
        arcs = is_arc.sum(axis=1)
        radii = np.where(is_arc[..., None], np.abs(steps), 0).max(axis=1)
        likely = (arcs == 4) | ((arcs == 0) & (count == POINT_COUNTS[0]))
        likely &= (high - low > NEAR).all(axis=1) & (2 * radii <= high - low + NEAR).all(axis=1)
        x, y = points[..., 0], points[..., 1]
        turning = (x * np.roll(y, -1, axis=1) - np.roll(x, -1, axis=1) * y).sum(axis=1) > 0
        chosen = np.flatnonzero(likely)
        boxes, clockwise = np.concatenate([low, high, radii], axis=1)[chosen], turning[chosen]
        near, turned = _turned(boxes, clockwise, points[chosen])
        yield group.contours[chosen[near]], boxes[near], clockwise[near], turned


def _turned(boxes: Floats, clockwise: Bools, points: Floats) -> tuple[IndexArray, IndexArray]:
    """Return which boxes the outlines (outline, point, 2) are, and by how many points those start later."""
    count = points.shape[1]
    near, turned = np.zeros(len(boxes), np.bool_), np.zeros(len(boxes), np.intp)
    for chosen, cubics in _cubics(boxes, clockwise):
        ring, own = cubics[:, :, :3].reshape(len(chosen), -1, 2), points[chosen]
        if ring.shape[1] == count:
            turned[chosen] = np.abs(ring - own[:, :1]).sum(axis=2).argmin(axis=1)
            near[chosen] = np.abs(_begun(ring, turned[chosen]) - own).max(axis=(1, 2)) <= NEAR
    return np.flatnonzero(near), turned[near]


def _begun(rings: Floats, first: IndexArray) -> Floats:
    """Return rings (ring, point, 2) that begin with their points ``first``."""
    rows = (first[:, None] + np.arange(rings.shape[1])) % rings.shape[1]
    return np.take_along_axis(rings, rows[..., None], axis=1)


def _rounded(boxes: Floats) -> tuple[Floats, Bools]:
    """Return boxes in whole numbers, and of which of them something is left."""
    low, high, exact = boxes[:, :2], boxes[:, 2:4], boxes[:, 4:]
    radii, middle, is_round = np.round(exact), np.round((low + high) / 2), _are_round(boxes)
    low = np.where(is_round, middle - radii, np.round(low))
    high = np.where(is_round, middle + radii, np.round(high))
    left = (radii >= (exact > 0)) & (high - low >= np.maximum(1, 2 * radii))
    return np.concatenate([low, high, radii], axis=1), np.asarray(left.all(axis=1))


def held_primitives(scene: Scene, exact: Floats) -> Iterator[tuple[IndexArray, Floats]]:
    """Yield the rows and the points, in whole numbers but for handles, of ellipses and rounded rectangles.

    Arguments are those of ``primitives``. Shapes (outline, point) and (outline, point, 2).
    """
    for contours, boxes, clockwise, turned in _alike(scene, exact):
        held, left = _rounded(boxes)
        index = np.flatnonzero(left & (boxes[:, 4] > 0))
        for chosen, cubics in _cubics(held[index], clockwise[index]):
            own = index[chosen]
            rings = cubics[:, :, :3].reshape(len(own), -1, 2)
            starts = scene.starts[contours[own]]
            if len(own) and rings.shape[1] == scene.starts[contours[own[0]] + 1] - starts[0]:
                yield starts[:, None] + np.arange(rings.shape[1]), _begun(rings, turned[own])


def held_rounds(scene: Scene, per_pixel: float) -> Bools:
    """Return which points belong to ellipses and rounded rectangles, shape (point,)."""
    found = np.zeros(len(scene.points), np.bool_)
    for rows, _ in held_primitives(scene, scene.points.astype(np.float64) * per_pixel):
        found[rows] = True
    return found
