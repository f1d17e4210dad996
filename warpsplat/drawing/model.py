"""Outlines fitted to where the image says that they are, without a render."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from warpsplat.drawing.constraints import Constraints, Drawing, Flags, Floats, rows_of, with_ends
from warpsplat.drawing.measure import Samples
from warpsplat.drawing.nodes import LEVEL, STRAIGHT, TANGENT, WITHOUT, Edits
from warpsplat.drawing.solve import Bending, newton_step
from warpsplat.kernels.drawing import samples as kernels
from warpsplat.rendering.program import launch_on_host

STEPS, PLACING_ROUNDS = 2, 2
"""Steps of a fit, and of finding where on its piece a sample lies before each."""

DAMPING = 0.01
"""Added curvature, as a share."""


def placed(samples: Samples, cubics: Floats, rounds: int = PLACING_ROUNDS) -> Samples:
    """Return samples at the places of ``cubics``, shape (cubic, 4, 2), that are nearest to theirs."""
    t, count = samples.t.copy(), len(cubics)
    values = {"cubics": rows_of(cubics), "first": samples.starts(count), "rounds": rounds}
    launch_on_host(kernels.nearest, count, samples, values, t=t)
    return replace(samples, t=t)


def before_fit(samples: Samples, drawing: Drawing, edits: Edits) -> Floats:
    """Return by how much each edit alone lets the error grow if nothing else follows it, shape (edit,)."""
    cubics, count = drawing.cubics(), len(drawing.joints) // 3
    following = drawing.following()
    previous = np.empty_like(following)
    previous[following] = np.arange(count)
    before, after = previous[edits.at], following[edits.at]
    cubic = np.stack([cubics[before], cubics[edits.at], cubics[after]], axis=1)
    kind = edits.kind
    made = np.flatnonzero(kind == WITHOUT)
    whole = np.concatenate([cubic[made, 0, :1], edits.handles[made], cubic[made, 1, 3:]], axis=1)
    cubic[made, 0] = cubic[made, 1] = whole
    made = np.flatnonzero(kind == STRAIGHT)
    cubic[made, 1, 1:3] = edits.handles[made]
    rows = np.flatnonzero(kind == LEVEL)
    axis, value = edits.axis[rows], edits.value[rows]
    for k, corners in ((0, (3,)), (1, (0, 3)), (2, (0,))):
        for corner in corners:
            cubic[rows, k, corner, axis] = value
    ends = cubic[rows, 1][:, [0, 3]]
    cubic[rows, 1, 1], cubic[rows, 1, 2] = (
        (2 * ends[:, 0] + ends[:, 1]) / 3,
        (ends[:, 0] + 2 * ends[:, 1]) / 3,
    )
    rows = np.flatnonzero(kind == TANGENT)
    value = cubic[rows, 1, 0, edits.axis[rows]]
    cubic[rows, 0, 2, edits.axis[rows]] = cubic[rows, 1, 1, edits.axis[rows]] = value
    lengths = [chords(cubics[rows]) for rows in (before, edits.at)]
    share = lengths[0] / np.maximum(lengths[0] + lengths[1], 1e-9)
    low, high = np.zeros((len(kind), 3)), np.ones((len(kind), 3))
    joined = kind == WITHOUT
    high[joined, 0] = low[joined, 1] = share[joined]
    instead = np.stack([before, edits.at, after], axis=1)
    found = np.zeros(3 * len(kind))
    launch_on_host(
        kernels.errors_elsewhere,
        len(found),
        samples,
        cubics=rows_of(cubic),
        instead=instead.ravel(),
        low=low.ravel(),
        high=high.ravel(),
        first=samples.starts(count),
        rounds=PLACING_ROUNDS,
        error=found,
    )
    return np.asarray((found.reshape(-1, 3) - errors(samples, cubics)[instead]).sum(axis=1))


def chords(cubics: Floats) -> Floats:
    """Return the lengths of the control polygons."""
    return np.asarray(np.linalg.norm(np.diff(cubics, axis=1), axis=2).sum(axis=1))


def errors(samples: Samples, cubics: Floats) -> Floats:
    """Return the errors of the samples on ``cubics``, shape (cubic,)."""
    count, found = len(cubics), np.zeros(len(cubics))
    values = {"cubics": rows_of(cubics), "first": samples.starts(count), "error": found}
    launch_on_host(kernels.errors, count, samples, values)
    return found


def carried(samples: Samples, drawing: Drawing, edits: Edits, keep: Flags) -> Samples:
    """Return samples of ``drawing`` on the cubics that ``edits`` leave."""
    cubics = drawing.cubics()
    following = drawing.following()
    previous = np.empty_like(following)
    previous[following] = np.arange(len(keep))
    lengths = chords(cubics)
    gone = edits.at[edits.kind == WITHOUT]
    before = previous[gone]
    low, high = np.zeros(len(keep)), np.ones(len(keep))
    high[before] = low[gone] = lengths[before] / np.maximum(lengths[before] + lengths[gone], 1e-9)
    t = low[samples.cubic] + (high - low)[samples.cubic] * samples.t
    owner = np.arange(len(keep))
    owner[gone] = before
    number = np.cumsum(keep) - 1
    cubic = number[owner][samples.cubic]
    order = np.argsort(cubic, kind="stable")
    return replace(samples, t=t, cubic=cubic).take(order)


def fitted(
    samples: Samples, drawing: Drawing, least: float, chosen: Flags
) -> tuple[Drawing, Samples, Floats]:
    """Fit the ``chosen`` contours to ``samples``; return all, their samples, and the errors by cubic."""
    inside = chosen[drawing.contour()]
    own = inside[samples.cubic]
    part = samples.take(own)
    part = replace(part, cubic=(np.cumsum(inside) - 1)[part.cubic])
    made, part = _fitted(part, drawing.contours(chosen), least)
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
        bending, freedom = Bending(samples, following), constraints.freedom(points)
        gradient = bending.gradient(with_ends(points, following))
        change = np.clip(newton_step(bending, freedom, gradient, damping, least), -1, 1)
        points = constraints.project(points + freedom.times(change).reshape(-1, 2))
        samples = placed(samples, with_ends(points, following))
    return points, samples


def known(
    samples: Samples, drawing: Drawing, fit: tuple[Samples, Drawing], chosen: Flags
) -> tuple[Samples, Drawing]:
    """Return samples and outlines with the ``chosen`` contours as they were fitted before."""
    now, before = (chosen[made.contour()] for made in (drawing, fit[1]))
    points, t = drawing.scene.points.copy(), samples.t.copy()
    points[np.repeat(now, 3)] = fit[1].scene.points[np.repeat(before, 3)]
    t[now[samples.cubic]] = fit[0].t[before[fit[0].cubic]]
    return replace(samples, t=t), replace(drawing, scene=replace(drawing.scene, points=points))
