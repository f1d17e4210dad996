"""Fills that a round pen draws, as strokes."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np

from warpsplat.drawing.constraints import of_contours
from warpsplat.drawing.line_art import STROKE_STEPS, refined
from warpsplat.drawing.picture import MARGIN
from warpsplat.drawing.prices import CUBIC, LINE, MOVE
from warpsplat.drawing.strokes.broad import OFF
from warpsplat.drawing.strokes.ink import FAINT, Ink, across, middles, with_thin
from warpsplat.drawing.strokes.lines import trace_ink
from warpsplat.drawing.trace.grids import Bools, Floats, at_pixels
from warpsplat.fit.problem import Problem, Run
from warpsplat.fit.settings import Settings
from warpsplat.portable import filters
from warpsplat.portable.elementary import hypot
from warpsplat.rendering.renderer import render
from warpsplat.scene import FloatArray, IndexArray, Kind, Paint, Scene
from warpsplat.svg.data import cubic_rows
from warpsplat.svg.sizes import PATH

SPOT, SPOT_SIDE = 1.5, 5
"""Area that differs in a square of some side [px], at most [px²]: at wide blunt ends more does."""

SLENDER = 17.0
"""Square of the outline's length over the area of what may be strokes, at the least: a square has 16."""


def with_strokes(scene: Scene, settings: Settings, run: Run) -> Scene:
    """Return a drawing with strokes in place of fills, or parts of them, of even width with round ends."""
    done = scene.take(np.zeros(0, np.intp))
    for i, is_flat in enumerate(((scene.kind == Kind.FILL) & (scene.paint == Paint.FLAT)).tolist()):
        shape = scene.take(np.array([i]))
        done = done.append(_drawn(shape, settings, run) if is_flat else shape)
    return replace(done, layer_names=scene.layer_names)


def _drawn(shape: Scene, settings: Settings, run: Run) -> Scene:
    """Return a fill as strokes, and what is left of it."""
    part, strokes = _parts(shape, run), shape.take(np.zeros(0, np.intp))
    left = np.ones(len(part), np.bool_)
    for number in np.unique(part).tolist():
        found = _as_strokes(_having(shape, part == number), settings, run)
        if found is not None:
            left &= part != number
            strokes = strokes.append(found)
    return _having(shape, left).append(strokes)


def _alone(shape: Scene, run: Run) -> tuple[Scene, FloatArray, Bools]:
    """Return a fill in black on a white canvas of its own, its picture, and the mask of its ink."""
    low = np.floor(shape.points.min(axis=0)).astype(np.float32) - MARGIN
    width, height = (np.ceil(shape.points.max(axis=0)) + MARGIN - low).astype(np.intp).tolist()
    canvas = replace(shape.canvas, width=width, height=height, background=np.ones(3, np.float32))
    points, black = shape.points - low, np.zeros((1, 3), np.float32)
    alone = replace(shape, canvas=canvas, points=points, colors=black, opacities=np.ones(1, np.float32))
    shown = render(alone, backend=run.backend)
    cover = 1 - shown[..., 0]
    return alone, shown, with_thin(cover > 0.5, middles(across(cover), FAINT))


def _parts(shape: Scene, run: Run) -> IndexArray:
    """Return the number of the connected part of a fill that each contour bounds, shape (contour,)."""
    alone, _, mask = _alone(shape, run)
    labels = cv2.connectedComponents(mask.astype(np.uint8), connectivity=8)[1]
    # The pixels beside a mask belong to it, too.
    grown = cv2.dilate(labels.astype(np.float32), np.ones((3, 3), np.uint8)).astype(np.intp)
    contours = (at_pixels(grown, points) for points, _ in alone.contours_of(0))
    return np.array([np.bincount(numbers[numbers > 0], minlength=1).argmax() for numbers in contours])


def _as_strokes(shape: Scene, settings: Settings, run: Run) -> Scene | None:
    """Return a fill in one part as strokes; None where these are not as near, or no shorter in the file."""
    if not _is_slender(shape):
        return None
    alone, shown, mask = _alone(shape, run)
    traced = trace_ink(Ink(1 - shown[..., 0], mask, shown, alone.canvas.background), only_lines=True).scene()
    if not len(traced) or PATH * len(traced) + _size(traced) > _size(shape):
        return None
    traced = replace(traced, canvas=alone.canvas, colors=np.zeros_like(traced.colors))
    quiet = replace(run, on_progress=None, checkpoint=None)
    problem = Problem(shown, replace(settings, iterations=STROKE_STEPS))
    strokes = _straight(refined(traced, problem, quiet).scene)
    off = np.abs(render(strokes, backend=run.backend)[..., 0] - shown[..., 0])
    if filters.box_sum(off, SPOT_SIDE).max() > SPOT:
        return None
    own = shape.take(np.zeros(len(strokes), np.intp))
    return replace(
        strokes,
        canvas=shape.canvas,
        points=strokes.points + np.round(shape.points[0] - alone.points[0]),
        colors=own.colors,
        opacities=own.opacities,
        layer=own.layer,
    )


def _is_slender(shape: Scene) -> bool:
    """Return whether the outline of a shape is long for its area, about."""
    length, area = 0.0, 0.0
    for points, _ in shape.contours_of(0):
        x, y = points.astype(np.float64).T
        length += float(hypot(x - np.roll(x, 1), y - np.roll(y, 1)).sum())
        area += float((x * np.roll(y, -1) - np.roll(x, -1) * y).sum()) / 2
    return length * length > SLENDER * abs(area)


def _straight(strokes: Scene) -> Scene:
    """Return strokes with straight and level lines where they nearly are."""
    points, rows = strokes.points.astype(np.float64), cubic_rows(strokes)
    first, last = rows[_is_straight(points, rows)][:, [0, 3]].T
    for axis in (0, 1):
        near = np.abs(points[first, axis] - points[last, axis]) < OFF
        mean = (points[first[near], axis] + points[last[near], axis]) / 2
        points[first[near], axis] = points[last[near], axis] = mean
    a, b = points[first], points[last]
    points[first + 1], points[first + 2] = (2 * a + b) / 3, (a + 2 * b) / 3
    return replace(strokes, points=points.astype(np.float32))


def _is_straight(points: Floats, rows: IndexArray) -> Bools:
    """Return which cubics, ``rows`` of points, lines are near."""
    chord, *handles = (points[rows[:, k]] - points[rows[:, 0]] for k in (3, 1, 2))
    across = [np.abs(chord[:, 0] * handle[:, 1] - chord[:, 1] * handle[:, 0]) for handle in handles]
    return np.asarray(np.maximum(*across) < OFF * np.maximum(hypot(*chord.T), 1e-9), np.bool_)


def _size(scene: Scene) -> float:
    """Return the bytes of the data of all contours."""
    rows = cubic_rows(scene)
    straight = _is_straight(scene.points.astype(np.float64), rows)
    return MOVE * len(scene.closed) + float(np.where(straight, LINE, CUBIC).sum())


def _having(shape: Scene, chosen: Bools) -> Scene:
    """Return a shape with the ``chosen`` contours; none if there are none."""
    contours = np.flatnonzero(chosen)
    return of_contours(shape, contours) if len(contours) else shape.take(contours)
