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

from warpsplat.drawing.glyph_sheet import GlyphSheet, packed
from warpsplat.drawing.trace.grids import NO_REGION, border, dilated, linked_components, nearest_in
from warpsplat.drawing.trace.mixtures import MIXED
from warpsplat.drawing.trace.regions import NEGLIGIBLE_NOISE
from warpsplat.drawing.trace.seeds import noise_of
from warpsplat.drawing.trace.trace import ALIKE, LEAST_AREA
from warpsplat.scene import FloatArray

LEAST_GROUND = 400
"""Pixels of exactly one colour that are a ground: more than a letter has inside."""

HIGHEST = 96
"""The less side of the largest glyph [px]; joined letters are one."""

NEAR_GROUND = 6 / 255
"""Differences from a ground that are none: scaling leaves rings around letters."""

LEAST_CONTRAST = 24.0
"""Difference of an ink from the ground [levels], below which its shares in pixels are not known."""

SHARING = 3
"""Different glyphs whose extreme colours are about the same, which is an ink then."""

LIKE_ANOTHER = 0.85
"""Share of a more usual ink in a colour that is none of its own."""

FEWEST = 16
"""Different or equal glyphs that are worth a sheet."""

BALANCE = 0.12
"""By how much of green's the sums of shares in red and blue may be off it, where they differ by fringes."""

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


def find_glyphs(image: FloatArray, *, removes_ground: bool = False) -> tuple[GlyphSheet | None, FloatArray]:
    """Return the sheet of an image's glyphs, if there are enough, and the image without them.

    An image with noise has none. ``image``: as for ``trace``; ``removes_ground``: whether what has the colour
    of its border will be empty, and so is no glyph.
    """
    glyphs = _different_glyphs(image)
    inks = _inks(glyphs)
    glyphs = [glyph for glyph in glyphs if glyph.key in inks]
    if removes_ground and glyphs:
        edge, counts = np.unique(border(image), axis=0, return_counts=True)
        empty = 255 * edge[counts.argmax()]
        glyphs = [g for g in glyphs if np.abs(g.ground + inks[g.key] - empty).max() > ALIKE]
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
    return GlyphSheet(
        sheet, corners, sizes, colors, _with_opacity(grounds), copies[order], places[order]
    ), rest


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
        if key not in known:
            known[key] = _glyph(patch.astype(np.float64) * 255, ground.astype(np.float64) * 255)
        if glyph := known[key]:
            glyph.copies.append((x, y, own))
    return [glyph for glyph in known.values() if glyph]


def _islands(image: FloatArray) -> Iterator[tuple[int, int, Bools, FloatArray]]:
    """Yield small parts with one plain ground around them: x, y, their pixels in a box, and its colour.

    There are none if they are few, or a texture, or the image has noise.
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
    chosen = (ground >= 0) & (np.minimum(wide, high) <= HIGHEST)
    chosen &= (left > 0) & (top > 0) & (left + wide < width) & (top + high < height)
    chosen[0] = False
    is_texture = LEAST_AREA * chosen.sum() > height * width
    if chosen.sum() < FEWEST or is_texture or noise_of(image * np.float32(255)) >= NEGLIGIBLE_NOISE:
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
    low, high = np.full(parts, count), np.full(parts, NO_REGION)
    for a, b in ((np.s_[:, 1:], np.s_[:, :-1]), (np.s_[1:, :], np.s_[:-1, :])):
        for one, other in ((a, b), (b, a)):
            met = (labels[one] > 0) & (grounds[other] >= 0)
            np.minimum.at(low, labels[one][met], grounds[other][met])
            np.maximum.at(high, labels[one][met], grounds[other][met])
    return np.where(low == high, low, NO_REGION)


def _glyph(patch: Floats, ground: Floats) -> _Glyph | None:
    """Return a glyph of one colour, which its pixels have more or less of; None if it has several.

    ``patch``: levels, shape (height, width, channel).
    """
    away = patch - ground
    flat = away.reshape(-1, len(ground))
    extreme = np.take_along_axis(flat, np.abs(flat).argmax(axis=0)[None], 0)[0]
    if np.abs(extreme).max() < LEAST_CONTRAST:
        return None
    shares = (away * extreme).sum(axis=2) / (extreme * extreme).sum()
    if np.abs(away - shares[..., None] * extreme).max() <= MIXED:
        return _Glyph(shares, extreme, ground, [])
    colored = extreme[:3]
    if np.abs(colored).min() < LEAST_CONTRAST or (len(ground) == 4 and extreme[3] != 0):
        return None
    shares = away[..., :3] / colored
    sums = shares.sum(axis=(0, 1))
    is_fringe = np.abs(sums - sums[1]).max() <= BALANCE * sums[1]
    return _Glyph(shares.mean(axis=2), extreme, ground, []) if is_fringe else None


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
    """Return the inks among extreme colours (color, channel): usual ones, and the strongest of others.

    One that is hardly less than a more usual one is that of thin glyphs.
    """
    found: list[Floats] = []
    different, counts = np.unique(np.round(colors), axis=0, return_counts=True)
    near = np.array([(np.abs(different - color) <= MIXED).all(axis=1) for color in different])
    while (sums := np.where(near, counts, 0).sum(axis=1)).max() >= SHARING:
        color = different[np.lexsort((-counts, -sums))[0]]
        counts = np.where((np.abs(different - color) <= MIXED).all(axis=1), 0, counts)
        if not any(_is_share(color, ink, 1) and _share(color, ink) >= LIKE_ANOTHER for ink in found):
            found.append(color)
    for color in sorted(different[counts > 0], key=lambda color: -float(np.abs(color).max())):
        if not any(_is_share(color, ink, 1) for ink in found):
            found.append(color)
    return found


def _is_share(color: Floats, ink: Floats, most: float) -> bool:
    """Return whether a colour is a share, of at most ``most``, of an ink; both less the ground."""
    share = _share(color, ink)
    return share <= most and bool(np.abs(color - share * ink).max() <= MIXED)


def _share(color: Floats, ink: Floats) -> float:
    """Return how much of an ink is in a colour, both less the ground."""
    return float((color * ink).sum() / (ink * ink).sum())
