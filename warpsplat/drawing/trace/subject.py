"""Guess what an image shows, and so how to vectorize it: what cells, or few flat colours, explain."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import cv2
import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from warpsplat.drawing.trace.grids import Bools, Floats, Ints, channel_max, dilated
from warpsplat.drawing.trace.lattice import CELLS, MOST_COLORS, PART, find_lattice
from warpsplat.drawing.trace.pixels import MOST_CELLS, changes
from warpsplat.drawing.trace.regions import MOST_NOISE
from warpsplat.drawing.trace.seeds import EDGE
from warpsplat.errors import counted
from warpsplat.scene import FloatArray

Subject = Literal["photo", "drawing", "pixel"]

STRIP_PIXELS = 1 << 20
"""Pixels that are rounded at a time."""

TINY = 16
"""[px] side of a square that exact cells are best for; narrower ones may have as many pixels more."""


@dataclass(frozen=True)
class Guess:
    """The subject that an image was taken for."""

    subject: Subject
    why: str
    """The reason, as a phrase for a message."""


def guess_subject(image: FloatArray) -> Guess:
    """Tell photographs, drawings and pixel art apart: what is drawn in lines is a drawing, too.

    Args:
        image: sRGB in [0, 1], shape (height, width, 3); premultiplied with opacity, shape (height, width, 4).
    """
    levels = _levels(image)
    cells = _cells(levels)
    if cells:
        return Guess("pixel", cells)
    height, width = image.shape[:2]
    top, left = max(0, height - PART) // 2, max(0, width - PART) // 2
    why = _flat_colors(levels[top : top + PART, left : left + PART])
    if why:
        return Guess("drawing", why)
    if min(height, width) * height * width <= TINY * TINY * TINY:
        return Guess("pixel", f"no more than {height * width} pixels")
    return Guess("photo", "it has many shades")


def _levels(image: FloatArray) -> Ints:
    """Return an image in levels of 0..255."""
    image = np.asarray(image)
    levels = np.empty(image.shape, np.int16)
    step = 1 + STRIP_PIXELS // image.shape[1]
    for top in range(0, len(image), step):
        levels[top : top + step] = np.round(image[top : top + step] * 255)
    return levels


WINDOW = 6  # [px] side of the squares that two colours each should explain
MOST_WINDOWS = 2048  # that are looked at
STRONG = 0.2  # least variance of a window with an edge, over the mean of all windows
JPEG_BLOCK = 8  # [px] how far from an edge its traces in a JPEG reach
QUIET, NOISY = 0.1, 4.0  # share of the windows that show nothing but noise; variance of others, over theirs
SPREAD, MANY_SHADES = 4.0, 1.28
"""Weight of the share of variance that two colours leave, and the sum of that and the spread of their
differences from which on an image is a photograph: 28 photographs have 1.4 or more, 165 logos 1.15 or less;
chosen on them and 720 others, half of them with noise, JPEG or blur (docs/experiments.md)."""


def _flat_colors(levels: Ints) -> str | None:
    """Return how flat colours, and mixtures of two beside edges, explain an image; None: they do not.

    What noise and JPEG leave is little beside edges. A drawing has few colours, so edges of few strengths.
    """
    missing = [(0, max(0, WINDOW - side)) for side in levels.shape[:2]]
    levels = np.pad(levels, [*missing, (0, 0)], mode="edge")
    step = WINDOW // 2
    variance, uneven = _variances(levels, step)
    noise = max(1.0, min(float(np.quantile(uneven, QUIET)), MOST_NOISE**2))
    is_edge = variance > max(STRONG * float(variance.mean()), NOISY * noise)
    # Texture away from edges counts as much as they do, even shading does not.
    is_near = dilated(is_edge, 1 + 2 * -(-JPEG_BLOCK // step))
    kept = np.flatnonzero(is_edge | ((uneven > NOISY * noise) & ~is_near))
    if not len(kept):
        is_grain = noise > 1 and levels.var(axis=(0, 1)).mean() > NOISY * noise
        return None if is_grain else "it is flat or evenly shaded"
    rows, columns = np.divmod(kept[:: -(-len(kept) // MOST_WINDOWS)], variance.shape[1])
    windows = sliding_window_view(levels, (WINDOW, WINDOW), axis=(0, 1))[::step, ::step][rows, columns]
    rest, differences = _two_colors(windows.transpose(0, 2, 3, 1).astype(np.float32))
    left = float(np.median(rest))
    if SPREAD * left + float(differences.std() / differences.mean()) >= MANY_SHADES:
        return None
    return f"{1 - left:.0%} of its details are flat colours and edges between them"


def _variances(levels: Ints, step: int) -> tuple[Floats, Floats]:
    """Return the variance of each window, and what an even slope leaves of it, shape (row, column)."""
    ends, count, middle = [side - WINDOW + 1 for side in levels.shape[:2]], WINDOW**2, (WINDOW - 1) / 2
    whole = levels.astype(np.float32)  # whole numbers have exact sums

    def sums(values: Floats) -> Floats:
        box = cv2.boxFilter(values, cv2.CV_64F, (WINDOW, WINDOW), anchor=(0, 0), normalize=False)
        return np.asarray(box.reshape(values.shape)[: ends[0] : step, : ends[1] : step])

    total = sums(whole)
    variance = sums(np.square(whole)) / count - np.square(total / count)
    rows, columns = (np.arange(side, dtype=np.float32) for side in levels.shape[:2])
    down = sums(whole * rows[:, None, None]) - (rows[: ends[0] : step, None, None] + middle) * total
    across = sums(whole * columns[:, None]) - (columns[: ends[1] : step, None] + middle) * total
    even = 12 * (np.square(down) + np.square(across)) / (count**2 * (count - 1))
    return variance.mean(axis=2), (variance - even).mean(axis=2)


def _two_colors(windows: Floats) -> tuple[Floats, Floats]:
    """Return how well two colours explain each window, shape (window, y, x, channel).

    Returns:
        The share of its variance that they leave, and how far they are apart [levels]. Single pixels are not
        explained: they are dots of a dither, or grain.
    """
    pixels = windows.reshape(len(windows), WINDOW**2, -1)
    away = pixels - pixels.mean(axis=1, keepdims=True)
    total = np.square(away).sum(axis=2)
    along = (away * away[np.arange(len(away)), total.argmax(axis=1)][:, None]).sum(axis=2)
    is_first = 2 * along > along.max(axis=1, keepdims=True) + along.min(axis=1, keepdims=True)
    for _ in range(3):
        shares = np.stack([is_first, ~is_first]).astype(np.float32)
        shares /= np.maximum(shares.sum(axis=2, keepdims=True), 1)
        colors = (shares[..., None] * pixels).sum(axis=2)
        off = np.square(pixels - colors[:, :, None]).sum(axis=3)
        is_first = off[0] < off[1]
    first = is_first.reshape(windows.shape[:3])
    is_alone = np.ones(first.shape, np.bool_)
    for here, beside in ((is_alone, first), (is_alone.swapaxes(1, 2), first.swapaxes(1, 2))):
        differs = beside[:, 1:] != beside[:, :-1]
        here[:, 1:] &= differs
        here[:, :-1] &= differs
    rest = np.where(is_first ^ is_alone.reshape(is_first.shape), *off).sum(axis=1)
    return np.minimum(rest / total.sum(axis=1), 1), np.sqrt(np.square(colors[0] - colors[1]).sum(axis=1))


SPRITE = 128  # [px] longest side of an image whose pixels may each be a cell
MIXED = 0.1  # how far mixtures are off the line between two colours, or from its ends, over its length
SOFT = 0.2
"""Share of mixtures among pixels at corners of edges, above which edges are antialiased: 60 sprites and QR
codes have 0.19 or less, icons and photographs of 16 to 256 px 0.21 or more."""


def _cells(levels: Ints) -> str | None:
    """Return what the cells of pixel art are like that explain an image; None if none do."""
    across, down = changes(levels)
    size = int(np.gcd.reduce(np.concatenate([across, down])))
    sides = levels.shape[0] // size, levels.shape[1] // size
    if (len(across) - 1) * (len(down) - 1) <= MOST_CELLS:
        cells = levels[down[:-1, None], across[:-1]]
        count = len(np.unique(cells.reshape(-1, cells.shape[2]), axis=0))
        is_small = CELLS[0] <= min(sides) and max(sides) <= (CELLS[1] if size > 1 else SPRITE)
        runs = np.diff(across), np.diff(down)
        is_scaled = all(len(each) >= CELLS[0] and np.median(each) >= 2 for each in runs)
        is_few, is_hard = 2 <= count <= MOST_COLORS, _has_hard_corners(cells)
        if is_small and is_few + is_hard + (size > 1) >= 2:
            return f"{counted(count, 'colour')} in cells of {size}x{size} px"
        if is_scaled and is_hard:
            return f"{counted(count, 'colour')} with hard edges"
    lattice = find_lattice(levels.astype(np.uint8))
    if lattice is None or not _has_hard_corners(lattice.palette[lattice.colors]):
        return None
    return (
        f"{lattice.colors.shape[1]}x{lattice.colors.shape[0]} cells of {np.diff(lattice.across).max():.3g} px"
    )


def _has_hard_corners(cells: Ints) -> bool:
    """Return whether edges have corners, and few of their pixels are mixtures of those on either side."""
    edges, mixed = _across(cells)
    others, also_mixed = (mask.T for mask in _across(cells.swapaxes(0, 1)))
    corners = edges & others
    count = int(((mixed | also_mixed) & corners).sum())
    return bool(corners.any()) and count <= SOFT * int(corners.sum())


def _across(cells: Ints) -> tuple[Bools, Bools]:
    """Return which pixels are beside edges across their rows, and which are mixtures of those beside them."""
    is_edge = channel_max(np.abs(np.diff(cells, axis=1))) > EDGE
    beside, mixed = np.zeros(cells.shape[:2], np.bool_), np.zeros(cells.shape[:2], np.bool_)
    beside[:, 1:] |= is_edge
    beside[:, :-1] |= is_edge
    before, here, after = (cells[:, i : cells.shape[1] - 2 + i].astype(np.float32) for i in range(3))
    between = after - before
    share = ((here - before) * between).sum(axis=2) / np.maximum(np.square(between).sum(axis=2), 1)
    wide, off = (channel_max(np.abs(step)) for step in (between, here - before - share[..., None] * between))
    mixed[:, 1:-1] = (wide > EDGE) & (off <= MIXED * wide) & (share > MIXED) & (share < 1 - MIXED)
    return beside, mixed
