"""Filled areas of ink told apart from its lines: what stays a fill where both may be."""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np

from warpsplat.drawing.strokes.blobs import BROAD, SMALLEST, pen_width
from warpsplat.drawing.strokes.ink import Ink
from warpsplat.drawing.trace.grids import Bools, Floats, Ints
from warpsplat.drawing.trace.subject import LINE, THIN
from warpsplat.portable import filters
from warpsplat.portable.elementary import hypot
from warpsplat.scene import FloatArray

NARROW = 1.6
"""Width down to which parts of an area belong to it, over the width of the lines."""

TIP = 3.0
"""How far what is narrower may reach beyond, over the same: corners and tips do; what reaches further is a
line.
"""

BESIDE = 15
"""Side of the window that says what the colours of an area and of the paper are [px]."""

DEEP = np.ones((5, 5), np.uint8)
"""What lies all inside an area where its colour is looked at, if it is that broad [px]."""


@dataclass(frozen=True)
class Areas:
    """Broad parts of ink."""

    labels: Ints
    """Number of the area that each pixel is in, 0: none; shape (height, width)."""
    cover: FloatArray
    """Share of each pixel that areas cover, shape (height, width)."""

    def __len__(self) -> int:
        return int(self.labels.max())

    def color(self, shown: FloatArray, numbers: Ints) -> FloatArray:
        """The usual colour of some areas, shape (3,).

        Args:
            shown: the picture, shape (height, width, 3).
            numbers: of the areas.
        """
        inside = np.isin(self.labels, numbers)
        deep = cv2.erode(inside.astype(np.uint8), DEEP) > 0
        return np.asarray(np.median(shown[deep if deep.any() else inside], axis=0), np.float32)

    def outlines(self) -> list[Floats]:
        """Places inside along the edge of each area, where its colour is, shape (point, 2) each [px]."""
        found: list[Floats] = []
        for number in range(1, len(self) + 1):
            inside = (self.labels == number).astype(np.uint8)
            deep = cv2.erode(inside, DEEP)
            rings, _ = cv2.findContours(deep if deep.any() else inside, cv2.RETR_LIST, cv2.CHAIN_APPROX_NONE)
            found.append(np.concatenate([ring.reshape(-1, 2) for ring in rings]) + 0.5)
        return found


def parted(ink: Ink) -> tuple[Ink, Areas | None]:
    """Ink without its filled areas, and these; None where there are none.

    An area is somewhere much broader than the lines and nowhere as narrow, but for corners and tips.
    """
    width = min(pen_width(ink.mask), 2 * max(LINE, THIN * max(ink.mask.shape)))
    depth = away_from(~np.pad(ink.mask, 1))[1:-1, 1:-1]
    if (depth <= BROAD * width).all():
        return ink, None
    radius = 0.5 * NARROW * width + 0.5
    wide = ink.mask & (away_from(depth > radius) <= radius)
    _, parts = cv2.connectedComponents(wide.astype(np.uint8), connectivity=4)
    area = wide & np.isin(parts, np.unique(parts[depth > BROAD * width]))
    area |= _corners(ink.mask & ~area, away_from(area), TIP * width)
    lines = ink.mask & ~area
    cover = _cover(ink.shown, area, lines)
    _, labels = cv2.connectedComponents(area.astype(np.uint8), connectivity=8)
    thin = replace(ink, mask=lines, cover=np.where(cover > 0, 0, ink.cover).astype(np.float32))
    return thin, Areas(labels, cover)


def _cover(shown: FloatArray, area: Bools, lines: Bools) -> FloatArray:
    """Share of each pixel that areas cover: at their edge, how far its colour is from the paper
    nearby to the area.
    """
    kernel = np.ones((3, 3), np.uint8)
    deep = cv2.erode(area.astype(np.uint8), kernel) > 0
    near = cv2.dilate(area.astype(np.uint8), kernel) > 0
    blank = cv2.dilate((area | lines).astype(np.uint8), np.ones((5, 5), np.uint8)) == 0
    full, paper = (_around(shown, where) for where in (deep, blank))
    way = full - paper
    share = ((shown - paper) * way).sum(axis=2) / np.maximum((way**2).sum(axis=2), 1e-6)
    return np.asarray(np.where(deep, 1, np.where(near & ~lines, np.clip(share, 0, 1), 0)), np.float32)


def _around(shown: FloatArray, where: Bools) -> FloatArray:
    """Mean colour nearby of the pixels that count; of all that do, where none is near."""
    weights = where.astype(np.float32)
    count = filters.box_sum(weights, BESIDE)[..., None]
    sums = filters.box_sum(shown * weights[..., None], BESIDE)
    mean = shown[where].mean(axis=0) if where.any() else shown.reshape(-1, 3).mean(axis=0)
    return np.asarray(np.where(count > 0.5, sums / np.maximum(count, 1), mean), np.float32)


def away_from(inside: Bools) -> Floats:
    """Distance of each pixel from those inside [px]."""
    return filters.distance(~inside).astype(np.float64)


def _corners(rest: Bools, away: Floats, reach: float) -> Bools:
    """The parts of ``rest`` that touch an area and go no further than ``reach`` from it."""
    count, parts = cv2.connectedComponents(rest.astype(np.uint8), connectivity=8)
    farthest, nearest = np.zeros(count), np.full(count, np.inf)
    np.maximum.at(farthest, np.asarray(parts, np.intp), away)
    np.minimum.at(nearest, np.asarray(parts, np.intp), away)
    held = (nearest < 2) & (farthest <= reach)
    held[0] = False
    return np.asarray(held[parts], np.bool_)


def is_beside(points: Floats, widths: Floats, away: Floats) -> bool:
    """Whether a line leaves the areas by no more than its width: what is left there of corners.

    Args:
        points: shape (point, 2) [px].
        widths: there [px], shape (point,).
        away: distance of each pixel from the areas [px], shape (height, width).
    """
    return bool((_at(away, points) <= widths + 1).all())


def reaching(points: Floats, widths: Floats, away: Floats) -> tuple[Floats, Floats]:
    """An open line whose ends at an area go on into it, by the line's width, so that no gap is seen.

    Args: as ``is_beside``.
    """
    for _ in range(2):  # the end, and the other one
        wide, apart = float(widths[-1]), float(_at(away, points[-1:])[0])
        if apart <= wide + 1:
            back = points[-1] - points[max(0, len(points) - 1 - max(SMALLEST, round(2 * wide)))]
            way = back / max(float(hypot(*back)), 1e-9)
            points = np.concatenate([points, points[-1:] + (apart + wide) * way])
            widths = np.append(widths, wide)
        points, widths = points[::-1], widths[::-1]
    return points, widths


def _at(values: Floats, points: Floats) -> Floats:
    """Of the pixels that points lie in, or the nearest ones of the picture."""
    height, width = values.shape
    columns, rows = points.astype(np.intp).T
    return np.asarray(values[np.clip(rows, 0, height - 1), np.clip(columns, 0, width - 1)])
