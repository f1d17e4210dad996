"""Dots: small round parts of ink that are broader than its lines, and what centre lines leave bare."""

from __future__ import annotations

import math
from typing import NamedTuple

import cv2
import numpy as np

from warpsplat.drawing.strokes.ink import Ink
from warpsplat.drawing.trace.grids import Bools, Floats, depth, dilated
from warpsplat.portable import filters
from warpsplat.portable.elementary import hypot
from warpsplat.portable.linear import principal_direction

MOST = 2000  # dots


class Dot(NamedTuple):
    """A short line, as broad as it is long or nearly so."""

    ends: Floats
    """Shape (2, 2) [px]."""
    width: float
    """[px]"""


BROADER, LEAST = 2.5, 3.0
"""Width from which on a round part of ink is a dot, over that of the lines; and at the least [px]: where thin
lines cross there is no dot."""

BROADEST, BROADEST_PX = 6.0, 20.0
"""Width up to which a round part is a dot, over that of the lines; or up to this [px]. A pen fills what is
broader."""


def round_dots(ink: Ink, width: float) -> tuple[list[Dot], Bools]:
    """Find the round parts of ink that are broader than lines of a ``width`` [px].

    Returns:
        The dots, and the pixels that they cover, shape (height, width).
    """
    fine = _fineness(ink)
    inside = _inked(ink, fine)
    away = depth(inside)
    radius = 0.5 * max(BROADER * width, LEAST) * fine
    core = away > radius
    wide = (inside & (depth(~core) <= radius)).astype(np.uint8) if core.any() else core.astype(np.uint8)
    _, parts, boxes, _ = cv2.connectedComponentsWithStats(wide)
    dots, covered = [], np.zeros(wide.shape, np.uint8)
    for number, (left, top, across, down, _) in enumerate(boxes.tolist()[: MOST + 1]):
        if number == 0 or min(across, down) > fine * max(BROADEST * width, BROADEST_PX):
            continue
        box = (slice(top, top + down), slice(left, left + across))
        own = parts[box] == number
        dot = _as_dot(own, float(away[box][own].max()))
        if dot is None:
            continue
        ends, thick = dot.ends + (left, top), dot.width
        if not _goes_on(away, ends, thick):
            _draw(covered, ends, thick)
            dots.append(Dot((ends + 0.5) / fine, thick / fine))
    return dots, filters.resize_area(covered, ink.mask.shape[::-1]) > 0.5


RIM, NARROWER = 1.6, 0.65
"""How far beside a dot its ink is measured, over its width, and how broad it may be there, over the same."""


def _goes_on(away: Floats, ends: Floats, width: float) -> bool:
    """Return whether the ink beside a dot is about as broad: then it is a part of a line."""
    reach = math.ceil(width) + 2
    left, top = np.maximum(np.floor(ends.min(axis=0)).astype(int) - reach, 0)
    right, bottom = np.ceil(ends.max(axis=0)).astype(int) + reach
    near = away[top:bottom, left:right]
    around, inner = np.zeros(near.shape, np.uint8), np.zeros(near.shape, np.uint8)
    _draw(around, ends - (left, top), RIM * width)
    _draw(inner, ends - (left, top), width)
    ring = (around > 0) & (inner == 0)
    return bool(ring.any() and near[ring].max() > NARROWER * 0.5 * width)


LIKE = 0.92  # share that a dot and its ink have of each other, at the least
LONGEST = 2.5  # length of a dot over its width; what is longer is a line


def _as_dot(own: Bools, radius: float) -> Dot | None:
    """Return the dot that a piece of ink is, in its pixels; None where it is none.

    Args:
        own: The pixels of the piece in its bounding box.
        radius: The largest distance of one of them from what is not inked.
    """
    places = np.argwhere(own)[:, ::-1].astype(np.float64)
    half = max(0.0, (len(places) - math.pi * radius * radius) / (4 * radius))
    if half > (LONGEST - 1) * radius:
        return None
    direction = principal_direction(places) if half else np.zeros(2)
    ends = places.mean(axis=0) + np.stack([-half * direction, half * direction])
    shown = np.zeros(own.shape, np.uint8)
    _draw(shown, ends, 2 * radius)
    both = int((own & (shown > 0)).sum())
    # What the box cuts off of the dot counts as well.
    either = len(places) + math.pi * radius * radius + 4 * radius * half - both
    return Dot(ends, 2 * radius) if both >= LIKE * either else None


def _draw(image: np.ndarray, ends: Floats, width: float) -> None:
    """Draw a line with round ends."""
    start, end = (tuple(place) for place in np.round(ends).astype(int).tolist())
    cv2.line(image, start, end, 1, max(1, round(width)))


VISIBLE, VISIBLE_SHARE = 0.8, 0.09
"""Half the width of bare ink from which on it is seen [px], and over the width of the broadest dot."""

MOST_IN_A_PIECE = 8  # dots in one piece of bare ink


def bare_dots(ink: Ink, lines: list[tuple[Floats, Floats, bool]], broadest: float) -> list[Dot]:
    """Return dots, nowhere beyond the ink, that cover what lines leave bare.

    Args:
        ink: Of the image.
        lines: Places [px], widths [px], and whether the last place joins the first.
        broadest: Width of a dot [px], at the most.
    """
    fine = _fineness(ink)
    inside = _inked(ink, fine)
    bare = (inside & (_drawn(lines, inside.shape, fine) == 0)).astype(np.uint8)
    found: list[Dot] = []
    away = depth(inside)
    least = max(VISIBLE, VISIBLE_SHARE * broadest) * fine
    reach = math.ceil(broadest * fine)
    _, parts, boxes, _ = cv2.connectedComponentsWithStats((depth(bare > 0) > least).astype(np.uint8))
    for number, (left, top, width, height, _) in enumerate(boxes.tolist()):
        if number == 0 or len(found) >= MOST:
            continue
        rows = slice(max(0, top - reach), top + height + reach)
        columns = slice(max(0, left - reach), left + width + reach)
        own = parts[rows, columns] == number
        for _ in range(MOST_IN_A_PIECE):
            disc = _largest_disc(bare[rows, columns], own, away[rows, columns], least, 0.5 * broadest * fine)
            if disc is None:
                break
            x, y, radius = disc
            window = np.ascontiguousarray(bare[rows, columns])
            cv2.circle(window, (x, y), round(radius), 0, -1)
            bare[rows, columns] = window
            at = np.array([columns.start + x + 0.5, rows.start + y + 0.5]) / fine
            found.append(Dot(np.stack([at, at]), 2 * radius / fine))
    return found


def _largest_disc(
    bare: np.ndarray, own: Bools, away: Floats, least: float, most: float
) -> tuple[int, int, float] | None:
    """Return the largest disc inside ink, x, y and radius, that covers the middle of a piece of bare ink.

    Args:
        bare: Where ink is bare.
        own: Where the piece is.
        away: Distance of each pixel from what is not inked.
        least: Radius of bare ink in the piece, below which there is no disc (None).
        most: Radius of the disc.
    """
    left = np.where(own, depth(bare > 0), 0)
    row, column = np.unravel_index(int(left.argmax()), left.shape)
    if left[row, column] <= least:
        return None
    y, x = np.ogrid[: left.shape[0], : left.shape[1]]
    radius = np.minimum(away, most)
    fits = radius - hypot(y - row, x - column) >= min(float(left[row, column]), most) - 1
    best = np.where(fits, radius, 0)
    row, column = np.unravel_index(int(best.argmax()), best.shape)
    return int(column), int(row), float(best[row, column])


FINE, MOST_FINE_PIXELS = 4, 16_000_000
"""Pixels on a pixel's side where ink and lines are compared, and how many there may be in all."""


def _fineness(ink: Ink) -> int:
    """Return the pixels of the fine grid on a pixel's side."""
    return max(1, min(FINE, math.isqrt(MOST_FINE_PIXELS // ink.mask.size)))


def _inked(ink: Ink, fine: int) -> Bools:
    """Return where ink is, on the fine grid."""
    size = (ink.mask.shape[1] * fine, ink.mask.shape[0] * fine)
    cover = np.where(dilated(ink.mask, 3), ink.cover, 0)
    return np.asarray(filters.resize_cubic(cover, size) > 0.5)


def _drawn(lines: list[tuple[Floats, Floats, bool]], shape: tuple[int, int], fine: int) -> np.ndarray:
    """Return where lines are, on the fine grid."""
    drawn = np.zeros(shape, np.uint8)
    for points, widths, closed in lines:
        places = np.round(points * fine - 0.5).astype(np.int32).tolist()
        thick = np.maximum(1, np.round(widths * fine)).astype(np.int32).tolist()
        for i in range(-1 if closed else 0, len(places) - 1):
            cv2.line(drawn, tuple(places[i]), tuple(places[i + 1]), 1, thick[i])
    return drawn
