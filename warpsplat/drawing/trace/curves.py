"""Polylines as few lines and cubics."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from warpsplat.drawing.trace.cheapest import cheapest_chains
from warpsplat.drawing.trace.grids import Bools, Floats
from warpsplat.drawing.trace.polylines import Polylines
from warpsplat.drawing.trace.spans import Polyline, cut_at_corners
from warpsplat.portable.elementary import hypot
from warpsplat.scene.geometry import ARC_HANDLE

AROUND = 64  # points of an outline that tell whether it is a circle
QUARTER = np.array([(1, 0), (1, ARC_HANDLE), (ARC_HANDLE, 1), (0, 1)])
QUARTERS = np.stack([QUARTER, QUARTER[:, ::-1] * (-1, 1), -QUARTER, QUARTER[:, ::-1] * (1, -1)])


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
    found: list[Pieces | None] = [_polygon(run) for run in runs]
    rings = [i for i, run in enumerate(runs) if run.closed and not run.is_polygon]
    most = [tolerances[ring] for ring in rings]
    for number, circle in fit_circles([runs[ring].points for ring in rings], most).items():
        found[rings[number]] = Pieces(circle, np.zeros(4, np.bool_))
    rest = [i for i, pieces in enumerate(found) if pieces is None]
    if rest:
        curves = _fitted([runs[i] for i in rest], [tolerances[i] for i in rest], doubt)
        for i, pieces in zip(rest, curves, strict=True):
            found[i] = _with_level_lines(pieces, runs[i].closed, tolerances[i])
    return [pieces for pieces in found if pieces is not None]


def fit_circles(rings: list[Floats], tolerances: Sequence[float]) -> dict[int, Floats]:
    """Return the four cubics of each closed outline (point, 2) that is a circle, by its number.

    ``tolerances``: how far points of each may be from it [px].
    """
    lines, which = Polylines.joined(rings, [True] * len(rings)), np.repeat(np.arange(len(rings)), AROUND)
    places = lines.totals[which] * np.tile(np.arange(AROUND) / AROUND, len(rings))
    points = lines.at(which, places).reshape(-1, AROUND, 2)
    center = points.mean(axis=1)
    away = hypot(*(points - center[:, None]).transpose(2, 0, 1))
    radius = away.mean(axis=1)
    near = np.flatnonzero(np.abs(away - radius[:, None]).max(axis=1) <= np.asarray(tolerances)).tolist()
    made = {i: center[i] + radius[i] * QUARTERS for i in near}
    return {
        i: made[i] if area > 0 else made[i][::-1, ::-1]
        for i, area in zip(near, areas_of(points[near]), strict=True)
    }


def areas_of(points: Floats) -> Floats:
    """Return the signed areas of polygons (polygon, point, 2), those of clockwise ones positive."""
    x, y = points[..., 0], points[..., 1]
    doubled: Floats = (x * np.roll(y, -1, axis=1) - np.roll(x, -1, axis=1) * y).sum(axis=1)
    return doubled / 2


def straight(start: Floats, end: Floats) -> Floats:
    """Return lines between points (..., 2) as cubics, shape (..., 4, 2)."""
    return start[..., None, :] + (end - start)[..., None, :] * (np.arange(4)[:, None] / 3)


def _polygon(run: Polyline) -> Pieces | None:
    if not run.is_polygon:
        return None
    cubics = straight(run.points[:-1], run.points[1:])
    return Pieces(cubics, np.ones(len(cubics), np.bool_))


def _fitted(runs: list[Polyline], tolerances: Sequence[float], doubt: Floats | None) -> list[Pieces]:
    """Return the cheapest lines and cubics for each run, no polygons."""
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
