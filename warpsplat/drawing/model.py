"""Outlines fitted to where the image says that they are, without a render."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from warpsplat.drawing.constraints import (
    Constraints,
    Drawing,
    Flags,
    Floats,
    Links,
    rows_of,
    summed,
    with_ends,
)
from warpsplat.drawing.measure import Samples, chords
from warpsplat.drawing.nodes import WITHOUT, Edits
from warpsplat.drawing.solve import Equations, newton_step
from warpsplat.drawing.trace.beziers import points_at
from warpsplat.kernels.drawing import samples as kernels
from warpsplat.rendering.program import launch_on_host
from warpsplat.scene.scene import ranges

STEPS = 2
"""Steps of a fit, and of finding where on its piece a sample lies before each."""

DAMPING = 0.01
"""Added curvature, as a share."""


def placed(samples: Samples, cubics: Floats) -> Samples:
    """Return samples at the places of ``cubics``, shape (cubic, 4, 2), that are nearest to theirs."""
    t, count = samples.t.copy(), len(cubics)
    values = {"cubics": rows_of(cubics), "first": samples.starts(count), "rounds": STEPS}
    launch_on_host(kernels.nearest, count, samples, values, t=t)
    return replace(samples, t=t)


def errors(samples: Samples, cubics: Floats) -> Floats:
    """Return the errors of the samples on ``cubics``, shape (cubic,)."""
    here = points_at(cubics[samples.cubic], samples.t[:, None])[:, 0]
    off = ((here - samples.place) * samples.across).sum(axis=1)
    return summed(samples.cubic, samples.weight * off * off, len(cubics))


def before_fit(samples: Samples, drawing: Drawing, edits: Edits) -> Floats:
    """Return by how much each edit alone lets the error grow if nothing else follows it, shape (edit,)."""
    cubics, share = drawing.cubics(), _shares(drawing, edits.at)
    joined = np.flatnonzero(edits.kind == WITHOUT)
    instead = np.concatenate([edits.at, drawing.neighbours()[0][edits.at[joined]]])
    # Where on the new cubic the old one would begin and end.
    low, high = np.zeros(len(instead)), np.ones(len(instead))
    low[joined] = high[len(edits.at) :] = share[joined]
    first = samples.starts(len(cubics))
    counts = np.diff(first)[instead]
    moved = samples.take(ranges(first[instead], counts))
    cubic = np.repeat(np.arange(len(instead)), counts)
    moved = replace(moved, cubic=cubic, t=low[cubic] + (high - low)[cubic] * moved.t)
    made = np.concatenate([edits.cubics, edits.cubics[joined]])
    growth = errors(placed(moved, made), made) - errors(samples, cubics)[instead]
    growth[joined] += growth[len(edits.at) :]
    return growth[: len(edits.at)]


def _shares(drawing: Drawing, at: Links) -> Floats:
    """Return the length of the piece before each of some, over that of both."""
    cubics, before = drawing.cubics(), drawing.neighbours()[0]
    lengths = [chords(cubics[rows]) for rows in (before[at], at)]
    return np.asarray(lengths[0] / np.maximum(lengths[0] + lengths[1], 1e-9))


def carried(samples: Samples, drawing: Drawing, edits: Edits, keep: Flags) -> Samples:
    """Return samples of ``drawing`` on the cubics that ``edits`` leave."""
    gone = edits.at[edits.kind == WITHOUT]
    before = drawing.neighbours()[0][gone]
    low, high = np.zeros(len(keep)), np.ones(len(keep))
    high[before] = low[gone] = _shares(drawing, gone)
    t = low[samples.cubic] + (high - low)[samples.cubic] * samples.t
    owner = np.arange(len(keep))
    owner[gone] = before
    number = np.cumsum(keep) - 1
    cubic = number[owner][samples.cubic]
    order = np.argsort(cubic, kind="stable")
    return replace(samples, t=t, cubic=cubic).take(order)


def fitted(
    samples: Samples, drawing: Drawing, least: float, contours: Links
) -> tuple[Drawing, Samples, Floats]:
    """Fit ``contours`` to ``samples``; return the whole drawing, its samples, and the errors by cubic."""
    inside = np.isin(drawing.contour(), contours)
    own = inside[samples.cubic]
    part = samples.take(own)
    part = replace(part, cubic=(np.cumsum(inside) - 1)[part.cubic])
    made, part = _fitted(part, drawing.contours(np.unique(contours)), least)
    points, t = drawing.scene.points.copy(), samples.t.copy()
    points[np.repeat(inside, 3)], t[own] = made, part.t
    samples, fit = replace(samples, t=t), replace(drawing, scene=replace(drawing.scene, points=points))
    return fit, samples, errors(samples, fit.cubics())


def _fitted(samples: Samples, drawing: Drawing, least: float) -> tuple[Floats, Samples]:
    """Return the points of outlines fitted to ``samples``, and the samples on them."""
    constraints, following = Constraints(drawing), drawing.following()
    points = constraints.project(drawing.scene.points.astype(np.float64))
    samples = placed(samples, with_ends(points, following))
    damping = np.full(len(following), DAMPING)
    for _ in range(STEPS):
        equations = Equations(samples, with_ends(points, following), following)
        freedom = constraints.freedom(points)
        change = np.clip(newton_step(equations, freedom, equations.gradient, damping, least), -1, 1)
        points = constraints.project(points + freedom.times(change).reshape(-1, 2))
        samples = placed(samples, with_ends(points, following))
    return points, samples
