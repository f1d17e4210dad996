"""Points of shapes as path data (SVG 1.1, 8.3), in whole numbers of the view box.

Coordinates are relative, each against the rounded position before it, so that rounding errors do not add up.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable

import numpy as np
import numpy.typing as npt

from warpsplat.scene import Basis, IndexArray, Kind, Scene
from warpsplat.svg.commands import Pair, minus, segments_of, shortest, shortest_ring
from warpsplat.svg.smooth import SMALL, shortest_smooth


def integers(pairs: Iterable[Pair]) -> str:
    """Whole numbers in a row with the fewest separators: a sign separates itself."""
    return " ".join([f"{x} {y}" for x, y in pairs]).replace(" -", "-")


Floats = npt.NDArray[np.float64]

NEAR_THIRD = 0.05
"""How far handles may be from the thirds of a line, in units of the view box, for it to be one ..."""

THIRD = 0.5 + 1e-9
"""... and as they are rounded: as far as rounding takes them, which moves the outline by less."""


def straight_cubics(scene: Scene, exact: Floats) -> npt.NDArray[np.bool_]:
    """Which cubics a file shows as straight lines, by their first points, shape (point,).

    Those whose handles are its thirds; and those whose handles lie on it when they are rounded.

    Args:
        scene: whose points they are.
        exact: the points in units of the view box, shape (point, 2).
    """
    found = np.zeros(len(exact), np.bool_)
    rows = cubic_rows(scene)
    for corners, near in ((exact[rows], NEAR_THIRD), (np.round(exact[rows]), THIRD)):
        ways = corners[:, 1:] - corners[:, :1]
        way = ways[:, 2:]
        handles, thirds = ways[:, :2], np.array([[1 / 3], [2 / 3]]) * way
        laid = (np.abs(handles - thirds) <= near).all(axis=(1, 2))
        along, square = (handles * way).sum(axis=2), (way * way).sum(axis=2)
        across = handles[..., 0] * way[..., 1] - handles[..., 1] * way[..., 0]
        inside = ((across == 0) & (along >= 0) & (along <= square)).all(axis=1) & (square[:, 0] > 0)
        found[rows[laid | inside, 0]] = True
    return found


def held_points(scene: Scene, exact: Floats) -> Floats:
    """The points as a file has them: whole numbers, and handles of lines at the thirds."""
    rows = cubic_rows(scene)
    rows = rows[straight_cubics(scene, exact)[rows[:, 0]]]
    made = np.round(exact)
    a, b = made[rows[:, 0]], made[rows[:, 3]]
    made[rows[:, 1]], made[rows[:, 2]] = (2 * a + b) / 3, (a + 2 * b) / 3
    return made


def cubic_rows(scene: Scene) -> IndexArray:
    """The points of each cubic of a scene, shape (cubic, 4)."""
    rows = []
    for group in scene.alike():
        if group.basis == Basis.CUBIC:
            count = group.points.shape[1]
            inner = (np.arange(0, count - 1, 3)[:, None] + np.arange(4)) % count
            rows.append((scene.starts[group.contours][:, None, None] + inner).reshape(-1, 4))
    return np.concatenate(rows).astype(np.intp) if rows else np.zeros((0, 4), np.intp)


class PathData:
    """``d`` of the shapes of a scene, with ``per_pixel`` units of the view box a pixel."""

    def __init__(self, scene: Scene, per_pixel: float) -> None:
        spline = np.repeat(scene.basis, scene.point_counts()) == Basis.SPLINE
        # Points of a spline lie on even numbers, so that its quadratics meet on whole ones.
        unit = np.where(spline, per_pixel / 2, per_pixel)[:, None]
        exact = scene.points.astype(np.float64) * unit
        self._straight: list[bool] = straight_cubics(scene, exact).tolist()
        grid = np.round(exact).astype(np.int64).tolist()
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
        is_stroked = bool(self._strokes[shape] or self._has_twin[shape])
        texts = []
        pen: Pair | None = None
        for contour in range(*self._contours[shape : shape + 2]):
            rows = slice(*self._starts[contour : contour + 2])
            points, closed = self._grid[rows], bool(self._closed[contour])
            if self._splines[shape]:
                texts.append(spline_data(points, closed, turns=not is_stroked))
                texts.append("z" if closed and is_stroked else "")
                continue
            straight = self._straight[rows][: len(points) - 2 : 3]
            keep_dots = self._strokes[shape]
            text, pen = cubic_data(
                points, straight, closed, is_stroked=is_stroked, keep_dots=keep_dots, pen=pen
            )
            texts.append(text)
        return "".join(texts)


def cubic_data(
    grid: list[Pair],
    straight: list[bool],
    closed: bool,
    *,
    is_stroked: bool,
    keep_dots: bool,
    pen: Pair | None,
) -> tuple[str, Pair]:
    """``d`` of a chain of cubics, and where the pen is then.

    Args:
        grid: its points.
        straight: which cubics are lines.
        closed: whether it is a ring.
        is_stroked: whether a ring's joint is seen, and where it begins may matter.
        keep_dots: whether to write what has no extent as well: in a fill it draws nothing, in a stroke it may
            be the dot that is all there is.
        pen: where it is before; None at the beginning.
    """
    segments = [
        segment for segment in segments_of(grid, straight, closed) if keep_dots or segment.has_extent()
    ]
    if not segments:
        return f"M{integers(grid[:1])}z", grid[0]
    if not is_stroked:
        return shortest_ring(pen, segments) if closed else (shortest(pen, segments), segments[-1].end)
    if not closed:
        return shortest(pen, segments), segments[-1].end
    if segments[-1].handles is None and len(segments) > 1:
        segments.pop()  # which closing draws
    return f"{shortest(pen, segments)}z", grid[0]


def spline_data(half: list[Pair], closed: bool, *, turns: bool = True) -> str:
    """``d`` of a spline: one quadratic, and smooth ones, whose control points follow (SVG 1.1, 8.3.7).

    Args:
        half: its points in half of the numbers that are written.
        closed: whether they are a ring.
        turns: whether a ring is written from where that takes the fewest characters.
    """
    if closed and turns:
        start = _cheapest_start(half)
        half = half[start:] + half[:start]
    joints, control = _joints(half, closed)
    if max(abs(value) for joint in joints for value in joint) <= SMALL:
        return shortest_smooth(joints, control)
    return _relative(joints, control)


def even_spline_data(half: list[Pair], closed: bool) -> str:
    """As ``spline_data``, with commands that depend on the number of points alone."""
    return _relative(*_joints(half, closed))


def even_cubic_data(grid: list[Pair], closed: bool) -> str:
    """As ``cubic_data``, with commands that depend on the number of points alone; rings are not closed."""
    chain = [*grid, grid[0]] if closed else grid
    ways = [minus(point, chain[i // 3 * 3]) for i, point in enumerate(chain[1:])]
    return f"M{integers(grid[:1])}c{integers(ways)}"


def _joints(half: list[Pair], closed: bool) -> tuple[list[Pair], Pair]:
    """Where the quadratics of a spline meet, and the first one's control point."""
    ring = [half[-1], *half, half[0]] if closed else half
    joints = [(a + c, b + d) for (a, b), (c, d) in itertools.pairwise(ring)]
    if not closed:
        joints = [(2 * half[0][0], 2 * half[0][1]), *joints[1:-1], (2 * half[-1][0], 2 * half[-1][1])]
    return joints, (2 * ring[1][0], 2 * ring[1][1])


def _relative(joints: list[Pair], control: Pair) -> str:
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
