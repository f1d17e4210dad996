"""Polylines as few lines and cubics."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from warpsplat.drawing.trace.cheapest import cheapest_chains
from warpsplat.drawing.trace.grids import Bools, Floats
from warpsplat.drawing.trace.spans import Polyline, cut_at_corners


@dataclass(frozen=True)
class Pieces:
    """Cubics in a row."""

    cubics: Floats
    """Control points, shape (piece, 4, 2); each begins where the one before ends."""
    lines: Bools
    """Which are straight, shape (piece,)."""


def fit_polylines(
    runs: list[Polyline], tolerances: Sequence[float], doubt: Floats | None = None
) -> list[Pieces]:
    """Return lines and cubics for each run.

    Args:
        runs: Parts of outlines.
        tolerances: Largest distance of a point of each from its curve [px].
        doubt: As for ``find_corners``.
    """
    if not runs:
        return []
    curves = _fitted(runs, tolerances, doubt)
    return [
        _with_level_lines(pieces, run.closed, tolerance)
        for pieces, run, tolerance in zip(curves, runs, tolerances, strict=True)
    ]


def areas_of(points: Floats) -> Floats:
    """Return the signed areas of polygons (polygon, point, 2), those of clockwise ones positive."""
    x, y = points[..., 0], points[..., 1]
    doubled: Floats = (x * np.roll(y, -1, axis=1) - np.roll(x, -1, axis=1) * y).sum(axis=1)
    return doubled / 2


def straight(start: Floats, end: Floats) -> Floats:
    """Return lines between points (..., 2) as cubics, shape (..., 4, 2)."""
    return start[..., None, :] + (end - start)[..., None, :] * (np.arange(4)[:, None] / 3)


def _fitted(runs: list[Polyline], tolerances: Sequence[float], doubt: Floats | None) -> list[Pieces]:
    """Return the cheapest lines and cubics for each run."""
    spans = cut_at_corners(runs, tolerances, doubt)
    chains = cheapest_chains(spans, np.asarray(tolerances)[spans.owner])
    owner = spans.owner[chains.span]
    order = np.argsort(owner, kind="stable")
    lines, curves = chains.is_line[order], chains.cubics[order]
    curves = np.where(lines[:, None, None], straight(curves[:, 0], curves[:, 3]), curves)
    bounds = np.searchsorted(owner[order], np.arange(len(runs) + 1)).tolist()
    return [Pieces(curves[low:high], lines[low:high]) for low, high in itertools.pairwise(bounds)]


LEVEL_SLOPE = 0.012  # up to which a line is made horizontal or vertical
LEVEL_OFF = 1.2  # of its ends from that, over the tolerance, at the most
LEAST_LEVEL = 1.5  # [px] length of such a line


def _with_level_lines(pieces: Pieces, closed: bool, tolerance: float) -> Pieces:
    """Return the pieces of a run, with lines made horizontal or vertical where they nearly are."""
    cubics, lines = pieces.cubics, pieces.lines
    count = len(cubics)
    for k in np.flatnonzero(lines).tolist():
        chord = cubics[k, 3] - cubics[k, 0]
        for axis in (0, 1):
            limit = min(LEVEL_OFF * tolerance, LEVEL_SLOPE * abs(chord[1 - axis]) + 0.02)
            if 0 < abs(chord[axis]) <= limit and abs(chord[1 - axis]) > LEAST_LEVEL:
                value = 0.5 * (cubics[k, 0, axis] + cubics[k, 3, axis])
                if closed or k > 0:
                    _move_end(cubics[(k - 1) % count, ::-1, axis], value)
                if closed or k + 1 < count:
                    _move_end(cubics[(k + 1) % count, :, axis], value)
                cubics[k, :, axis] = value
    cubics[lines] = straight(cubics[lines, 0], cubics[lines, 3])
    return Pieces(cubics, lines)


def _move_end(coordinates: Floats, value: float) -> None:
    """Move the first of a cubic's four coordinates to ``value``, with its handle, in place."""
    coordinates[1] += value - coordinates[0]
    coordinates[0] = value
