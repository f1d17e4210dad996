"""Points of shapes as path data (SVG 1.1, 8.3), in whole numbers of the view box.

Coordinates are relative, each against the rounded position before it, so that rounding errors do not add up.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable

import numpy as np

from warpsplat.scene import Basis, Kind, Scene

Pair = tuple[int, int]


def integers(pairs: Iterable[Pair]) -> str:
    """Whole numbers in a row with the fewest separators: a sign separates itself."""
    return " ".join([f"{x} {y}" for x, y in pairs]).replace(" -", "-")


def minus(a: Pair, b: Pair) -> Pair:
    """The way from ``b`` to ``a``."""
    return a[0] - b[0], a[1] - b[1]


class PathData:
    """``d`` of the shapes of a scene, with ``per_pixel`` units of the view box a pixel."""

    def __init__(self, scene: Scene, per_pixel: float) -> None:
        spline = np.repeat(scene.basis, scene.point_counts()) == Basis.SPLINE
        # Points of a spline lie on even numbers, so that its quadratics meet on whole ones.
        unit = np.where(spline, per_pixel / 2, per_pixel)[:, None]
        grid = np.round(scene.points.astype(np.float64) * unit).astype(np.int64).tolist()
        self._grid: list[Pair] = [(x, y) for x, y in grid]
        self._starts, self._closed = scene.starts.tolist(), scene.closed.tolist()
        self._contours = np.searchsorted(scene.starts, scene.first).tolist()
        self._strokes = (scene.kind == Kind.STROKE).tolist()
        self._splines = (scene.basis == Basis.SPLINE).tolist()
        self._has_twin = np.append(scene.twin[1:], 0).tolist()

    def of(self, shape: int) -> str:
        """Of one shape: its contours one after another."""
        # Fills close by themselves, but the stroke of the same path does not. Where its pattern begins
        # matters, too.
        is_stroked = self._strokes[shape] or self._has_twin[shape]
        texts = []
        for contour in range(*self._contours[shape : shape + 2]):
            points = self._grid[self._starts[contour] : self._starts[contour + 1]]
            closed = bool(self._closed[contour])
            if self._splines[shape]:
                texts.append(spline_data(points, closed, turns=not is_stroked))
            else:
                texts.append(cubic_data(points, closed, keep_dots=self._strokes[shape]))
            if closed and is_stroked:
                texts.append("z")
        return "".join(texts)


def cubic_data(grid: list[Pair], closed: bool, *, keep_dots: bool) -> str:
    """``d`` of a chain of cubics; ``keep_dots``: also of those without extent."""
    chain = [*grid, grid[0]] if closed else grid
    steps: list[Pair] = []
    for i in range(0, len(chain) - 1, 3):
        cubic = [minus(point, chain[i]) for point in chain[i + 1 : i + 4]]
        # A cubic without extent draws nothing in a fill; in a stroke it may be the dot that is all there is.
        if keep_dots or any(x or y for x, y in cubic):
            steps += cubic
    text = f"M{integers(chain[:1])}"
    return f"{text}c{integers(steps)}" if steps else f"{text}z"


def spline_data(half: list[Pair], closed: bool, *, turns: bool = True) -> str:
    """``d`` of a spline: one quadratic, and smooth ones, whose control points follow (SVG 1.1, 8.3.7).

    Args:
        half: its points in half of the numbers that are written.
        closed: whether they are a ring.
        turns: whether a ring is written from where that takes the fewest characters.
    """
    if closed:
        start = _cheapest_start(half) if turns else 0
        ring = half[start:] + half[:start]
        ring = [ring[-1], *ring, ring[0]]
    else:
        ring = half
    joints = [(a + c, b + d) for (a, b), (c, d) in itertools.pairwise(ring)]
    if not closed:
        joints = [(2 * half[0][0], 2 * half[0][1]), *joints[1:-1], (2 * half[-1][0], 2 * half[-1][1])]
    control = (2 * ring[1][0], 2 * ring[1][1])
    steps = [minus(after, before) for before, after in itertools.pairwise(joints)]
    text = f"M{integers(joints[:1])}q{integers([minus(control, joints[0]), steps[0]])}"
    return f"{text}t{integers(steps[1:])}" if len(steps) > 1 else text


def _cheapest_start(half: list[Pair]) -> int:
    """The point of a ring before which to start: the start, and the control point that is written besides,
    are shortest there. The steps are the same from everywhere, but the second needs no separator.
    """
    near = zip([half[-1], *half[:-1]], half, [*half[2:], *half[:2]], strict=True)
    lengths = [
        len(f"{a + c} {b + d} {c - a} {d - b}") - (b + d < 0) - (d - b < 0) - (e >= c)
        for (a, b), (c, d), (e, _) in near
    ]
    return lengths.index(min(lengths))
