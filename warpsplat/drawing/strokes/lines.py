"""Line art -> a scene of strokes."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from warpsplat.drawing.strokes.areas import Areas
from warpsplat.drawing.strokes.centerlines import CenterLine, find_lines
from warpsplat.drawing.strokes.ink import Ink
from warpsplat.drawing.strokes.pens import width_steps
from warpsplat.drawing.trace.curves import Pieces, fit_polylines
from warpsplat.drawing.trace.grids import Floats, Ints
from warpsplat.drawing.trace.spans import Polyline
from warpsplat.portable.elementary import hypot
from warpsplat.scene import Basis, Canvas, FloatArray, Kind, Scene
from warpsplat.scene.scene import starts_of

DOUBT = np.ones((1, 1), np.float32)  # how far off centre lines are at corners, anywhere [px]
TOLERANCE = 0.45  # [px] largest distance of a centre line from its curve
THINNEST, LONG = 0.3, 6.0
"""Width of a thin stroke, at the least, if it is so long [px]; otherwise one pixel."""


@dataclass(frozen=True)
class TracedLines:
    """Traced line art."""

    scene: Scene
    """Strokes; ``layer`` is the pen of each."""
    pens: FloatArray
    """sRGB in [0, 1], shape (pen, 3)."""
    areas: Areas | None
    """Areas that are filled."""
    area_pens: Ints
    """The pen of each area."""


@dataclass(frozen=True)
class _Stroke:
    """A line, or a part of one, of one width."""

    points: Floats
    closed: bool
    width: float
    pen: int

    def polyline(self) -> Polyline:
        if self.closed:
            return Polyline(self.points, True)
        return Polyline(self.points[1:-1], False, self.points[0], self.points[-1])


def trace_ink(ink: Ink, *, mixed: bool = False, only_lines: bool = False) -> TracedLines:
    """Trace the centre lines of ink as opaque strokes, with a layer for each pen.

    Args:
        ink: Of the image.
        mixed: Whether its broad parts stay areas, which are not traced.
        only_lines: Whether it has no broad parts, however wide it is.
    """
    found = find_lines(ink, mixed=mixed, only_lines=only_lines)
    strokes = [stroke for line in found.lines for stroke in _strokes(line, thin=not ink.textured)]
    strokes.sort(key=lambda stroke: stroke.pen)
    fitted = fit_polylines([stroke.polyline() for stroke in strokes], [TOLERANCE] * len(strokes), DOUBT)
    height, width = ink.mask.shape
    scene = _scene(Canvas(width, height, ink.paper), strokes, fitted, found.pens)
    return TracedLines(scene, found.pens, found.areas, found.area_pens)


def rejoined(before: Scene, after: Scene) -> Scene:
    """Return ``after``, with the ends where strokes met in ``before`` as they were then, handles included.

    Where a line's width changes, the caps of the broader part pull its end back and bend it.

    Args:
        before: Strokes.
        after: The same with other points.
    """
    ends = np.stack([before.first[:-1], before.first[1:] - 1], axis=1)
    handles = np.stack([ends[:, 0] + 1, ends[:, 1] - 1], axis=1)
    is_open = before.closed[np.searchsorted(before.starts, before.first[1:]) - 1] == 0
    ends, handles = ends[is_open].reshape(-1), handles[is_open].reshape(-1)
    if not len(ends):
        return after
    _, names, count = np.unique(before.points[ends], axis=0, return_inverse=True, return_counts=True)
    shared = count[names.reshape(-1)] > 1
    points = after.points.copy()
    held = np.concatenate([ends[shared], handles[shared]])
    points[held] = before.points[held]
    return replace(after, points=points)


def _strokes(line: CenterLine, *, thin: bool) -> list[_Stroke]:
    """Return a line in parts of one width, which may be less than a pixel if ``thin``."""
    length = float(hypot(*np.diff(line.points, axis=0).T).sum())
    steps = width_steps(line.widths, length / max(1, len(line.points) - 1))
    least = THINNEST if thin and length >= LONG else 1.0
    if len(steps) == 1:
        return [_Stroke(line.points, line.closed, max(least, steps[0][2]), line.pen)]
    points = np.concatenate([line.points, line.points[:1]]) if line.closed else line.points
    ends = [*(low for low, _, _ in steps[1:]), len(points) - 1]
    return [
        _Stroke(points[low : end + 1], False, max(least, width), line.pen)
        for (low, _, width), end in zip(steps, ends, strict=True)
    ]


def _scene(canvas: Canvas, strokes: list[_Stroke], fitted: list[Pieces], pens: FloatArray) -> Scene:
    """Return strokes as a ``Scene``, in which closed chains do not repeat their first point."""
    chains = [
        np.concatenate([pieces.cubics[:, :3].reshape(-1, 2), pieces.cubics[-1:, 3][stroke.closed :]])
        for stroke, pieces in zip(strokes, fitted, strict=True)
    ]
    owner = np.array([stroke.pen for stroke in strokes], np.int32)
    return Scene(
        canvas,
        np.full(len(strokes), Kind.STROKE, np.int32),
        starts_of(np.array([len(points) for points in chains], np.int64)),
        np.full(len(strokes), Basis.CUBIC, np.int32),
        points=np.concatenate([*chains, np.zeros((0, 2))]).astype(np.float32),
        closed=np.array([stroke.closed for stroke in strokes], np.int32),
        colors=pens[owner].reshape(-1, 3),
        opacities=np.ones(len(strokes), np.float32),
        widths=np.array([stroke.width for stroke in strokes], np.float32),
        layer=owner,
    )
