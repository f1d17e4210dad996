"""Image -> label map and palette: flat regions and smooth ramps, antialiasing understood."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import cv2
import numpy as np

from warpsplat.drawing.trace.grids import NOBODY, Bools, Floats, Ints, Sets, largest, linked_parts
from warpsplat.drawing.trace.mixtures import REACH, explain
from warpsplat.drawing.trace.ramps import Ramp, fit_ramp
from warpsplat.drawing.trace.seeds import find_seeds, noise_of
from warpsplat.portable import filters

MIXED = 7.0
"""How far a pixel may be from a mixture of its neighbours' colours [levels], besides noise."""

ALIKE = 1.5
"""Flat regions whose colours are that near are of one colour [levels], besides noise."""

BLURRED = 6.0
"""What a level of noise adds to that [levels]."""

SLACK = 0.2
"""How far off a mixture may be in a noisy picture, for the difference of its colours."""

CALM = 12.0
"""Steps that are smoothed in a noisy picture [levels], besides noise."""

AROUND = 5
"""Side of the square that tells what is a line where two colours cross [px]."""

CLEAR = 2.5
"""Opacity below which a region is not painted [levels]."""

NARROW = 30
"""Pixels of the smallest region that cannot be a coincidence of antialiasing."""

WIDE = 400
"""Pixels of the smallest ramp in a noisy picture."""

FAINT = 24.0
"""How far a small part must be from all mixtures to be a region of its own [levels]."""

THIN = 0.35
"""Share of a thin line in a pixel from which on it is the line's."""

OTHER = 64.0
"""How far a pixel of a thin part is from what its colour explains, to be of another colour [levels]."""

COLORS_OF_A_PART = 4
"""At the most."""

SPECK = 8
"""Pixels of a part that may be where several regions meet."""

BESIDE = 5
"""How far from a thin part the colours are looked for that it may be mixed of [px]."""

SMALL = ((60, REACH), (12, 2 * REACH))
"""Pixels of the largest region that may be given up, and how far away it may find what it is mixed of [px]:
the tips of stars are long.
"""

UNSEEN = 120.0
"""How far all the pixels of a region may be from mixtures of what is around it, taken together, for that
[levels].
"""

UNSEEN_EACH = 40.0
"""The same for each pixel of a speck [levels]."""

MOSTLY = 0.4
"""Share of a small region's pixels in a noisy picture that are mixtures, for these to be no part of it: JPEG
tints the tips of stars, and of long ones not all is near what they are tips of.
"""

MOST_THIN = 4000
"""Thin parts that are looked at; a picture with more is no drawing."""

RAMP = 1.6
"""Residual of a flat colour from which on a ramp is tried [levels], besides noise."""

GAIN = 0.6
"""What a ramp must leave of a flat colour's residual to be worth it."""


@dataclass(frozen=True)
class Coloring:
    """What a region is painted with: premultiplied, 0..255."""

    color: Floats
    """Mean, shape (4,)."""
    ramp: Ramp | None = None

    @property
    def clear(self) -> bool:
        """Whether nothing is painted."""
        return float(self.color[3]) < CLEAR


@dataclass(frozen=True)
class Regions:
    """A picture cut up: each region is connected."""

    labels: Ints
    """The region of each pixel, shape (height, width)."""
    pure: Floats
    """What the pixel would be if its region filled it, shape (height, width, 4)."""
    paint: Ints
    """The colouring of each region, shape (region,)."""
    colorings: list[Coloring]
    noise: float
    """How much flat regions vary [levels]."""


def find_regions(image: Floats) -> Regions:
    """Cut a picture up into regions.

    Args:
        image: premultiplied sRGB with opacity, 0..255, shape (height, width, 4).
    """
    noise = noise_of(image)
    if noise < 0.5:
        noise = 0.0
    calm = image if noise == 0 else _calmed(image, noise)
    noise = min(noise, 12.0)
    count, labels = find_seeds(calm, min(noise, 3.0))
    pure = calm.astype(np.float32).copy()
    labels = _without_coincidences(calm, labels, pure, count, noise)
    labels, paint, colorings = _palette(calm, labels, noise)
    _flatten(pure, labels, paint, colorings)
    labels, paint, colorings = _thin_parts(calm, labels, pure, paint, colorings, noise)
    seeds = labels != NOBODY
    _assign(calm, labels, pure)
    painted = paint[_fill(labels, pure)]
    _adopt(calm, painted, pure, seeds)
    given_up = _prune(calm, painted, pure, noise)
    _adopt(calm, painted, pure, ~given_up)
    regions = components(painted, image)
    return Regions(regions, pure, _paint_of(regions, painted), colorings, noise)


def _slack(noise: float) -> float:
    """Share of their contrast by which mixtures may be off."""
    return SLACK if noise else 0.0


def _calmed(image: Floats, noise: float) -> Floats:
    """Without what JPEG leaves beside edges."""
    calm = np.ascontiguousarray(image, np.float32)
    for channels in (slice(0, 3), slice(3, 4)):
        part = calm[..., channels]
        if np.ptp(part) > 0:
            for _ in range(3):
                part = filters.bilateral(part, 7, CALM + 6 * noise, 2.5)
            calm[..., channels] = part
    return calm


def _without_coincidences(image: Floats, labels: Ints, pure: Floats, count: int, noise: float) -> Ints:
    """Small and thin parts that are mixtures of the large ones are no seeds."""
    if count == 0:
        return labels
    sizes = np.bincount(labels[labels >= 0], minlength=count)
    wide = np.zeros(count, np.bool_)
    wide[np.unique(labels[_inner(labels)])] = True
    small = ~wide | (sizes < NARROW)
    small[sizes == sizes.max()] = False
    doubtful = (labels >= 0) & small[labels]
    rows, columns = np.nonzero(doubtful)
    if not len(rows):
        return labels
    large = np.where(doubtful, NOBODY, labels).astype(np.int32)
    result = explain(image, large, pure, rows, columns, _slack(noise))
    mixed = (result.residual <= MIXED + noise) & (result.share < 0.99)
    owners = labels[rows, columns]
    explained = np.bincount(owners, mixed, count)
    drop = small & (explained >= 0.7 * sizes)
    return np.where(doubtful & drop[labels], NOBODY, labels).astype(np.int32)


def _inner(labels: Ints) -> Bools:
    """Pixels all of whose neighbours are of the same part."""
    same = labels >= 0
    padded = np.pad(labels, 1, mode="edge")
    height, width = labels.shape
    for dy in range(3):
        for dx in range(3):
            same &= padded[dy : dy + height, dx : dx + width] == labels
    return np.asarray(same)


def _modes(image: Floats, labels: Ints, count: int) -> Floats:
    """The most frequent colour of each part, shape (count, channel)."""
    inside = labels >= 0
    levels = np.round(image[inside]).astype(np.int64)
    packed = labels[inside].astype(np.int64)
    for channel in range(levels.shape[1]):
        packed = packed * 256 + levels[:, channel]
    keys, times = np.unique(packed, return_counts=True)
    owner = keys >> 8 * levels.shape[1]
    order = np.lexsort((times, owner))
    last = order[np.flatnonzero(np.diff(np.append(owner[order], count)) != 0)]
    shifts = 8 * np.arange(levels.shape[1])[::-1]
    colors = np.zeros((count, levels.shape[1]))
    colors[owner[last]] = (keys[last][:, None] >> shifts) & 255
    return colors


def _sums(values: Floats, labels: Ints, count: int) -> Floats:
    inside = labels >= 0
    owners = labels[inside]
    sums = [np.bincount(owners, values[..., c][inside], count) for c in range(values.shape[2])]
    return np.stack(sums, axis=1).astype(np.float64)


def _palette(image: Floats, labels: Ints, noise: float) -> tuple[Ints, Ints, list[Coloring]]:
    """Colours of the parts: labels, the colouring of each part, the colourings."""
    count = int(labels.max()) + 1
    if count <= 0:
        count, labels = 1, np.zeros(labels.shape, np.int32)
    inside = labels >= 0
    owners = labels[inside]
    sizes = np.maximum(np.bincount(owners, minlength=count), 1)
    means = _sums(image, labels, count) / sizes[:, None]
    modes = _modes(image, labels, count)
    off = largest(np.abs(image[inside] - modes[owners])).astype(np.float32)
    square = np.bincount(owners, off.astype(np.float64) ** 2, count) / sizes
    uneven = np.sqrt(square) > RAMP + 3 * noise
    flat_colors = modes if noise == 0 else means
    paint = np.full(count, NOBODY, np.int32)
    colorings: list[Coloring] = []
    for part in np.flatnonzero(uneven & (sizes >= (NARROW if noise == 0 else WIDE))).tolist():
        ramp = _ramp_of(image, labels, part, float(np.sqrt(square[part])), noise)
        if ramp is not None:
            paint[part] = len(colorings)
            colorings.append(Coloring(means[part], ramp))
    _join_flats(paint, colorings, flat_colors, sizes, noise)
    return labels, paint, colorings


def _ramp_of(image: Floats, labels: Ints, part: int, flat: float, noise: float) -> Ramp | None:
    rows, columns = _box(labels, part)
    mask = labels[rows, columns] == part
    ramp = fit_ramp(image[rows, columns], mask, columns.start, rows.start)
    return ramp if ramp is not None and ramp.residual < GAIN * flat else None


def _box(labels: Ints, part: int) -> tuple[slice, slice]:
    where = labels == part
    rows, columns = np.flatnonzero(where.any(axis=1)), np.flatnonzero(where.any(axis=0))
    return slice(int(rows[0]), int(rows[-1]) + 1), slice(int(columns[0]), int(columns[-1]) + 1)


def _join_flats(paint: Ints, colorings: list[Coloring], colors: Floats, sizes: Ints, noise: float) -> None:
    """Give parts of nearly one colour one colouring, that of the largest."""
    first = len(colorings)
    known = np.zeros((0, colors.shape[1]))
    alike = ALIKE + min(BLURRED * noise, 24.0)
    for part in np.argsort(-sizes, kind="stable").tolist():
        if paint[part] != NOBODY:
            continue
        color = colors[part]
        if color[3] < CLEAR:
            color = np.zeros_like(color)
        elif color[3] > 255 - CLEAR:
            color = np.append(color[:3], 255.0)
        off = np.abs(known - color).max(axis=1) if len(known) else np.array([np.inf])
        near = int(off.argmin())
        if off[near] > alike:
            near = len(known)
            known = np.concatenate([known, color[None]])
            colorings.append(Coloring(np.round(color)))
        paint[part] = first + near


def _flatten(pure: Floats, labels: Ints, paint: Ints, colorings: list[Coloring]) -> None:
    """Flat parts get their colour all over."""
    flat = np.array([coloring.ramp is None for coloring in colorings])
    colors = np.array([coloring.color for coloring in colorings])
    inside = (labels >= 0) & flat[paint[labels]]
    pure[inside] = colors[paint[labels[inside]]]


def _assign(image: Floats, labels: Ints, pure: Floats) -> None:
    """Give the pixels between the seeds to the regions that have most of them."""
    rows, columns = np.nonzero(labels == NOBODY)
    result = explain(image, labels, pure, rows, columns)
    known = result.label != NOBODY
    labels[rows[known], columns[known]] = result.label[known]
    pure[rows[known], columns[known]] = result.color[known]


def _adopt(image: Floats, painted: Ints, pure: Floats, seeds: Bools) -> None:
    """Parts without a sure pixel are chance: each of their pixels goes to the neighbour nearest in colour."""
    regions = components(painted, image)
    sure = np.zeros(int(regions.max()) + 1, np.bool_)
    sure[regions[seeds]] = True
    orphan = ~sure[regions]
    height, width = painted.shape
    for _ in range(4):
        rows, columns = np.nonzero(orphan)
        best = np.full(len(rows), np.inf)
        source = rows * width + columns
        for down, right in ((0, 1), (1, 0), (0, -1), (-1, 0)):
            y, x = np.clip(rows + down, 0, height - 1), np.clip(columns + right, 0, width - 1)
            off = np.abs(image[rows, columns] - pure[y, x]).max(axis=1)
            better = ~orphan[y, x] & (off < best)
            best[better], source[better] = off[better], (y * width + x)[better]
        found = np.isfinite(best)
        painted[rows, columns] = painted.reshape(-1)[source]
        pure[rows, columns] = pure.reshape(-1, pure.shape[2])[source]
        orphan[rows[found], columns[found]] = False


def _prune(image: Floats, painted: Ints, pure: Floats, noise: float) -> Bools:
    """Give up small regions that are seen as little more than mixtures of what is around them.

    Returns:
        the pixels of these, shape (height, width), but for those that are of their own colour all the same.
    """
    given_up = np.zeros(painted.shape, np.bool_)
    for most, reach in SMALL if noise == 0 else (SMALL[0], *SMALL):
        regions = components(painted, image)
        small = np.bincount(regions.reshape(-1)) <= most
        doubtful = small[regions]
        rows, columns = np.nonzero(doubtful)
        if not len(rows) or doubtful.all():
            continue
        large = np.where(doubtful, NOBODY, painted).astype(np.int32)
        result = explain(image, large, pure, rows, columns, _slack(noise), reach)
        seen = np.maximum(result.residual - (MIXED + noise), 0)
        owner = regions[rows, columns]
        energy = np.bincount(owner, seen, len(small))
        pixels = np.bincount(owner, minlength=len(small))
        gone = (energy <= np.maximum(UNSEEN, UNSEEN_EACH * np.minimum(pixels, SPECK)))[owner]
        if noise:
            tinted = np.bincount(owner, seen == 0, len(small)) >= MOSTLY * pixels
            gone |= tinted[owner] & (seen == 0)
        rows, columns = rows[gone], columns[gone]
        # What is not mixed at all is no chance, though its colour is found across a line as well.
        off = np.abs(image[rows, columns] - pure[rows, columns]).max(axis=1)
        own = (result.label[gone] == painted[rows, columns]) & (off <= MIXED + noise)
        painted[rows, columns], pure[rows, columns] = result.label[gone], result.color[gone]
        given_up[rows[~own], columns[~own]] = True
    return given_up


def _thin_parts(
    image: Floats, labels: Ints, pure: Floats, paint: Ints, colorings: list[Coloring], noise: float
) -> tuple[Ints, Ints, list[Coloring]]:
    """Seeds in lines and dots that are too thin to have any: pixels that no mixture explains.

    A part may be of several colours, as a thin bar and its outline: those pixels that are not between one
    colour and what is beside the part are parts of the next round, and keep that colour where no other of the
    picture's is theirs.
    """
    waiting = labels == NOBODY
    for turn in range(COLORS_OF_A_PART):
        before = labels, pure.copy()
        labels = np.where(waiting, NOBODY, labels).astype(np.int32)
        labels, paint, colorings, odd, waiting = _thin_round(
            image, labels, pure, paint, colorings, noise, waiting, first=turn == 0
        )
        stay = odd & (labels == NOBODY)
        labels[stay], pure[stay] = before[0][stay], before[1][stay]
        if not waiting.any():
            break
    return labels, paint, colorings


def _thin_round(
    image: Floats,
    labels: Ints,
    pure: Floats,
    paint: Ints,
    colorings: list[Coloring],
    noise: float,
    waiting: Bools,
    *,
    first: bool,
) -> tuple[Ints, Ints, list[Coloring], Bools, Bools]:
    """One colour for each part of the pixels that are ``waiting``, new ones in the ``first`` round only.

    Returns:
        labels, paint, colorings; the pixels of the parts; those of them that seem to be of another colour.
    """
    others = np.zeros_like(waiting)
    rows, columns = np.nonzero(waiting)
    result = explain(image, labels, pure, rows, columns, _slack(noise))
    limit = MIXED + noise
    strange = np.zeros(labels.shape, np.float32)
    strange[rows, columns] = np.where(np.isfinite(result.residual), result.residual, 256)
    bases = np.zeros_like(pure)
    bases[rows, columns] = result.base
    odd = strange > limit
    count, parts = cv2.connectedComponents(odd.astype(np.uint8), connectivity=8, ltype=cv2.CV_32S)
    if count <= 1:
        return labels, paint, colorings, odd, others
    rows, columns = np.nonzero(odd)
    owner = parts[rows, columns] - 1
    order = np.argsort(owner, kind="stable")
    bounds = np.searchsorted(owner[order], np.arange(count))
    sizes = np.diff(bounds)
    labels, paint_list = labels.copy(), paint.tolist()
    colorings = list(colorings)
    by_size = np.argsort(-sizes, kind="stable")[:MOST_THIN]
    for part in by_size.tolist():
        index = order[bounds[part] : bounds[part + 1]]
        y, x = rows[index], columns[index]
        near = _near(labels, paint, y, x, colorings)
        if len(y) <= SPECK and _is_mixed(image[y, x], [colorings[i].color for i in near], limit):
            continue
        if len(y) <= SPECK and strange[y, x].max() < FAINT:
            continue
        chosen = _thin_color(image[y, x], strange[y, x], bases[y, x], colorings, near, limit)
        if chosen == NOBODY or (chosen == len(colorings) and not first):
            continue
        if chosen == len(colorings):
            colorings.append(Coloring(_extreme(image[y, x], strange[y, x])))
        color = colorings[chosen].color
        toward = color - bases[y, x]
        share = ((image[y, x] - bases[y, x]) * toward).sum(axis=1) / np.maximum((toward**2).sum(axis=1), 1)
        off = np.abs(image[y, x] - bases[y, x] - np.clip(share, 0, 1)[:, None] * toward).max(axis=1)
        mine = share >= min(THIN, 0.8 * float(share.max()))
        others[y, x] = mine & (off > OTHER)
        labels[y[mine], x[mine]] = len(paint_list)
        pure[y[mine], x[mine]] = color
        paint_list.append(chosen)
    return labels, np.asarray(paint_list, np.int32), colorings, odd, others


def _extreme(pixels: Floats, strange: Floats) -> Floats:
    """The colour of a thin part: that of its pixels that are least mixed."""
    top = strange >= np.quantile(strange, 0.75)
    return np.round(np.median(pixels[top], axis=0))


def _near(labels: Ints, paint: Ints, y: Ints, x: Ints, colorings: list[Coloring]) -> list[int]:
    """Flat colourings that occur beside some pixels."""
    rows = slice(max(int(y.min()) - BESIDE, 0), int(y.max()) + BESIDE + 1)
    columns = slice(max(int(x.min()) - BESIDE, 0), int(x.max()) + BESIDE + 1)
    seen = labels[rows, columns]
    seen = seen[(seen != NOBODY) & (seen < len(paint))]
    return [i for i in np.unique(paint[seen]).tolist() if colorings[i].ramp is None]


def _is_mixed(pixels: Floats, colors: list[Floats], limit: float) -> bool:
    """Whether all pixels are mixtures of some three of the colours, and mostly of one of them."""
    if len(colors) < 3:
        return False
    first, second, third = np.moveaxis(np.array(list(itertools.combinations(colors[:8], 3))), 1, 0)[
        :, :, None
    ]
    one, other, away = second - first, third - first, pixels - first
    # The nearest point of the plane of three colours, or of their line: the sides are of whole levels.
    a, b, c = ((x * y).sum(axis=2) for x, y in ((one, one), (one, other), (other, other)))
    p, q = (away * one).sum(axis=2), (away * other).sum(axis=2)
    determinant = a * c - b * b
    flat = determinant > 0
    scale = np.where(flat, determinant, np.maximum(a + c, 1))
    shares = np.where(flat, c * p - b * q, p) / scale, np.where(flat, a * q - b * p, q) / scale
    off = np.abs(away - shares[0][..., None] * one - shares[1][..., None] * other).max(axis=2)
    inside = (np.minimum(*shares) > -0.05) & (shares[0] + shares[1] < 1.05)
    return bool(((off <= limit) & inside).any(axis=0).all())


def _thin_color(
    pixels: Floats,
    strange: Floats,
    bases: Floats,
    colorings: list[Coloring],
    near: list[int],
    limit: float,
) -> int:
    """Which colouring a thin part has; one more than there are for a new one, NOBODY for none.

    A colour of the palette, if all its pixels lie between what is beside them and that colour. A faint
    mixture with a colour that is beside them is that colour's tip, too small to show.
    """
    flat = [i for i, coloring in enumerate(colorings) if coloring.ramp is None]
    if not flat:
        return len(colorings)
    colors = np.array([colorings[i].color for i in flat])
    top = strange >= np.quantile(strange, 0.5)
    pixel, base = pixels[top][:, None], bases[top][:, None]
    toward = colors[None] - base
    square = (toward**2).sum(axis=2)
    share = ((pixel - base) * toward).sum(axis=2) / np.maximum(square, 1)
    off = np.abs(pixel - base - np.clip(share, 0, 1)[..., None] * toward).max(axis=2)
    fits = np.quantile(off, 0.8, axis=0) <= limit
    clear = fits & (share.max(axis=0) >= 0.4)
    if clear.any():
        return flat[int(np.where(clear, share.max(axis=0), -np.inf).argmax())]
    return NOBODY if any(fits[flat.index(i)] for i in near) else len(colorings)


def _fill(labels: Ints, pure: Floats) -> Ints:
    """Pixels that are far from all seeds get the nearest one's region."""
    empty = labels == NOBODY
    if not empty.any():
        return labels
    _, nearest = cv2.distanceTransformWithLabels(
        empty.astype(np.uint8), cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL
    )
    rows, columns = np.nonzero(~empty)
    source = np.zeros(int(nearest.max()) + 1, np.int64)
    source[nearest[rows, columns]] = rows * labels.shape[1] + columns
    take = source[nearest[empty]]
    filled = labels.copy()
    filled[empty] = labels.reshape(-1)[take]
    pure[empty] = pure.reshape(-1, pure.shape[2])[take]
    return filled


def _paint_of(regions: Ints, painted: Ints) -> Ints:
    paint = np.zeros(int(regions.max()) + 1, np.int32)
    paint[regions.reshape(-1)] = painted.reshape(-1)
    return paint


def components(painted: Ints, image: Floats) -> Ints:
    """Connected parts of one colouring; where two cross on a diagonal, what there is less of goes on."""
    inside = np.ones(painted.shape, np.bool_)
    count, parts = linked_parts(painted[:, 1:] == painted[:, :-1], painted[1:] == painted[:-1], inside)
    sets = Sets(count)
    rows, columns = np.nonzero(crossings(painted))
    wins = main_diagonal(image, rows, columns)
    for y, x, main in zip(rows.tolist(), columns.tolist(), wins.tolist(), strict=True):
        if main:
            sets.join(int(parts[y, x]), int(parts[y + 1, x + 1]))
        else:
            sets.join(int(parts[y, x + 1]), int(parts[y + 1, x]))
    return sets.numbers()[parts]


def crossings(labels: Ints) -> Bools:
    """Corners of four pixels where two labels meet as on a chess board, shape (height - 1, width - 1)."""
    a, b, c, d = labels[:-1, :-1], labels[:-1, 1:], labels[1:, :-1], labels[1:, 1:]
    return np.asarray((a == d) & (b == c) & (a != b))


def main_diagonal(image: Floats, rows: Ints, columns: Ints) -> Bools:
    """Whether upper left and lower right are the connected ones of four pixels: what there is less of around
    is, as lines are.
    """
    a, b = image[rows, columns], image[rows, columns + 1]
    c, d = image[rows + 1, columns], image[rows + 1, columns + 1]
    soft = filters.box_blur(np.asarray(image, np.float32), AROUND)
    mean = sum(soft[rows + down, columns + right] for down in (0, 1) for right in (0, 1)) / 4
    main, other = np.abs((a + d) / 2 - mean).max(axis=1), np.abs((b + c) / 2 - mean).max(axis=1)
    return np.asarray(main >= other)
