"""Letters and other small parts of one colour on a plain ground: drawn once on a sheet, and placed.

Rendered text repeats its letters pixel by pixel. A sheet of the different ones, in black on white, has a few
per cent of the image's pixels: it can be traced by sub-pixels, and each outline is fitted once. Where letters
were drawn for the stripes of a screen's pixels (ClearType), their coloured fringes are no part of them.
"""

from __future__ import annotations

import functools
from collections.abc import Iterator
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from warpsplat.drawing.glyph_sheet import Sheet, packed
from warpsplat.drawing.trace.grids import (
    NO_REGION,
    channel_max,
    dilated,
    linked_components,
    nearest_in,
)
from warpsplat.drawing.trace.mixtures import MIXED
from warpsplat.drawing.trace.regions import NEGLIGIBLE_NOISE
from warpsplat.drawing.trace.seeds import noise_of
from warpsplat.scene import FloatArray

LEAST_GROUND = 400
"""Pixels of exactly one colour that are a ground: more than a letter has inside."""

HIGHEST, WIDEST = 96, 256
"""Sides of the largest glyph [px]; joined letters are one."""

NEAR_GROUND = 6 / 255
"""Differences from a ground that are none: scaling leaves rings around letters."""

LEAST_SHOWN = 400.0
"""Sum of a glyph's differences from its ground [levels], as of two dark pixels on white. Specks are none."""

LEAST_CONTRAST = 24.0
"""Difference of an ink from the ground [levels], below which its shares in pixels are not known."""

SHARING, SAME = 3, 4.0
"""Different glyphs whose extreme colours are about the same [levels], which is an ink then."""

LIKE_ANOTHER = 0.85
"""Share of a more usual ink in a colour that is none of its own."""

FEWEST = 16
"""Different or equal glyphs that are worth a sheet."""

MOST = 8000
"""Different parts of an image that are looked at: one with more has a texture."""

FRINGE, BALANCE, BEND = 0.08, 0.12, 0.4
"""Shares in red and blue that differ by ``FRINGE`` at least are a fringe if their sums differ by no more than
``BALANCE`` of green's, and green is off the mean of the two by no more than ``BEND`` of their difference."""

Bools = npt.NDArray[np.bool_]
Ints = npt.NDArray[np.intp]
Floats = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class _Glyph:
    """One of the different glyphs."""

    shares: Floats
    """Share of the extreme colour in each pixel, shape (height, width)."""
    extreme: Floats
    """The farthest value from the ground in each channel, less the ground's [levels], shape (channel,)."""
    ground: Floats
    """[levels], shape (channel,)."""
    copies: list[tuple[int, int, Bools]]
    """Where it is in the image: x, y, and its pixels in the box there."""

    @property
    def key(self) -> bytes:
        """Whole levels of the ground and the extreme colour."""
        return np.round(np.concatenate([self.ground, self.extreme])).tobytes()


def find_glyphs(image: FloatArray) -> tuple[Sheet | None, FloatArray]:
    """Return the sheet of an image's glyphs, if there are enough, and the image without them.

    An image with noise has none. ``image``: as for ``trace``.
    """
    glyphs = _different_glyphs(image)
    inks = _inks(glyphs)
    glyphs = [glyph for glyph in glyphs if glyph.key in inks]
    if sum(len(glyph.copies) for glyph in glyphs) < FEWEST:
        return None, image
    rest = image.copy()
    for glyph in glyphs:
        for x, y, own in glyph.copies:
            rest[y : y + own.shape[0], x : x + own.shape[1]][own] = glyph.ground / 255
    own_inks = [inks[glyph.key] for glyph in glyphs]
    shares = [
        np.clip(glyph.shares * _share(glyph.extreme, ink), 0, 1)
        for glyph, ink in zip(glyphs, own_inks, strict=True)
    ]
    sizes = np.array([each.shape[::-1] for each in shares])
    copies = np.repeat(np.arange(len(glyphs)), [len(glyph.copies) for glyph in glyphs])
    places = np.array([(x, y) for glyph in glyphs for x, y, _ in glyph.copies])
    # Lines of text from left to right, so that contours that follow one another are near.
    middle = places[:, 1] + sizes[copies, 1] // 2
    order = np.lexsort((places[:, 0], middle // int(np.median(sizes[copies, 1]))))
    sheet, corners = packed(shares)
    grounds = np.array([glyph.ground for glyph in glyphs])
    colors = _with_opacity(grounds + np.array(own_inks))
    return Sheet(sheet, corners, sizes, colors, _with_opacity(grounds), copies[order], places[order]), rest


def _with_opacity(levels: Floats) -> FloatArray:
    """Return colours (color, channel) as premultiplied sRGB and opacity."""
    opaque = np.full((len(levels), 4 - levels.shape[1]), 255.0)
    return (np.concatenate([levels, opaque], axis=1) / 255).astype(np.float32)


def _different_glyphs(image: FloatArray) -> list[_Glyph]:
    """Return the small parts of one colour on a plain ground, those with the same pixels once."""
    known: dict[tuple[tuple[int, ...], bytes, bytes], _Glyph | None] = {}
    for x, y, own, ground in _islands(image):
        height, width = own.shape
        patch = np.where(own[..., None], image[y : y + height, x : x + width], ground)
        key = patch.shape, ground.tobytes(), patch.tobytes()
        if len(known) > MOST:
            return []
        if key not in known:
            known[key] = _glyph(patch.astype(np.float64) * 255, ground.astype(np.float64) * 255)
        if glyph := known[key]:
            glyph.copies.append((x, y, own))
    return [glyph for glyph in known.values() if glyph]


def _islands(image: FloatArray) -> Iterator[tuple[int, int, Bools, FloatArray]]:
    """Yield small parts with one plain ground around them: x, y, their pixels in a box, and its colour.

    There are none if they are few, or the image has noise.
    """
    height, width, channels = image.shape
    layers = [np.ascontiguousarray(channel) for channel in np.moveaxis(image, 2, 0)]
    across, down = (
        functools.reduce(np.logical_and, (a[one] == a[other] for a in layers))
        for one, other in ((np.s_[:, 1:], np.s_[:, :-1]), (np.s_[1:, :], np.s_[:-1, :]))
    )
    count, areas = linked_components(across, down, np.ones((height, width), np.bool_))
    is_ground = (np.bincount(areas.reshape(-1)) >= LEAST_GROUND)[areas]
    if not is_ground.any():
        return
    nearest = nearest_in(is_ground)
    is_plain = functools.reduce(
        np.logical_and, (np.abs(a - a.reshape(-1)[nearest]) <= NEAR_GROUND for a in layers)
    )
    parts, labels, stats, _ = cv2.connectedComponentsWithStats((~is_plain).astype(np.uint8), connectivity=8)
    left, top, wide, high, _ = stats.T.astype(np.intp)
    behind = np.where(is_plain, areas.reshape(-1)[nearest], NO_REGION)
    ground = _grounds(np.asarray(labels, np.intp), behind, parts, count)
    chosen = (ground >= 0) & (wide <= WIDEST) & (high <= HIGHEST)
    chosen &= (left > 0) & (top > 0) & (left + wide < width) & (top + high < height)
    chosen[0] = False
    if chosen.sum() < FEWEST or noise_of(image * np.float32(255)) >= NEGLIGIBLE_NOISE:
        return
    pixel = np.zeros(count, np.intp)
    pixel[areas.reshape(-1)] = np.arange(areas.size)  # one of each area
    boxes = np.stack([left - 1, top - 1, left + wide + 1, top + high + 1], axis=1)
    for number in np.flatnonzero(chosen).tolist():
        x, y, right, bottom = boxes[number].tolist()
        own = labels[y:bottom, x:right] == number
        own |= dilated(own, 3) & (behind[y:bottom, x:right] == ground[number])
        yield x, y, own, image.reshape(-1, channels)[pixel[ground[number]]]


def _grounds(labels: Ints, grounds: Ints, parts: int, count: int) -> Ints:
    """Return the ground around each part, NO_REGION if there are several; shape (part,)."""
    pairs = []
    for a, b in ((np.s_[:, 1:], np.s_[:, :-1]), (np.s_[1:, :], np.s_[:-1, :])):
        for one, other in ((a, b), (b, a)):
            met = (labels[one] > 0) & (grounds[other] >= 0)
            pairs.append(np.unique(labels[one][met].astype(np.int64) * count + grounds[other][met]))
    part, ground = np.divmod(np.unique(np.concatenate(pairs)), count)
    found = np.full(parts, NO_REGION, np.intp)
    found[part] = ground
    found[np.bincount(part, minlength=parts) != 1] = NO_REGION
    return found


def _glyph(patch: Floats, ground: Floats) -> _Glyph | None:
    """Return a glyph of one colour, which its pixels have more or less of; None if it has several.

    ``patch``: levels, shape (height, width, channel).
    """
    away = patch - ground
    flat = away.reshape(-1, len(ground))
    if np.abs(flat).max(axis=1).sum() < LEAST_SHOWN:
        return None
    extreme = np.take_along_axis(flat, np.abs(flat).argmax(axis=0)[None], 0)[0]
    if np.abs(extreme).max() < LEAST_CONTRAST:
        return None
    shares = (away * extreme).sum(axis=2) / (extreme * extreme).sum()
    if np.abs(away - shares[..., None] * extreme).max() <= MIXED:
        return _Glyph(shares, extreme, ground, [])
    colored = extreme[:3]
    if np.abs(colored).min() < LEAST_CONTRAST or (len(ground) == 4 and extreme[3] != 0):
        return None
    red, green, blue = np.moveaxis(away[..., :3] / colored, 2, 0)
    spread, bend = np.abs(red - blue), np.abs(green - (red + blue) / 2)
    is_fringe = spread.max() >= FRINGE and bend.sum() <= BEND * spread.sum()
    is_fringe &= abs(red.sum() - blue.sum()) <= BALANCE * green.sum()
    return _Glyph((red + green + blue) / 3, extreme, ground, []) if is_fringe else None


def _inks(glyphs: list[_Glyph]) -> dict[bytes, Floats]:
    """Return the inks, less the ground, of glyphs by their keys; without those that have none.

    An ink is the extreme colour of several glyphs; thin ones may not show all of theirs, and have the nearest
    beyond.
    """
    by_ground: dict[bytes, list[_Glyph]] = {}
    for glyph in glyphs:
        by_ground.setdefault(glyph.ground.tobytes(), []).append(glyph)
    found = {}
    for alike in by_ground.values():
        known = _usual_colors(np.array([glyph.extreme for glyph in alike]))
        for glyph in alike:
            fits = [ink for ink in known if _is_share(glyph.extreme, ink, 1 + MIXED / np.abs(ink).max())]
            if fits:
                found[glyph.key] = max(fits, key=lambda ink: _share(glyph.extreme, ink))
    return found


def _usual_colors(colors: Floats) -> list[Floats]:
    """Return the inks among extreme colours (color, channel), the most usual first.

    One that is hardly less than a more usual one is that of thin glyphs; where all are thin, the strongest is
    the ink.
    """
    found: list[Floats] = []
    different, counts = np.unique(np.round(colors), axis=0, return_counts=True)
    left = np.ones(len(different), np.bool_)
    near = [channel_max(np.abs(different - color)) <= SAME for color in different]
    while left.any():
        sums = np.array([counts[left & each].sum() for each in near]) * left
        best = int(np.lexsort((-counts, -sums))[0])
        if sums[best] < SHARING:
            break
        left &= ~near[best]
        color = different[best]
        if not any(_is_share(color, ink, 1) and _share(color, ink) >= LIKE_ANOTHER for ink in found):
            found.append(color)
    for color in sorted(different[left], key=lambda color: -float(np.abs(color).max())):
        if not any(_is_share(color, ink, 1) for ink in found):
            alike = [_is_share(other, color, 1) for other in different[left]]
            if counts[left][alike].sum() >= SHARING:
                found.append(color)
    return found


def _is_share(color: Floats, ink: Floats, most: float) -> bool:
    """Return whether a colour is a share, of at most ``most``, of an ink; both less the ground."""
    share = _share(color, ink)
    return share <= most and bool(np.abs(color - share * ink).max() <= MIXED)


def _share(color: Floats, ink: Floats) -> float:
    """Return how much of an ink is in a colour, both less the ground."""
    return float((color * ink).sum() / (ink * ink).sum())
