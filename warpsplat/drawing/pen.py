"""Fills that a round pen draws, as strokes."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np

from warpsplat.drawing.line_art import STROKE_STEPS, lengths_of, refined
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
from warpsplat.scene import IndexArray, Kind, Paint, Scene
from warpsplat.scene.scene import starts_of
from warpsplat.svg.data import cubic_rows
from warpsplat.svg.sizes import PATH

SPOT, SPOT_SIDE = 1.5, 5
"""Area that differs in a square of some side [px], at most [px²]: at wide blunt ends more does."""

SLENDER = 17.0
"""Square of the outline's length over the area of what may be strokes, at the least: a square has 16."""


def with_strokes(scene: Scene, settings: Settings, run: Run) -> Scene:
    """Return a drawing with strokes in place of fills, or parts of them, of even width with round ends."""
    may_be_drawn = (scene.kind == Kind.FILL) & (scene.paint == Paint.FLAT)
    done = scene.take(np.zeros(0, np.intp))
    for i, is_flat in enumerate(may_be_drawn.tolist()):
        shape = scene.take(np.array([i]))
        done = done.append(_drawn(shape, settings, run) if is_flat and _is_slender(shape) else shape)
    return replace(done, layer_names=scene.layer_names)


def _is_slender(shape: Scene) -> bool:
    """Return whether the outline of a shape is long for its area, about."""
    length, area = 0.0, 0.0
    for points, _ in shape.contours_of(0):
        x, y = points.astype(np.float64).T
        length += float(hypot(x - np.roll(x, 1), y - np.roll(y, 1)).sum())
        area += float((x * np.roll(y, -1) - np.roll(x, -1) * y).sum()) / 2
    return length * length > SLENDER * abs(area)


def _drawn(shape: Scene, settings: Settings, run: Run) -> Scene:
    """Return a fill as strokes, and what is left of it."""
    low = np.floor(shape.points.min(axis=0)) - MARGIN
    width, height = (np.ceil(shape.points.max(axis=0)) + MARGIN - low).astype(np.intp).tolist()
    white, black = np.ones(3, np.float32), np.zeros((1, 3), np.float32)
    canvas = replace(shape.canvas, width=width, height=height, background=white)
    alone = replace(shape, canvas=canvas, points=shape.points - low.astype(np.float32))
    solid = np.ones_like(shape.opacities)
    shown = render(replace(alone, colors=black, opacities=solid), backend=run.backend)
    cover = 1 - shown[..., 0]
    mask = with_thin(cover > 0.5, middles(across(cover), FAINT))
    traced = trace_ink(Ink(cover, mask, shown, white), only_lines=True).scene()
    if not len(traced):
        return shape
    traced = replace(traced, canvas=canvas, colors=np.zeros_like(traced.colors))
    quiet = replace(run, on_progress=None, checkpoint=None)
    problem = Problem(shown, replace(settings, iterations=STROKE_STEPS))
    strokes = _straight(refined(traced, problem, quiet).scene)
    count, labels = cv2.connectedComponents(mask.astype(np.uint8), connectivity=8)
    # What a part covers of the pixels beside its mask belongs to it.
    grown = cv2.dilate(labels.astype(np.float32), np.ones((3, 3), np.uint8))
    parts: IndexArray = np.asarray(grown, np.intp)
    part, outline_part = _parts_of(parts, count, strokes), _parts_of(parts, count, alone)
    lengths = lengths_of(strokes)
    length: Floats = np.bincount(part, lengths, count).astype(np.float64)
    area = np.bincount(part, lengths * strokes.widths, count)
    then, before = (
        np.bincount(owner, sizes, count)
        for owner, sizes in ((part, PATH + _sizes(strokes)), (outline_part, _sizes(alone)))
    )
    off = np.abs(render(strokes, backend=run.backend)[..., 0] - shown[..., 0])
    worst = np.zeros(count, np.float32)
    np.maximum.at(worst, parts.ravel(), filters.box_sum(off, SPOT_SIDE).ravel())
    gone = (worst <= SPOT) & (length * length > area) & (then <= before)  # dots stay
    gone[0] = False
    chosen = np.flatnonzero(gone[part])
    if not len(chosen):
        return shape
    strokes = strokes.take(chosen)
    strokes = replace(
        strokes,
        canvas=shape.canvas,
        points=strokes.points + low.astype(np.float32),
        colors=np.repeat(shape.colors, len(chosen), axis=0),
        opacities=np.repeat(shape.opacities, len(chosen)),
        layer=np.repeat(shape.layer, len(chosen)),
    )
    return _having(shape, ~gone[outline_part]).append(strokes)


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


def _sizes(scene: Scene) -> Floats:
    """Return the bytes of the data of each contour, shape (contour,)."""
    rows = cubic_rows(scene)
    pieces = np.where(_is_straight(scene.points.astype(np.float64), rows), LINE, CUBIC)
    owner = np.searchsorted(scene.starts, rows[:, 0], side="right") - 1
    return np.asarray(MOVE + np.bincount(owner, pieces, len(scene.starts) - 1), np.float64)


def _parts_of(parts: IndexArray, count: int, scene: Scene) -> IndexArray:
    """Return the part, of ``count``, that most points of each contour are in, shape (contour,)."""
    contours = len(scene.starts) - 1
    owner = np.repeat(np.arange(contours), np.diff(scene.starts))
    votes = np.bincount(owner * count + at_pixels(parts, scene.points), minlength=contours * count)
    votes = votes.reshape(contours, count)
    votes[:, 0] = 0
    return votes.argmax(axis=1)


def _having(shape: Scene, chosen: Bools) -> Scene:
    """Return a shape with the ``chosen`` contours; none if there are none."""
    counts = np.diff(shape.starts)
    points = shape.points[np.repeat(chosen, counts)]
    if not len(points):
        return shape.take(np.zeros(0, np.intp))
    first = np.array([0, len(points)], shape.first.dtype)
    starts = starts_of(counts[chosen])
    return replace(shape, points=points, first=first, starts=starts, closed=shape.closed[chosen])
