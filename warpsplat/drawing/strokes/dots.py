"""Dots: small round parts of ink that are broader than its lines, and what centre lines leave bare."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple

import cv2
import numpy as np

from warpsplat.drawing.strokes.ink import Ink
from warpsplat.drawing.trace.grids import Bools, Floats
from warpsplat.portable import filters
from warpsplat.portable.elementary import hypot
from warpsplat.portable.linear import principal_direction

FINE, ROOM = 4, 16_000_000
"""Pixels on a pixel's side where ink and lines are compared, and how many there may be; a large picture has
fewer on a side.
"""

DEEP, SHARE = 0.8, 0.09
"""Half the width of bare ink from which on it is seen [px], and over the width of the broadest dot."""

ROUNDS = 8
"""Dots in one piece of bare ink, at the most."""

MOST = 2000
"""Dots, at the most."""

BROADER = 2.5
"""Width from which on a round part of ink is a dot, over that of the lines."""

LEAST = 3.0
"""The same in pixels: where thin lines cross there is no dot."""

BROADEST, BROAD_DOT = 6.0, 20.0
"""Width up to which a round part is a dot, over that of the lines, or up to this [px]; a pen fills what is
broader.
"""

LIKE = 0.92
"""Share that a dot and its ink have of each other, at the least."""

LONGEST = 2.5
"""Length of a dot over its width, at the most: what is longer is a line."""


BESIDE, NARROWER = 1.6, 0.65
"""How far beside a dot its ink is looked at, over its width, and how broad it may be there, over the same."""


class Dot(NamedTuple):
    """A short line, as broad as it is long or nearly so."""

    ends: Floats
    """Shape (2, 2) [px]."""
    width: float
    """[px]"""


def round_dots(ink: Ink, width: float) -> tuple[list[Dot], Bools]:
    """The round parts of ink that are broader than lines of a ``width`` [px].

    Returns:
        the dots, and the pixels that they cover, shape (height, width).
    """
    fine = _fineness(ink)
    inside = _inked(ink, fine)
    depth = _depth(inside)
    radius = 0.5 * max(BROADER * width, LEAST) * fine
    core = depth > radius
    wide = (inside & (_depth(~core) <= radius)).astype(np.uint8) if core.any() else core.astype(np.uint8)
    _, parts, boxes, _ = cv2.connectedComponentsWithStats(wide)
    dots, covered = [], np.zeros(wide.shape, np.uint8)
    for number, (left, top, across, down, _) in enumerate(boxes.tolist()):
        if number == 0 or number > MOST or min(across, down) > fine * max(BROADEST * width, BROAD_DOT):
            continue
        box = (slice(top, top + down), slice(left, left + across))
        own = parts[box] == number
        dot = _round(own, float(depth[box][own].max()))
        if dot is None:
            continue
        ends, thick = dot
        ends = ends + (left, top)
        if _goes_on(depth, ends, thick):
            continue
        _stroke(covered, ends, thick)
        dots.append(Dot((ends + 0.5) / fine, thick / fine))
    return dots, filters.resize_area(covered, ink.mask.shape[::-1]) > 0.5


def _goes_on(depth: Floats, ends: Floats, width: float) -> bool:
    """Whether the ink beside a dot on the fine grid is about as broad: then it is a part of a line."""
    reach = math.ceil(width) + 2
    left, top = np.maximum(np.floor(ends.min(axis=0)).astype(int) - reach, 0)
    right, bottom = np.ceil(ends.max(axis=0)).astype(int) + reach
    near = depth[top:bottom, left:right]
    around, inner = np.zeros(near.shape, np.uint8), np.zeros(near.shape, np.uint8)
    _stroke(around, ends - (left, top), BESIDE * width)
    _stroke(inner, ends - (left, top), width)
    ring = (around > 0) & (inner == 0)
    return bool(ring.any() and near[ring].max() > NARROWER * 0.5 * width)


def _round(own: Bools, radius: float) -> tuple[Floats, float] | None:
    """Ends and width of the dot that a piece of ink is, on the fine grid; None where it is none."""
    places = np.argwhere(own)[:, ::-1].astype(np.float64)
    half = max(0.0, (len(places) - math.pi * radius * radius) / (4 * radius))
    if half > (LONGEST - 1) * radius:
        return None
    middle = places.mean(axis=0)
    way = principal_direction(places) if half else np.zeros(2)
    ends = middle + np.stack([-half * way, half * way])
    shown = np.zeros(own.shape, np.uint8)
    _stroke(shown, ends, 2 * radius)
    both = int((own & (shown > 0)).sum())
    # What the box cuts off of the dot counts as well.
    either = len(places) + math.pi * radius * radius + 4 * radius * half - both
    return (ends, 2 * radius) if both >= LIKE * either else None


def _stroke(image: np.ndarray, ends: Floats, width: float) -> None:
    """Draw a line with round ends."""
    start, end = (tuple(place) for place in np.round(ends).astype(int).tolist())
    cv2.line(image, start, end, 1, max(1, round(width)))


def without(ink: Ink, covered: Bools) -> Ink:
    """Ink but for what is ``covered``, shape (height, width)."""
    cover = np.where(covered, 0, ink.cover).astype(np.float32)
    return replace(ink, mask=ink.mask & ~covered, cover=cover)


def bare_dots(ink: Ink, lines: list[tuple[Floats, Floats, bool]], broadest: float) -> list[Dot]:
    """Dots on the ink that lines leave bare, which go nowhere beyond it.

    Args:
        ink: of the picture.
        lines: places [px], widths [px], and whether the last place joins the first.
        broadest: width of a dot [px], at the most.
    """
    fine = _fineness(ink)
    inside = _inked(ink, fine)
    bare = (inside & (_drawn(lines, inside.shape, fine) == 0)).astype(np.uint8)
    found: list[Dot] = []
    depth = _depth(inside)
    least = max(DEEP, SHARE * broadest) * fine
    _, parts, boxes, _ = cv2.connectedComponentsWithStats((_depth(bare > 0) > least).astype(np.uint8))
    for number, (left, top, width, height, _) in enumerate(boxes.tolist()):
        if number == 0 or len(found) >= MOST:
            continue
        reach = math.ceil(broadest * fine)
        rows = slice(max(0, top - reach), top + height + reach)
        columns = slice(max(0, left - reach), left + width + reach)
        own = parts[rows, columns] == number
        for _ in range(ROUNDS):
            place = _dot(bare[rows, columns], own, depth[rows, columns], least, 0.5 * broadest * fine)
            if place is None:
                break
            x, y, radius = place
            window = np.ascontiguousarray(bare[rows, columns])
            cv2.circle(window, (x, y), round(radius), 0, -1)
            bare[rows, columns] = window
            at = np.array([columns.start + x + 0.5, rows.start + y + 0.5]) / fine
            found.append(Dot(np.stack([at, at]), 2 * radius / fine))
    return found


def _dot(
    bare: np.ndarray, own: Bools, depth: Floats, least: float, most: float
) -> tuple[int, int, float] | None:
    """The largest disc inside ink that covers the middle of what is bare of a piece, if that is so deep."""
    left = np.where(own, _depth(bare > 0), 0)
    row, column = np.unravel_index(int(left.argmax()), left.shape)
    if left[row, column] <= least:
        return None
    y, x = np.ogrid[: left.shape[0], : left.shape[1]]
    radius = np.minimum(depth, most)
    room = radius - hypot(y - row, x - column)
    fits = room >= min(float(left[row, column]), most) - 1
    best = np.where(fits, radius, 0)
    row, column = np.unravel_index(int(best.argmax()), best.shape)
    return int(column), int(row), float(best[row, column])


def _fineness(ink: Ink) -> int:
    """Pixels of the fine grid on a pixel's side."""
    return max(1, min(FINE, math.isqrt(ROOM // ink.mask.size)))


def _inked(ink: Ink, fine: int) -> Bools:
    """Where ink is, on the fine grid."""
    size = (ink.mask.shape[1] * fine, ink.mask.shape[0] * fine)
    near = cv2.dilate(ink.mask.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
    cover = filters.resize_cubic(np.where(near, ink.cover, 0), size)
    return np.asarray(cover > 0.5, np.bool_)


def _drawn(lines: list[tuple[Floats, Floats, bool]], shape: tuple[int, int], fine: int) -> np.ndarray:
    """Where strokes are, on the fine grid."""
    drawn = np.zeros(shape, np.uint8)
    for points, widths, closed in lines:
        places = np.round(points * fine - 0.5).astype(np.int32)
        thick = np.maximum(1, np.round(widths * fine)).astype(np.int32).tolist()
        pairs = range(-1 if closed else 0, len(places) - 1)
        for i in pairs:
            cv2.line(drawn, tuple(places[i].tolist()), tuple(places[i + 1].tolist()), 1, thick[i])
    return drawn


def _depth(inside: np.ndarray) -> Floats:
    """Distance of each pixel from those not inside."""
    return filters.distance(np.pad(inside, 1))[1:-1, 1:-1]
