"""Colours that change smoothly over a region, as one gradient."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from warpsplat.drawing.trace.grids import Bools, Floats
from warpsplat.portable import filters
from warpsplat.portable.elementary import hypot
from warpsplat.portable.linear import eigh, product, solve, solve_banded
from warpsplat.portable.sequences import interp
from warpsplat.scene import Paint

SAMPLES = 4000
"""Pixels of a region that a ramp is fitted to."""

BINS = 48
"""Places along a ramp where its colour is taken."""

STOP = 1.0
"""How far the colours between two stops may be from the straight way [levels]."""

STOPS = 8
"""The most stops of a ramp."""

SPAN = 3
"""Distance over which the picture's slope is taken, each way [px]."""


@dataclass(frozen=True)
class Ramp:
    """A gradient as ``Scene`` has it, and how well it fits."""

    paint: Paint
    frame: Floats
    """Origin and two axes [px], shape (6,)."""
    offsets: Floats
    """Of the stops, ascending, in 0..1; shape (stop,)."""
    colors: Floats
    """Of the stops, shape (stop, channel)."""
    residual: float
    """Root mean square of the error over all channels [levels]."""


def fit_ramp(image: Floats, mask: Bools, left: int, top: int) -> Ramp | None:
    """The better of a linear and a radial gradient; None where there is no slope at all.

    Args:
        image: the box of a region, 0..255, shape (height, width, channel).
        mask: its sure pixels, shape (height, width).
        left: column of the box in the picture.
        top: row.
    """
    places, slopes = _slopes(image, mask)
    rows, columns = np.nonzero(mask)
    pick = np.linspace(0, len(rows) - 1, min(SAMPLES, len(rows))).astype(np.intp)
    at = np.stack([columns[pick], rows[pick]], axis=1) + 0.5
    colors = image[rows[pick], columns[pick]].astype(np.float64)
    if len(places) < 8 or not np.abs(slopes).max():
        return None
    found = [_linear(at, colors, slopes)]
    center = _center(places, slopes)
    if center is not None:
        found.append(_radial(at, colors, center))
    best = min(found, key=lambda ramp: ramp.residual * (1 + 0.1 * (ramp.paint == Paint.RADIAL)))
    frame = best.frame + np.array([left, top, 0, 0, 0, 0], np.float64)
    return Ramp(best.paint, frame, best.offsets, best.colors, best.residual)


def _slopes(image: Floats, mask: Bools) -> tuple[Floats, Floats]:
    """Where the slope of the picture is known, and it in each channel: (n, 2), (n, 2, channel)."""
    weight = filters.gaussian_blur(mask, 1.5)
    soft = filters.gaussian_blur(image.astype(np.float32) * mask[..., None], 1.5)
    soft = soft / np.maximum(weight, 1e-3)[..., None]
    sure = cv2.erode(mask.astype(np.uint8), np.ones((2 * SPAN + 1,) * 2, np.uint8), borderValue=0) > 0
    sure[:SPAN], sure[-SPAN:], sure[:, :SPAN], sure[:, -SPAN:] = False, False, False, False
    rows, columns = np.nonzero(sure)
    pick = np.linspace(0, len(rows) - 1, min(SAMPLES, len(rows))).astype(np.intp)
    y, x = rows[pick], columns[pick]
    slope_x = (soft[y, x + SPAN] - soft[y, x - SPAN]) / (2 * SPAN) if len(y) else np.zeros((0, 1))
    slope_y = (soft[y + SPAN, x] - soft[y - SPAN, x]) / (2 * SPAN) if len(y) else np.zeros((0, 1))
    return np.stack([x, y], axis=1) + 0.5, np.stack([slope_x, slope_y], axis=1)


def _linear(at: Floats, colors: Floats, slopes: Floats) -> Ramp:
    x, y = slopes[:, 0], slopes[:, 1]
    mixed = (x * y).sum()
    way = eigh([[(x * x).sum(), mixed], [mixed, (y * y).sum()]])[1][:, 1]
    along = product(at, way)
    low, high = float(along.min()), float(along.max())
    length = max(high - low, 1e-3)
    offsets, stops, residual = _profile((along - low) / length, colors)
    middle = at.mean(axis=0)
    origin = middle + (low - float((middle * way).sum())) * way
    axis = way * length
    frame = np.concatenate([origin, axis, [-axis[1], axis[0]]])
    return Ramp(Paint.LINEAR, frame, offsets, stops, residual)


def _center(places: Floats, slopes: Floats) -> Floats | None:
    """The point that all slopes point to or away from."""
    normals = np.stack([slopes[:, 1], -slopes[:, 0]], axis=-1)  # (n, channel, 2)
    away = (normals * places[:, None]).sum(axis=-1)
    x, y = normals[..., 0], normals[..., 1]
    mixed = (x * y).sum()
    matrix = np.array([[(x * x).sum(), mixed], [mixed, (y * y).sum()]])
    least, most = eigh(matrix)[0]
    if most >= 1e4 * least:
        return None
    return solve(matrix, np.array([(x * away).sum(), (y * away).sum()]))


def _radial(at: Floats, colors: Floats, center: Floats) -> Ramp:
    distance = hypot(*(at - center).T)
    reach = max(float(distance.max()), 1e-3)
    offsets, stops, residual = _profile(distance / reach, colors)
    return Ramp(
        Paint.RADIAL, np.array([*center, reach, 0.0, 0.0, reach], np.float64), offsets, stops, residual
    )


def _profile(t: Floats, colors: Floats) -> tuple[Floats, Floats, float]:
    """Stops of the colours along ``t`` in 0..1 by least squares, and what is left."""
    knots = np.linspace(0, 1, BINS + 1)
    fine = _least_squares(t, colors, knots)
    seen = np.histogram(t, knots)[0]
    known = np.concatenate([[True], (seen[1:] + seen[:-1]) > 0, [True]])
    chosen = _fewest(knots[known], fine[known])
    stops = _least_squares(t, colors, chosen)
    shown = np.stack([interp(t, chosen, stops[:, c]) for c in range(colors.shape[1])], axis=1)
    return chosen, np.clip(stops, 0, 255), float(np.sqrt(np.mean((shown - colors) ** 2)))


def _least_squares(t: Floats, colors: Floats, knots: Floats) -> Floats:
    """Values at ``knots`` of the broken line nearest to the colours, a little stiff where nothing is."""
    low = np.clip(np.searchsorted(knots, t, "right") - 1, 0, len(knots) - 2)
    share = (t - knots[low]) / (knots[low + 1] - knots[low])
    count = len(knots)

    def sums(weights: Floats) -> Floats:
        return np.asarray(np.bincount(low, weights, count), np.float64)

    # What is at t is a share of two knots that are neighbours: the sums of products are three diagonals.
    beside = sums(share * (1 - share))[:-1]
    here = sums((1 - share) ** 2) + np.roll(sums(share**2), 1)
    right = np.stack([sums((1 - share) * c) + np.roll(sums(share * c), 1) for c in colors.T], axis=1)
    here += 1e-9
    # The squares of second differences.
    stiff = 1e-6 * len(t)
    for first, times in enumerate((1, 4, 1)):
        here[first : count - 2 + first] += times * stiff
    beside[:-1] -= 2 * stiff
    beside[1:] -= 2 * stiff
    return solve_banded([here, beside, np.full(count - 2, stiff)], right)


def _fewest(knots: Floats, values: Floats) -> Floats:
    """The knots that a broken line within STOP of the values needs (Douglas and Peucker)."""
    chosen = {0, len(knots) - 1}
    while len(chosen) < STOPS:
        order = sorted(chosen)
        shown = np.stack(
            [interp(knots, knots[order], values[order, c]) for c in range(values.shape[1])], axis=1
        )
        off = np.abs(shown - values).max(axis=1)
        worst = int(off.argmax())
        if off[worst] <= STOP:
            break
        chosen.add(worst)
    return np.asarray(knots[sorted(chosen)])
