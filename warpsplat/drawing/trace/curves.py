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
from warpsplat.svg.primitives import Primitive

AROUND = 64  # points of an outline that tell whether it is a circle


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
    found: list[Pieces | None] = [None] * len(runs)
    rings = [i for i, run in enumerate(runs) if run.closed]
    most = [tolerances[ring] for ring in rings]
    for number, circle in fit_circles([runs[ring].points for ring in rings], most).items():
        found[rings[number]] = Pieces(circle, np.zeros(4, np.bool_))
    rest = [i for i, pieces in enumerate(found) if pieces is None]
    if rest:
        curves = _fitted([runs[i] for i in rest], [tolerances[i] for i in rest], doubt)
        for i, pieces in zip(rest, curves, strict=True):
            found[i] = pieces
    return [pieces for pieces in found if pieces is not None]


def fit_circles(rings: list[Floats], tolerances: Sequence[float]) -> dict[int, Floats]:
    """Return the four cubics of each closed outline (point, 2) that is a circle, by its number.

    ``tolerances``: how far points of each may be from it [px].
    """
    lines = Polylines(rings, [True] * len(rings))
    points = lines.at(np.arange(len(rings))[:, None], lines.totals[:, None] * (np.arange(AROUND) / AROUND))
    center = points.mean(axis=1)
    away = hypot(*(points - center[:, None]).transpose(2, 0, 1))
    radius = away.mean(axis=1)
    near = np.abs(away - radius[:, None]).max(axis=1) <= np.asarray(tolerances)
    (left, top), (right, bottom) = (center - radius[:, None]).T, (center + radius[:, None]).T
    found = dict[int, Floats]()
    is_clockwise = areas_of(points) > 0
    for i in np.flatnonzero(near).tolist():
        box = (left[i], top[i]), (right[i], bottom[i])
        found[i] = Primitive(*box, (radius[i], radius[i]), bool(is_clockwise[i])).cubics()
    return found


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
