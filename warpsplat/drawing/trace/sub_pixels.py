"""Sub-pixel mapping: regions at several times the resolution, of the same area in each pixel.

A pixel of a thin line or a small letter is a mixture of two colours in known shares. Its sub-pixels are given
to the two in these proportions, each to the colour that it has more of around it (Atkinson 1997, "Mapping
sub-pixel boundaries from remotely sensed images").
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from warpsplat.drawing.trace.grids import Floats, Ints, channel_max, components, dilated, nearest_in
from warpsplat.drawing.trace.inks import with_inks
from warpsplat.drawing.trace.mixtures import DISTANCE_COST, MIXED
from warpsplat.drawing.trace.regions import Regions
from warpsplat.portable import elementary, filters
from warpsplat.scene.scene import numbers_in

SCALES = (4, 3, 2)
MOST_SUB_PIXELS = 1 << 20  # of the image, which bounds time and memory
FOREIGN_SHARE = 0.03  # of the mixed pixels that may be no mixtures of two colours
MOST_COLORS = 32  # that are compared by pairs
THIN_SHARE = 0.15  # of the mixed pixels, from which on an image is drawn by sub-pixels
LEAST_MIXED = 0.2  # pixels for each pair of neighbours of different colours, where there is antialiasing
SMALL = 80 * 80  # [px] of an icon of 64 px and its margin: without gradients it is drawn so if any is thin
FOREIGN_IN_SMALL = 0.3  # the largest foreign share there
NEAR = 3.5  # [px] within which the colours lie that a pixel may be mixed of
PURE = 0.04  # share up to which a colour is no part of a pixel
SIGMA = 0.4  # [px] how far sub-pixels attract each other: the deviation of a normal distribution
WEIGHT = 256  # that stands for 1 where weights are whole numbers
SPECK = 0.5  # [px] area
SWEEPS = 4  # in which sub-pixels change places
MOST_FRAYED = 1.4
"""Most length of the borders of sub-pixels, over that of the borders of pixels. Where an image is blurred,
shares are no areas of its pixels, and borders fray."""


@dataclass(frozen=True)
class _Mixed:
    """Pixels as mixtures of two colourings."""

    rows: Ints
    columns: Ints
    first: Ints
    """Number of the one colouring, shape (pixel,)."""
    second: Ints
    share: Floats
    """Share of the first region, shape (pixel,)."""


def with_sub_pixels(regions: Regions) -> Regions:
    """Return the regions at several times the resolution if many of them are thin."""
    height, width = regions.labels.shape
    scale = _largest_scale(regions)
    used = numbers_in(regions.paint).tolist()
    has_bands = any(regions.colorings[k].is_band for k in used)
    if scale == 1 or has_bands or len(used) > MOST_COLORS:
        return regions
    inked = with_inks(regions)
    shown = _shown(inked)
    painted, mixed = _unmixed(inked, shown)
    is_small = height * width <= SMALL and all(regions.colorings[k].ramp is None for k in used)
    thin, foreign = _thin_share(painted, mixed), _foreign_share(inked, mixed, shown)
    if not (thin > 0 if is_small else thin >= THIN_SHARE):
        return regions
    if foreign > (FOREIGN_IN_SMALL if is_small else FOREIGN_SHARE):
        return regions
    small = _mapped(painted, mixed, scale)
    if _border(small) > MOST_FRAYED * scale * _border(regions.labels):
        return regions
    return _refined(inked, small, mixed, shown, scale)


def by_sub_pixels(regions: Regions) -> Regions:
    """Return regions of flat colours, whose pixels are all mixtures, at several times the resolution.

    Without antialiasing they stay as they are.
    """
    scale = _largest_scale(regions)
    shown = _shown(regions)
    painted, mixed = _unmixed(regions, shown)
    if len(mixed.rows) < LEAST_MIXED * _border(painted):
        return regions
    return _refined(regions, _mapped(painted, mixed, scale), mixed, shown, scale)


def _largest_scale(regions: Regions) -> int:
    """Return how fine sub-pixels of an image may be; 1 if it is too large for them."""
    return next((s for s in SCALES if s * s * regions.labels.size <= MOST_SUB_PIXELS), 1)


def _refined(regions: Regions, small: Ints, mixed: _Mixed, shown: dict[int, Floats], scale: int) -> Regions:
    """Return regions at several times the resolution; ``small``: the colouring of each sub-pixel."""
    colors = np.stack([coloring.color for coloring in regions.colorings]).astype(np.float32)
    _remove_specks(small, mixed, colors, scale)
    places = np.indices(small.shape) // scale
    fills = _colors_at(shown, small, places[0], places[1])
    image = filters.box_blur(filters.box_blur(fills, 3), 3)
    labels = components(small, image)
    paint = np.zeros(int(labels.max()) + 1, np.int32)
    paint[labels] = small
    return replace(regions, image=image, labels=labels, fills=fills, paint=paint, scale=scale)


def _remove_specks(small: Ints, mixed: _Mixed, colors: Floats, scale: int) -> None:
    """Give parts too small to be seen, which thin tips leave, to the other colour of their pixels."""
    labels = components(small, colors[small])
    is_speck = np.bincount(labels.ravel()) < SPECK * scale**2
    place = np.arange(scale)
    at = mixed.rows[:, None, None] * scale + place[:, None], mixed.columns[:, None, None] * scale + place
    other = (mixed.first + mixed.second)[:, None, None] - small[at]
    small[at] = np.where(is_speck[labels[at]], other, small[at])


def _border(labels: Ints) -> int:
    """Return at how many places neighbours differ."""
    return sum(int(np.count_nonzero(np.diff(labels, axis=axis))) for axis in (0, 1))


def _shown(regions: Regions) -> dict[int, Floats]:
    """Return each colouring over the image, shape (height, width, 4): gradients by the nearest pixel."""
    painted, shown = regions.paint[regions.labels], {}
    for k in numbers_in(painted).tolist():
        coloring = regions.colorings[k]
        if coloring.ramp is None:
            shown[k] = np.broadcast_to(coloring.color.astype(np.float32), regions.image.shape)
        else:
            shown[k] = regions.fills.reshape(-1, 4)[nearest_in(painted == k)]
    return shown


def _colors_at(shown: dict[int, Floats], which: Ints, rows: Ints, columns: Ints) -> Floats:
    """Return the colours of the colourings ``which`` at pixels, shape (..., 4)."""
    found = np.empty((*which.shape, 4), np.float32)
    for k in numbers_in(which).tolist():
        own = which == k
        found[own] = shown[k][rows[own], columns[own]]
    return found


def _unmixed(regions: Regions, shown: dict[int, Floats]) -> tuple[Ints, _Mixed]:
    """Return the colouring with the larger share in each pixel, and the mixed pixels."""
    painted = regions.paint[regions.labels]
    numbers = numbers_in(painted).tolist()
    distances = {k: filters.distance(painted != k) for k in numbers}
    cost = np.full(painted.shape, np.inf, np.float32)
    first, second, share = painted.copy(), painted.copy(), np.ones(painted.shape, np.float32)
    for i, a in enumerate(numbers):
        for b in numbers[i + 1 :]:
            rows, columns = np.nonzero((distances[a] < NEAR) & (distances[b] < NEAR))
            one, other = shown[a][rows, columns], shown[b][rows, columns]
            between, away = one - other, regions.image[rows, columns] - other
            t = np.clip((away * between).sum(axis=1) / np.maximum((between**2).sum(axis=1), 1e-6), 0, 1)
            off = channel_max(np.abs(away - t[:, None] * between))
            off += DISTANCE_COST * (distances[a] + distances[b])[rows, columns]
            better = off < cost[rows, columns]
            at = rows[better], columns[better]
            cost[at], share[at], first[at], second[at] = off[better], t[better], a, b
    most = np.where(share >= 0.5, first, second)
    is_pure = (
        channel_max(np.abs(regions.image - _colors_at(shown, most, *np.indices(most.shape))))
        <= MIXED + regions.noise
    )
    rows, columns = np.nonzero((share > PURE) & (share < 1 - PURE) & ~is_pure)
    at = rows, columns
    return most, _Mixed(rows, columns, first[at], second[at], share[at])


def _foreign_share(regions: Regions, mixed: _Mixed, shown: dict[int, Floats]) -> float:
    """Return the share of the mixed pixels that are not mixed of two colours."""
    share = mixed.share[:, None]
    at = mixed.rows, mixed.columns
    one, other = (_colors_at(shown, which, *at) for which in (mixed.first, mixed.second))
    off = channel_max(np.abs(regions.image[at] - share * one - (1 - share) * other))
    return float((off > MIXED + regions.noise).mean()) if len(off) else 0.0


def _thin_share(painted: Ints, mixed: _Mixed) -> float:
    """Return the share of the mixed pixels beside which one of the two colours covers no pixel altogether."""
    pure = np.ones(painted.shape, np.bool_)
    pure[mixed.rows, mixed.columns] = False
    is_thin = np.zeros(len(mixed.rows), np.bool_)
    for k in numbers_in(painted).tolist():
        lacks = ~dilated(pure & (painted == k), 3)[mixed.rows, mixed.columns]
        is_thin |= lacks & ((mixed.first == k) | (mixed.second == k))
    return float(is_thin.mean()) if len(is_thin) else 0.0


def _mapped(painted: Ints, mixed: _Mixed, scale: int) -> Ints:
    """Return the colouring of each sub-pixel, shape (scale height, scale width)."""
    small = np.repeat(np.repeat(painted, scale, axis=0), scale, axis=1)
    counts = np.round(mixed.share * scale**2).astype(np.int64)
    kernel = _kernel(scale)
    # At first all sub-pixels of a pixel are alike.
    shares = np.repeat(np.repeat(_shares_around(painted, mixed), scale, axis=1), scale, axis=2)
    start = _attraction(shares, kernel)
    _give(small, mixed, np.arange(len(counts)), counts, start)
    # Pixels change one after the other, so that neighbours do not swap for ever.
    turns = 2 * (mixed.rows % 2) + mixed.columns % 2
    for turn in [0, 1, 2, 3] * SWEEPS:
        some = np.flatnonzero(turns == turn)
        views = np.lib.stride_tricks.sliding_window_view(
            np.pad(small, scale, mode="edge"), (3 * scale, 3 * scale)
        )
        around = views[mixed.rows[some] * scale, mixed.columns[some] * scale]
        own, other = (around == each[some, None, None] for each in (mixed.first, mixed.second))
        lead = _attraction(WEIGHT * (own.astype(np.int64) - other), kernel)
        _give(small, mixed, some, counts[some], WEIGHT * lead + start[some])
    return small


def _shares_around(painted: Ints, mixed: _Mixed) -> Ints:
    """Return how much more of the first colour than of the second the 3x3 pixels have, (pixel, 3, 3)."""
    first, second = painted.copy(), painted.copy()
    share = np.full(painted.shape, WEIGHT, np.int64)
    at = mixed.rows, mixed.columns
    first[at], second[at], share[at] = mixed.first, mixed.second, np.round(WEIGHT * mixed.share)
    one, other, part = (
        np.lib.stride_tricks.sliding_window_view(np.pad(each, 1, mode="edge"), (3, 3))[at]
        for each in (first, second, share)
    )

    def of(wanted: Ints) -> Ints:
        number = wanted[:, None, None]
        return np.where(one == number, part, np.where(other == number, WEIGHT - part, 0))

    return of(mixed.first) - of(mixed.second)


def _kernel(scale: int) -> Ints:
    """Return how much those around a pixel attract its sub-pixels, shape (scale, 3 scale)."""
    away = (np.arange(3 * scale) - np.arange(scale)[:, None] - scale) / scale
    return np.round(WEIGHT * elementary.exp(-0.5 * (away / SIGMA) ** 2)).astype(np.int64)


def _attraction(windows: Ints, kernel: Ints) -> Ints:
    """Return the weighted sums for the sub-pixels in the middle of windows, shape (window, sub-pixel)."""
    places = range(kernel.shape[1])
    down = np.sum([windows[:, i, None] * kernel[:, i, None] for i in places], axis=0)
    across = np.sum([down[:, :, i, None] * kernel[:, i] for i in places], axis=0)
    return np.asarray(across.reshape(len(windows), len(kernel) * len(kernel)))


def _give(small: Ints, mixed: _Mixed, some: Ints, counts: Ints, lead: Ints) -> None:
    """Give the sub-pixels of ``some`` pixels where its ``lead`` is largest to the first colour."""
    size = lead.shape[1]
    scale = math.isqrt(size)
    order = np.argsort(-lead, axis=1, kind="stable")
    first = np.empty(lead.shape, np.bool_)
    np.put_along_axis(first, order, np.arange(size) < counts[:, None], axis=1)
    down, right = np.divmod(np.arange(size), scale)
    at = mixed.rows[some, None] * scale + down, mixed.columns[some, None] * scale + right
    small[at] = np.where(first, mixed.first[some, None], mixed.second[some, None])
