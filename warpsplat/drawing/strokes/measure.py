"""Where exactly the middle of a line of ink is, and how wide it is, from the cover of its pixels."""

from __future__ import annotations

import numpy as np

from warpsplat.drawing.trace.grids import Floats
from warpsplat.portable.elementary import hypot
from warpsplat.portable.filters import remap_linear
from warpsplat.portable.sequences import convolve, interp

STEP = 0.25  # [px] between the places across a line where the ink is measured
EDGE = 0.12  # cover below which the line ends
CROSSED = 1.35  # width from which on another line crosses there, over the usual width around
AROUND = 3.0  # length on each side that tells the usual width, over this
MOST_MOVED = 1.0  # [px] that the middle is moved


def measured(points: Floats, widths: Floats, closed: bool, cover: Floats) -> tuple[Floats, Floats]:
    """Return a centre line moved to the middle of the ink, and its widths.

    Args:
        points: About one a pixel [px], shape (point, 2).
        widths: About right [px], shape (point,).
        closed: Whether the last joins the first.
        cover: Inked share of each pixel, shape (height, width).
    """
    if len(points) < 4:
        return points, widths
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
    usual = np.median(_windows(found, window, closed), axis=1)
    crossed = found > CROSSED * usual
    if not closed:
        crossed[[0, -1]] = True
    if crossed.all():
        return points, usual
    at = np.arange(len(points))
    away = interp(at, at[~crossed], np.clip(away[~crossed], -MOST_MOVED, MOST_MOVED))
    found = interp(at, at[~crossed], found[~crossed])
    away = _running_mean(away, 3, closed)
    return points + away[:, None] * normals, _running_mean(found, max(2, window // 3), closed)


def _normals(points: Floats, closed: bool) -> Floats:
    """Return unit vectors across a line, shape (point, 2)."""
    padded = np.pad(points, ((2, 2), (0, 0)), mode="wrap" if closed else "edge")
    along = padded[4:] - padded[:-4]
    return np.stack([-along[:, 1], along[:, 0]], axis=1) / np.maximum(hypot(*along.T), 1e-9)[:, None]


def _windows(values: Floats, reach: int, closed: bool) -> Floats:
    """Return the values around each one, shape (value, window)."""
    reach = min(reach, len(values) - 1)
    padded = np.pad(values, reach, mode="wrap" if closed else "edge")
    return np.lib.stride_tricks.sliding_window_view(padded, 2 * reach + 1)


def _running_mean(values: Floats, reach: int, closed: bool) -> Floats:
    reach = min(reach, len(values) - 1)
    padded = np.pad(values, reach, mode="wrap" if closed else "edge")
    return convolve(padded, np.full(2 * reach + 1, 1 / (2 * reach + 1)))
