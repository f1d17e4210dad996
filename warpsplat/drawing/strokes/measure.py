"""Where exactly the middle of a line of ink is, and how wide it is, from what its pixels are covered."""

from __future__ import annotations

import numpy as np

from warpsplat.drawing.trace.grids import Floats
from warpsplat.portable.elementary import hypot
from warpsplat.portable.filters import remap_linear
from warpsplat.portable.sequences import convolve, interp

STEP = 0.25
"""Distance of the places across a line where the ink is looked at [px]."""

EDGE = 0.12
"""Cover below which the line is left [1]."""

BROADER = 1.35
"""Where a line is that much broader than around, another one crosses it."""

AROUND = 3.0
"""Length on each side that says how wide a line is, over its width."""

MOST_AWAY = 1.0
"""How far the middle is moved at the most [px]."""


def measured(points: Floats, widths: Floats, closed: bool, cover: Floats) -> tuple[Floats, Floats]:
    """A centre line moved to the middle of the ink, and its widths.

    Args:
        points: about one a pixel [px], shape (point, 2).
        widths: about right [px], shape (point,).
        closed: whether the last joins the first.
        cover: inked share of each pixel, shape (height, width).
    """
    if len(points) < 4:
        return points, widths
    mode = "wrap" if closed else "edge"
    normals = _normals(points, closed)
    reach = 0.75 * float(np.quantile(widths, 0.9)) + 1.5
    steps = np.arange(0, reach + STEP, STEP)
    sides = []
    for sign in (1, -1):
        places = (points[:, None] + sign * steps[None, :, None] * normals[:, None]).astype(np.float32) - 0.5
        seen = remap_linear(cover, places[..., 0], places[..., 1])
        seen = np.where(np.logical_and.accumulate(seen > EDGE, axis=1), seen, 0)
        sides.append(STEP * (seen.sum(axis=1) - 0.5 * seen[:, 0]))
    found = sides[0] + sides[1]
    away = 0.5 * (sides[0] - sides[1])
    window = max(3, round(AROUND * float(np.median(found))))
    usual = _running_median(found, window, mode)
    crossed = found > BROADER * usual
    if not closed:
        crossed[[0, -1]] = True
    if crossed.all():
        return points, usual
    at = np.arange(len(points))
    away = interp(at, at[~crossed], np.clip(away[~crossed], -MOST_AWAY, MOST_AWAY))
    away = _running_mean(away, 3, mode)
    found = interp(at, at[~crossed], found[~crossed])
    return points + away[:, None] * normals, _running_mean(found, max(2, window // 3), mode)


def _normals(points: Floats, closed: bool) -> Floats:
    """Unit vectors across a line, shape (point, 2)."""
    padded = np.pad(points, ((2, 2), (0, 0)), mode="wrap" if closed else "edge")
    ways = padded[4:] - padded[:-4]
    return np.stack([-ways[:, 1], ways[:, 0]], axis=1) / np.maximum(hypot(*ways.T), 1e-9)[:, None]


def _running_median(values: Floats, reach: int, mode: str) -> Floats:
    reach = min(reach, len(values) - 1)
    padded = np.pad(values, reach, mode=mode)  # type: ignore[call-overload]
    return np.asarray(np.median(np.lib.stride_tricks.sliding_window_view(padded, 2 * reach + 1), axis=1))


def _running_mean(values: Floats, reach: int, mode: str) -> Floats:
    reach = min(reach, len(values) - 1)
    padded = np.pad(values, reach, mode=mode)  # type: ignore[call-overload]
    return convolve(padded, np.full(2 * reach + 1, 1 / (2 * reach + 1)))
