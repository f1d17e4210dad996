"""Outlines fitted to where the image says that they are, without a render."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from warpsplat.drawing.constraints import Constraints, Drawing, Flags, Floats, Links, summed, with_ends
from warpsplat.drawing.measure import Samples
from warpsplat.drawing.nodes import LEVEL, STRAIGHT, TANGENT, WITHOUT, Edits
from warpsplat.drawing.solve import Bending, newton_step
from warpsplat.scene.scene import ranges

STEPS, PLACING_ROUNDS = 2, 2
"""Steps of a fit, and of finding where on its piece a sample lies before each."""

DAMPING = 0.01
"""Added curvature, as a share."""


def polynomials(cubics: Floats, chosen: Links) -> Floats:
    """Return the coefficients of the ``chosen`` cubics, lowest first, shape (4, 2, chosen)."""
    a, b, c, d = cubics.transpose(1, 2, 0)
    return np.stack([a, 3 * (b - a), 3 * (c - 2 * b + a), d - 3 * c + 3 * b - a])[..., chosen]


def placed(samples: Samples, cubics: Floats, rounds: int = PLACING_ROUNDS) -> Samples:
    """Return samples at the places of ``cubics``, shape (cubic, 4, 2), that are nearest to theirs."""
    t, (a, b, c, d) = samples.t, polynomials(cubics, samples.cubic)
    a = a - samples.place.T
    for _ in range(rounds):
        away = ((d * t + c) * t + b) * t + a
        speed, bend = (3 * d * t + 2 * c) * t + b, 6 * d * t + 2 * c
        first, curvature = away[0] * speed[0] + away[1] * speed[1], away[0] * bend[0] + away[1] * bend[1]
        second = speed[0] * speed[0] + speed[1] * speed[1] + np.maximum(curvature, 0)
        t = np.clip(t - first / np.maximum(second, 1e-12), 0, 1)
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
    growth = np.zeros(len(kind))
    bounds = np.searchsorted(samples.cubic, np.arange(count + 1))
    old = summed(samples.cubic, errors(samples, cubics), count)
    first_length, second_length = (chords(cubics[rows]) for rows in (before, edits.at))
    share = first_length / np.maximum(first_length + second_length, 1e-9)
    for k, rows in enumerate((before, edits.at, after)):
        counts = bounds[rows + 1] - bounds[rows]
        number = ranges(bounds[rows], counts)
        which = np.repeat(np.arange(len(kind)), counts)
        part = samples.take(number)
        t = part.t
        if k < 2:
            joined = (kind == WITHOUT)[which]
            inside = t * share[which] if k == 0 else share[which] + t * (1 - share[which])
            t = np.where(joined, inside, t)
        part = placed(replace(part, cubic=which, t=t), cubic[:, k])
        growth += summed(which, errors(part, cubic[:, k]), len(kind)) - old[rows]
    return growth


def chords(cubics: Floats) -> Floats:
    """Return the lengths of the control polygons."""
    return np.asarray(np.linalg.norm(np.diff(cubics, axis=1), axis=2).sum(axis=1))


def errors(samples: Samples, cubics: Floats) -> Floats:
    """Return the errors of the samples on ``cubics``."""
    t, (a, b, c, d) = samples.t, polynomials(cubics, samples.cubic)
    x, y = (((d * t + c) * t + b) * t + a - samples.place.T) * samples.across.T
    return np.asarray(samples.weight * (x + y) ** 2)


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
    return fit, samples, summed(samples.cubic, errors(samples, fit.cubics()), len(inside))


def _fitted(samples: Samples, drawing: Drawing, least: float) -> tuple[Floats, Samples]:
    """Return the points of outlines fitted to ``samples``, and the samples on them."""
    constraints, following = Constraints(drawing), drawing.following()
    points = constraints.project(drawing.scene.points.astype(np.float64))
    samples = placed(samples, with_ends(points, following))
    damping = np.full(len(following), DAMPING)
    for _ in range(STEPS):
        bending, freedom = Bending(samples, following), constraints.freedom(points)
        gradient = bending.error_and_gradient(points)[1]
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
