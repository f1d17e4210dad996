"""Filled areas of ink told apart from its lines."""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np

from warpsplat.drawing.strokes.blobs import BROAD, SMALLEST, pen_width
from warpsplat.drawing.strokes.ink import Ink
from warpsplat.drawing.trace.grids import Bools, Floats, Ints, at_pixels, depth, dilated, eroded
from warpsplat.portable import filters
from warpsplat.portable.elementary import hypot
from warpsplat.scene import FloatArray

LINE, LINE_SHARE = 2.5, 0.006  # half the width of the broadest line [px], and over the longer side of
# the image, if that is more
NARROW = 1.6  # width down to which a part of an area belongs to it, over the width of the lines
TIP = 3.0  # how far narrower corners and tips may reach, over the same; what reaches further is a line
NEARBY = 15  # [px] side of the window whose mean colour is that of an area or of the paper


@dataclass(frozen=True)
class Areas:
    """Broad parts of ink."""

    labels: Ints
    """Number of the area that each pixel is in, 0 for none; shape (height, width)."""
    cover: FloatArray
    """Share of each pixel that areas cover, shape (height, width)."""

    def __len__(self) -> int:
        return int(self.labels.max())

    def color(self, shown: FloatArray, numbers: Ints) -> FloatArray:
        """Return the median colour of some areas, shape (3,).

        Args:
            shown: The image, shape (height, width, 3).
            numbers: Of the areas.
        """
        inside = _inner(np.isin(self.labels, numbers))
        return np.asarray(np.median(shown[inside], axis=0), np.float32)

    def outlines(self) -> list[Floats]:
        """Return points along the inner edge of each area, which have its colour, shape (point, 2) each."""
        found: list[Floats] = []
        for number in range(1, len(self) + 1):
            inside = _inner(self.labels == number).astype(np.uint8)
            rings, _ = cv2.findContours(inside, cv2.RETR_LIST, cv2.CHAIN_APPROX_NONE)
            found.append(np.concatenate([ring.reshape(-1, 2) for ring in rings]) + 0.5)
        return found


def _inner(inside: Bools) -> Bools:
    """Return a mask without its edge, whose colour is mixed; all of it where that leaves nothing."""
    inner = eroded(inside, 5)
    return inner if inner.any() else inside


def split_areas(ink: Ink) -> tuple[Ink, Areas | None]:
    """Return ink without its filled areas, and these; None where there are none.

    An area is much broader than the lines in one place, and only at corners and tips as narrow.
    """
    width = min(pen_width(ink.mask), 2 * max(LINE, LINE_SHARE * max(ink.mask.shape)))
    away = depth(ink.mask).astype(np.float64)
    if (away <= BROAD * width).all():
        return ink, None
    radius = 0.5 * NARROW * width + 0.5
    wide = ink.mask & (distance_from(away > radius) <= radius)
    _, parts = cv2.connectedComponents(wide.astype(np.uint8), connectivity=4)
    area = wide & np.isin(parts, np.unique(parts[away > BROAD * width]))
    area |= _tips(ink.mask & ~area, distance_from(area), TIP * width)
    lines = ink.mask & ~area
    cover = _cover(ink.shown, area, lines)
    _, labels = cv2.connectedComponents(area.astype(np.uint8), connectivity=8)
    thin = replace(ink, mask=lines, cover=np.where(cover > 0, 0, ink.cover).astype(np.float32))
    return thin, Areas(labels, cover)


def _cover(shown: FloatArray, area: Bools, lines: Bools) -> FloatArray:
    """Return the share of each pixel that areas cover, at their edge by its colour between paper and area."""
    deep = eroded(area, 3)
    full, paper = (_mean_nearby(shown, where) for where in (deep, ~dilated(area | lines, 5)))
    contrast = full - paper
    share = ((shown - paper) * contrast).sum(axis=2) / np.maximum((contrast**2).sum(axis=2), 1e-6)
    return np.asarray(
        np.where(deep, 1, np.where(dilated(area, 3) & ~lines, np.clip(share, 0, 1), 0)), np.float32
    )


def _mean_nearby(shown: FloatArray, where: Bools) -> FloatArray:
    """Return the mean colour of the pixels ``where`` nearby; of all of them, where none is near."""
    weights = where.astype(np.float32)
    count = filters.box_sum(weights, NEARBY)[..., None]
    sums = filters.box_sum(shown * weights[..., None], NEARBY)
    mean = shown[where].mean(axis=0) if where.any() else shown.reshape(-1, 3).mean(axis=0)
    return np.asarray(np.where(count > 0.5, sums / np.maximum(count, 1), mean), np.float32)


def distance_from(inside: Bools) -> Floats:
    """Return the distance of each pixel from those inside [px]."""
    return filters.distance(~inside).astype(np.float64)


def _tips(rest: Bools, away: Floats, reach: float) -> Bools:
    """Return the components of ``rest`` that touch an area and go no further than ``reach`` from it."""
    count, parts = cv2.connectedComponents(rest.astype(np.uint8), connectivity=8)
    farthest, nearest = np.zeros(count), np.full(count, np.inf)
    np.maximum.at(farthest, np.asarray(parts, np.intp), away)
    np.minimum.at(nearest, np.asarray(parts, np.intp), away)
    held = (nearest < 2) & (farthest <= reach)
    held[0] = False
    return np.asarray(held[parts], np.bool_)


def is_beside(points: Floats, widths: Floats, away: Floats) -> bool:
    """Return whether a line leaves the areas by no more than its width: it is the rest of a corner.

    Args:
        points: Shape (point, 2) [px].
        widths: There [px], shape (point,).
        away: Distance of each pixel from the areas [px], shape (height, width).
    """
    return bool((at_pixels(away, points) <= widths + 1).all())


def with_ends_in_areas(points: Floats, widths: Floats, away: Floats) -> tuple[Floats, Floats]:
    """Extend the ends of an open line that lie at an area into it, by the line's width, so that no gap shows.

    Arguments are those of ``is_beside``.
    """
    for _ in range(2):  # the end, and the other one
        wide, apart = float(widths[-1]), float(at_pixels(away, points[-1:])[0])
        if apart <= wide + 1:
            back = points[-1] - points[max(0, len(points) - 1 - max(SMALLEST, round(2 * wide)))]
            direction = back / max(float(hypot(*back)), 1e-9)
            points = np.concatenate([points, points[-1:] + (apart + wide) * direction])
            widths = np.append(widths, wide)
        points, widths = points[::-1], widths[::-1]
    return points, widths
