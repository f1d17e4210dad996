"""Line art -> a scene of strokes."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from warpsplat.drawing.strokes.areas import Areas
from warpsplat.drawing.strokes.centerlines import Line, find_lines
from warpsplat.drawing.strokes.ink import Ink, find_ink
from warpsplat.drawing.strokes.pens import width_steps
from warpsplat.drawing.trace.curves import Pieces, fit_runs
from warpsplat.drawing.trace.grids import Floats, Ints
from warpsplat.drawing.trace.runs import Run
from warpsplat.portable.elementary import hypot
from warpsplat.scene import Basis, Canvas, FloatArray, Kind, Scene
from warpsplat.scene.scene import starts_of

TOLERANCE = 0.45
"""Largest distance of a centre line from its curve [px]."""

LEAST_WIDTH, LONG = 0.3, 6.0
"""Of a stroke, if it is so long [px]; else one pixel."""


@dataclass(frozen=True)
class TracedLines:
    """What line art was traced to."""

    scene: Scene
    """Strokes; ``layer`` is the pen of each."""
    pens: FloatArray
    """sRGB in [0, 1], shape (pen, 3)."""
    areas: Areas | None = None
    """What is filled besides."""
    area_pens: Ints = field(default_factory=lambda: np.zeros(0, np.intp))
    """The pen of each area."""


@dataclass(frozen=True)
class _Stroke:
    points: Floats
    closed: bool
    width: float
    pen: int


def trace_lines(image: FloatArray) -> Scene:
    """The centre lines of line art as opaque strokes, a layer for each pen.

    Args:
        image: sRGB in [0, 1], shape (height, width, 3); premultiplied with opacity, shape (height, width, 4).
    """
    return trace_ink(find_ink(image)).scene


def trace_ink(ink: Ink, *, mixed: bool = False) -> TracedLines:
    """The same, of ink that is known; if ``mixed``, of what is no filled area."""
    drawing = find_lines(ink, mixed=mixed)
    strokes = [stroke for line in drawing.lines for stroke in _strokes(line, thin=not ink.textured)]
    strokes.sort(key=lambda stroke: stroke.pen)
    fitted = fit_runs([_run(stroke) for stroke in strokes], TOLERANCE)
    height, width = ink.mask.shape
    scene = _scene(Canvas(width, height, ink.paper), strokes, fitted, drawing.pens)
    return TracedLines(scene, drawing.pens, drawing.areas, drawing.area_pens)


def rejoined(before: Scene, after: Scene) -> Scene:
    """``after``, with the ends where strokes met ``before`` as they were then, handles included.

    Where a line's width changes, the caps of the broader part pull its end back and bend it.

    Args:
        before: strokes.
        after: the same with other points.
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
    still = np.concatenate([ends[shared], handles[shared]])
    points[still] = before.points[still]
    return replace(after, points=points)


def _strokes(line: Line, *, thin: bool) -> list[_Stroke]:
    """A line, in parts of one width; ``thin``: or less than a pixel."""
    length = float(hypot(*np.diff(line.points, axis=0).T).sum())
    steps = width_steps(line.widths, length / max(1, len(line.points) - 1))
    least = LEAST_WIDTH if thin and length >= LONG else 1.0
    if len(steps) == 1:
        return [_Stroke(line.points, line.closed, max(least, steps[0][2]), line.pen)]
    points = np.concatenate([line.points, line.points[:1]]) if line.closed else line.points
    ends = [*(low for low, _, _ in steps[1:]), len(points) - 1]
    return [
        _Stroke(points[low : end + 1], False, max(least, width), line.pen)
        for (low, _, width), end in zip(steps, ends, strict=True)
    ]


def _run(stroke: _Stroke) -> Run:
    if stroke.closed:
        return Run(stroke.points, True)
    return Run(stroke.points[1:-1], False, stroke.points[0], stroke.points[-1])


def _scene(canvas: Canvas, strokes: list[_Stroke], fitted: list[Pieces], pens: FloatArray) -> Scene:
    """Strokes as ``Scene`` has them: closed chains end where they begin without saying so."""
    chains = [
        pieces.cubics[:, :3].reshape(-1, 2)
        if stroke.closed
        else np.concatenate([pieces.cubics[:, :3].reshape(-1, 2), pieces.cubics[-1:, 3]])
        for stroke, pieces in zip(strokes, fitted, strict=True)
    ]
    owner = np.array([stroke.pen for stroke in strokes], np.int32)
    first = starts_of(np.array([len(chain) for chain in chains], np.int64))
    return Scene.of(
        canvas,
        np.full(len(strokes), Kind.STROKE, np.int32),
        first,
        np.full(len(strokes), Basis.CUBIC, np.int32),
        points=np.concatenate([*chains, np.zeros((0, 2))]).astype(np.float32),
        closed=np.array([stroke.closed for stroke in strokes], np.int32),
        colors=pens[owner].reshape(-1, 3),
        opacities=np.ones(len(strokes), np.float32),
        widths=np.array([stroke.width for stroke in strokes], np.float32),
        layer=owner,
    )
