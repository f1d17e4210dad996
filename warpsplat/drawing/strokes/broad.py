"""Ink much broader than its lines: round dots, and areas, which stay or which rings fill."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import cv2
import numpy as np

from warpsplat.drawing.strokes.ink import WIDEST, Ink
from warpsplat.drawing.trace.grids import Bools, Floats, Ints, bounding_boxes, depth, dilated
from warpsplat.portable import filters
from warpsplat.portable.elementary import hypot
from warpsplat.scene import FloatArray

USUAL = 0.75  # quantile of the width along all lines that counts as theirs: much of the rest is texture
BROAD = 2.0  # half the width from which on ink is no line, over the usual width
THINNEST = 1.2  # usual width of lines, at the least [px]: masks have no half pixels
OVERLAP = 0.15  # of neighbouring rings, over their width
OFF = 0.2
"""Most by which an outline is off in the mean where strokes draw it [px]."""


class Dot(NamedTuple):
    """A round part of ink."""

    place: Floats
    """Shape (2,) [px]."""
    width: float
    """[px]"""


@dataclass(frozen=True)
class Areas:
    """Broad parts of ink that stay areas."""

    labels: Ints
    """Number of the area that each pixel is in, 0 for none; shape (height, width)."""
    cover: FloatArray
    """Share of each pixel that areas cover, shape (height, width)."""

    def places(self) -> list[Floats]:
        """Return the pixels of each area, shape (pixel, 2)."""
        return [np.argwhere(self.labels == n)[:, ::-1] + 0.5 for n in range(1, int(self.labels.max()) + 1)]


@dataclass(frozen=True)
class Split:
    """Ink by how it is drawn."""

    thin: Ink
    """The ink that is drawn along its centre lines."""
    width: float = 1.0
    """The usual width of lines, and that of rings [px]."""
    rings: list[Floats] = field(default_factory=list)
    """Closed lines that fill what is broad, shape (point, 2) each [px]."""
    dots: list[Dot] = field(default_factory=list)
    areas: Areas | None = None
    apart: Bools | None = None
    """The pixels of areas or of dots; None if there are none."""


def pen_width(mask: Bools) -> float:
    """Return the usual width of the lines in a mask [px]."""
    away = np.minimum(filters.distance(mask), sum(mask.shape))  # infinite where all is ink
    ridge = mask & (away >= cv2.dilate(away, np.ones((3, 3), np.uint8)))
    return max(THINNEST, 2 * float(np.quantile(away[ridge], USUAL)) - 1) if ridge.any() else THINNEST


def split(ink: Ink, *, mixed: bool, ring_width: float | None = None) -> Split:
    """Tell lines from what is much broader: areas if ``mixed``, else dots and what rings fill.

    ``ring_width``: that of all rings, if they have a given one [px]: no dot is broader.
    """
    width = pen_width(ink.mask)
    if mixed:
        width = min(width, max(THINNEST, WIDEST * max(ink.mask.shape)))
    away = depth(ink.mask) - 0.5
    if (away <= BROAD * width).all():
        return Split(ink, width)
    labels = _broad_parts(ink.mask, away, width)
    if mixed:
        return _with_areas(ink, labels, width)
    if ring_width is None:
        return _with_dots_and_rings(ink, labels, away, width, _find_dots(ink, labels))
    return _with_dots_and_rings(ink, labels, away, max(THINNEST, ring_width), {})


def _broad_parts(mask: Bools, away: Floats, width: float) -> Ints:
    """Return the number of the broad part that each pixel is in, with its corners and tips; 0 for none.

    Narrower ink belongs to it up to where it is as narrow as a line, and if it goes on no further than a
    line of ``width`` that is just not broad.
    """
    wide = mask & (distance_from(away > width) < width)
    _, parts = cv2.connectedComponents(wide.astype(np.uint8), connectivity=4)
    broad = wide & np.isin(parts, np.unique(parts[away > BROAD * width]))
    rest, beyond = mask & ~broad, distance_from(broad)
    count, parts = cv2.connectedComponents(rest.astype(np.uint8), connectivity=8)
    farthest, nearest = np.zeros(count), np.full(count, np.inf)
    np.maximum.at(farthest, np.asarray(parts, np.intp), beyond)
    np.minimum.at(nearest, np.asarray(parts, np.intp), beyond)
    held = (nearest < 2) & (farthest <= 2 * BROAD * width)
    _, labels = cv2.connectedComponents((broad | (rest & held[parts])).astype(np.uint8), connectivity=8)
    return np.asarray(labels)


def _with_areas(ink: Ink, labels: Ints, width: float) -> Split:
    lines = ink.mask & (labels == 0)
    edge = dilated(labels > 0, 3) & (~lines | (ink.cover < 1))
    cover = np.where(edge, ink.cover, 0).astype(np.float32)
    thin = replace(ink, mask=lines, cover=np.where(cover > 0, 0, ink.cover).astype(np.float32))
    return Split(thin, width, areas=Areas(labels, cover), apart=labels > 0)


def _find_dots(ink: Ink, labels: Ints) -> dict[int, Dot]:
    """Return the dots among broad parts, by the parts' numbers."""
    dots = {}
    for number, box in enumerate(bounding_boxes(labels - 1, int(labels.max())), 1):
        left, top = max(0, box.left - 1), max(0, box.top - 1)
        window = np.s_[top : box.bottom + 1, left : box.right + 1]
        dot = _as_dot(np.where(dilated(labels[window] == number, 3), ink.cover[window], 0))
        if dot is not None:
            dots[number] = dot._replace(place=dot.place + (left, top))
    return dots


def _with_dots_and_rings(ink: Ink, labels: Ints, away: Floats, width: float, dots: dict[int, Dot]) -> Split:
    """Return broad parts that are no dots hollow but for a line around them, and rings that fill these."""
    round_ = np.isin(labels, list(dots))
    inner = (away > width) & (labels > 0) & ~round_
    rings: list[Floats] = []
    step = (1 - OVERLAP) * width
    for level in np.arange(width + 0.5 * width - OVERLAP * width, float(away.max()), step):
        found, _ = cv2.findContours(
            (inner & (away > level)).astype(np.uint8), cv2.RETR_LIST, cv2.CHAIN_APPROX_NONE
        )
        rings += [ring.reshape(-1, 2) + 0.5 for ring in found if len(ring) > 4]
    covered = dilated(round_, 3) & (labels == 0) & ~ink.mask | round_ | inner
    thin = replace(ink, mask=ink.mask & ~covered, cover=np.where(covered, 0, ink.cover).astype(np.float32))
    return Split(thin, width, rings, list(dots.values()), apart=round_ if dots else None)


def _as_dot(cover: Floats) -> Dot | None:
    """Return the disc that has the place and area of some ink; None if its outline is farther off."""
    rows, columns = (np.arange(side) + 0.5 for side in cover.shape)
    area = float(cover.sum())
    place = np.array([(cover * columns).sum(), (cover * rows[:, None]).sum()]) / area
    radius = math.sqrt(area / math.pi)
    off = np.abs(cover - disc_cover(cover.shape, place, radius))
    is_round = float(off.sum()) <= OFF * 2 * math.pi * radius
    return Dot(place, 2 * radius) if is_round else None


def disc_cover(shape: tuple[int, ...], place: Floats | tuple[float, float], radius: float) -> Floats:
    """Return the share of each pixel that a disc covers, shape (height, width)."""
    rows, columns = (np.arange(side) + 0.5 for side in shape)
    return np.asarray(np.clip(radius + 0.5 - hypot(columns - place[0], rows[:, None] - place[1]), 0, 1))


def distance_from(inside: Bools) -> Floats:
    """Return the distance of each pixel from those inside [px]."""
    return filters.distance(~inside).astype(np.float64)
