"""Colours that change smoothly over a region, as one linear or radial gradient."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np

from warpsplat.drawing import prices
from warpsplat.drawing.trace.grids import Bools, Floats, Ints
from warpsplat.drawing.trace.seeds import ROUNDING
from warpsplat.portable import filters
from warpsplat.portable.elementary import hypot
from warpsplat.portable.linear import eigh, product, solve
from warpsplat.portable.sequences import interp
from warpsplat.scene import Paint
from warpsplat.scene.attributes import GRADIENTS

SAMPLES = 4000  # pixels of a region that a ramp is fitted to, at the most
SPAN = 3  # [px] over which the slope is taken, to each side
BLUR = 1.5  # [px] standard deviation of the filter before slopes and tones are taken
BINS = 48  # places along a ramp where its colour is measured, at the most; they are a pixel apart at least
MOST_STOPS = 8

Gradients = Sequence[Paint]
"""Kinds of gradients that may be taken."""


@dataclass(frozen=True)
class Ramp:
    """A gradient, in the terms of ``Scene``."""

    paint: Paint
    frame: Floats
    """Origin and two axes [px], shape (6,)."""
    offsets: Floats
    """Offsets of the stops, ascending, in 0..1; shape (stop,)."""
    colors: Floats
    """Colours of the stops, shape (stop, channel)."""
    residual: float
    """Root mean square of the error over all channels [levels]."""

    def is_better_than(self, flat: float) -> bool:
        """Return whether it is worth its bytes beside a flat colour of mean squared error ``flat``."""
        return self.residual * self.residual * prices.SHADED < flat * prices.REGION


def fit_ramp(
    image: Floats, mask: Bools, left: int, top: int, gradients: Gradients = GRADIENTS
) -> Ramp | None:
    """Fit a linear and a radial gradient, and return the better one; None where there is no slope at all.

    Args:
        image: The bounding box of a region, 0..255, shape (height, width, channel).
        mask: Its sure pixels, shape (height, width).
        left: Column of the box in the whole image.
        top: Its row.
        gradients: Those that may be taken.
    """
    if not gradients:
        return None
    places, slopes = _slopes(image, mask)
    if not slopes.any():
        return None
    rows, columns = _sampled(mask)
    points = np.stack([columns, rows], axis=1) + 0.5
    colors = image[rows, columns].astype(np.float64)
    best = _linear(points, colors, slopes) if Paint.LINEAR in gradients else None
    center = _center(places, slopes) if Paint.RADIAL in gradients else None
    if center is not None:
        radial = _radial(points, colors, center)
        if best is None or radial.residual < best.residual:
            best = radial
    return best and replace(best, frame=best.frame + np.array([left, top, 0, 0, 0, 0], np.float64))


def _sampled(mask: Bools) -> tuple[Ints, Ints]:
    """Return rows and columns of the pixels of a mask, or of evenly chosen ones where there are many."""
    rows, columns = np.nonzero(mask)
    pick = np.linspace(0, len(rows) - 1, min(SAMPLES, len(rows))).astype(np.intp)
    return rows[pick], columns[pick]


def _slopes(image: Floats, mask: Bools) -> tuple[Floats, Floats]:
    """Return where the slope of the image is known, shape (n, 2), and it by channel, (n, 2, channel)."""
    sure = cv2.erode(mask.astype(np.uint8), np.ones((2 * SPAN + 1,) * 2, np.uint8), borderValue=0) > 0
    y, x = _sampled(sure)
    soft = filters.blurred_within(image, mask, BLUR)
    slope_x = (soft[y, x + SPAN] - soft[y, x - SPAN]) / (2 * SPAN)
    slope_y = (soft[y + SPAN, x] - soft[y - SPAN, x]) / (2 * SPAN)
    return np.stack([x, y], axis=1) + 0.5, np.stack([slope_x, slope_y], axis=1)


def _linear(points: Floats, colors: Floats, slopes: Floats) -> Ramp:
    """Return a gradient along the principal direction of the slopes."""
    direction = eigh(_squares(slopes.swapaxes(1, 2)))[1][:, 1]
    along = product(points, direction)
    low, high = float(along.min()), float(along.max())
    length = max(high - low, 1e-3)
    middle = points.mean(axis=0)
    origin = middle + (low - float((middle * direction).sum())) * direction
    axis = direction * length
    frame = np.concatenate([origin, axis, [-axis[1], axis[0]]])
    return Ramp(Paint.LINEAR, frame, *_profile((along - low) / length, length, colors))


def _center(places: Floats, slopes: Floats) -> Floats | None:
    """Return the point that all slopes point to or away from; None where they are parallel."""
    normals = np.stack([slopes[:, 1], -slopes[:, 0]], axis=-1)  # (n, channel, 2)
    away = (normals * places[:, None]).sum(axis=-1)
    matrix = _squares(normals)
    least, most = eigh(matrix)[0]
    if most >= 1e4 * least:
        return None
    return solve(matrix, (normals * away[..., None]).sum(axis=(0, 1)))


def _squares(vectors: Floats) -> Floats:
    """Return the sum of the outer products of vectors (..., 2) with themselves, shape (2, 2)."""
    return (vectors[..., :, None] * vectors[..., None, :]).sum(axis=tuple(range(vectors.ndim - 1)))


def _radial(points: Floats, colors: Floats, center: Floats) -> Ramp:
    distance = hypot(*(points - center).T)
    reach = max(float(distance.max()), 1e-3)
    frame = np.array([*center, reach, 0.0, 0.0, reach], np.float64)
    return Ramp(Paint.RADIAL, frame, *_profile(distance / reach, reach, colors))


def _profile(t: Floats, length: float, colors: Floats) -> tuple[Floats, Floats, float]:
    """Fit stops to the colours along ``t`` in 0..1: their offsets, their colours, and the residual.

    ``length``: of the ramp [px].
    """
    bins = min(max(int(length), 1), BINS)
    which = np.unique(np.minimum(t * bins, bins - 1).astype(np.intp), return_inverse=True)[1]
    means = [np.bincount(which, values) / np.bincount(which) for values in (t, *colors.T)]
    offsets = _fewest(means[0], np.stack(means[1:], axis=1))
    weights = interp(t, offsets, np.eye(len(offsets)))
    squares = product(weights.T, weights) + 1e-9 * np.eye(len(offsets))
    stops = solve(squares, product(weights.T, colors))
    residual = float(np.sqrt(np.mean(np.square(product(weights, stops) - colors))))
    return offsets, np.clip(stops, 0, 255), residual


def _fewest(places: Floats, values: Floats) -> Floats:
    """Return 0, 1 and the places between that a broken line near the values needs (Douglas and Peucker)."""
    chosen = {0, len(places) - 1}
    while len(chosen) < MOST_STOPS:
        order = sorted(chosen)
        off = np.abs(interp(places, places[order], values[order]) - values).max(axis=1)
        worst = int(off.argmax())
        if off[worst] <= ROUNDING:
            break
        chosen.add(worst)
    return np.concatenate([[0.0], places[sorted(chosen)[1:-1]], [1.0]])
