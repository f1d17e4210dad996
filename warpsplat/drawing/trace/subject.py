"""Guess from its statistics what an image shows, and so how to vectorize it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import cv2
import numpy as np

from warpsplat.drawing.trace.grids import Bools, Floats, Ints, channel_max, dilated, eroded
from warpsplat.drawing.trace.lattice import CELLS, MOST_COLORS, find_lattice
from warpsplat.drawing.trace.pixels import changes
from warpsplat.errors import counted
from warpsplat.portable import elementary
from warpsplat.scene import FloatArray

Subject = Literal["photo", "drawing", "pixel"]


@dataclass(frozen=True)
class Guess:
    """The subject that an image was taken for."""

    subject: Subject
    why: str
    """The reason, as a phrase for a message."""


TINY_PIXELS = 256
TINY_SIDE, TINY_SIDE_PIXELS = 2, 1024
"""Largest side and number of pixels at which an image counts as pixel art: exact cells take few bytes."""


def guess_subject(image: FloatArray) -> Guess:
    """Tell photographs, drawings and pixel art apart: what is drawn in lines is a drawing, too.

    Args:
        image: sRGB in [0, 1], shape (height, width, 3); premultiplied with opacity, shape (height, width, 4).
    """
    guess = _guess(image)
    side, pixels = min(image.shape[:2]), image.shape[0] * image.shape[1]
    is_tiny = pixels <= TINY_PIXELS or (side <= TINY_SIDE and pixels <= TINY_SIDE_PIXELS)
    return Guess("pixel", f"no more than {pixels} pixels") if is_tiny and guess.subject == "photo" else guess


LARGEST = 1024  # [px] side of the part in the middle of an image that is inspected
EDGE = 24  # [levels] step between neighbours from which on there is an edge
DITHERED = 0.25  # share of pixels on strong edges from which on an image may be dithered
CROSS = (0, 1), (2, 1), (1, 0), (1, 2)  # offsets of the four neighbours from the upper left of 3x3 pixels
SPECKLED = 0.055  # share of pixels unlike all their neighbours, above which edges are the dots of a dither
NEAR_GROUND = 8  # [levels] that a pixel of the ground is off the most frequent colour at the most
INSIDE, LEAST_INSIDE = (
    5,
    0.1,
)  # [px] side of the square around a pixel inside what is on the ground; least share of
# such pixels, else there are only thin lines on it
PAPER = 0.2  # share of pixels of one colour from which on it is paper
THIN = 0.3  # share of strong edges away from what is thick, above which there is ink on paper
GRAINY = 0.02  # share of pixels that are paper or away from edges, below which those edges are grain
FEW, FLAT, CONTRAST, EVENLY, NEEDED = 8.7, 8.9, 2.5, 3.0, 24.6
"""Weights of the evidence for a drawing, and its least sum: by logistic regression on 1,100 pictures, and a
search on 1,245 others for the weight of evenness."""
EVEN = 0.97  # share of evenly changing pixels, edges aside, above which an image is a drawing
LEAST_CONTRAST = 4.0  # [stops] below which an image is not less of a drawing
TEXTURED = 0.37  # share of pixels, away from edges, unlike those around them, above which there is a texture
UNLIKE = 2  # [levels] from the median of the pixels around


def _guess(image: FloatArray) -> Guess:
    """Guess as ``guess_subject``, whatever the size."""
    height, width = image.shape[:2]
    top, left = max(0, height - LARGEST) // 2, max(0, width - LARGEST) // 2
    part = _levels(image[top : top + LARGEST, left : left + LARGEST])
    colors, counts = _colors(part)
    cells = _cells(image, counts)
    if cells is not None:
        return Guess("pixel", cells)
    step = _step(part)
    strong = step > 2 * EDGE
    if strong.mean() > DITHERED and _isolated(part) > SPECKLED:
        return Guess("photo", "it is dithered")
    edges = step > EDGE
    usual = colors[counts.argmax()].astype(np.int16)
    off = channel_max(np.abs(part - usual))
    is_grainy = ((off == 0) | ~dilated(edges, 3)).mean() < GRAINY
    # What a photograph or a drawing has in it, rather than how much ground is around it.
    inside = eroded(off > NEAR_GROUND, INSIDE)
    thin = strong & ~dilated(inside, 2 * INSIDE - 1)
    if (off == 0).mean() > PAPER and thin.sum() > THIN * strong.sum():
        return Guess("drawing", "thin ink is on a plain ground")
    if inside.mean() < LEAST_INSIDE:
        inside[:] = True
    evenness = _evenness(part, inside & ~dilated(edges, 3))
    if evenness > EVEN:
        return Guess("drawing", "apart from edges it is flat or evenly shaded")
    calm = _calm(part)
    is_unlike = channel_max(np.abs(part - calm)) >= UNLIKE
    if (is_unlike & inside & ~dilated(edges, 5)).sum() > TEXTURED * inside.sum():
        return Guess("photo", "what is away from edges has a texture")
    few = _few_colors(*((_calm(calm), inside) if is_grainy else (calm, inside & ~edges)))
    flat = float((step[inside] == 0).mean())
    contrast = max(LEAST_CONTRAST, _contrast(part[_densest(np.minimum(step, 2 * EDGE))]))
    is_drawing = FEW * few + FLAT * flat + CONTRAST * contrast + EVENLY * evenness > NEEDED
    return (
        Guess("drawing", f"{few:.0%} of it is in a few colours")
        if is_drawing
        else Guess("photo", "it has many shades")
    )


DENSEST = 128  # [px] side of the part of an image with most edges


def _densest(values: Ints) -> tuple[slice, slice]:
    """Return the rows and columns of the square with the largest sum."""
    height, width = (min(DENSEST, side) for side in values.shape)
    sums = np.pad(values.cumsum(axis=0, dtype=np.int64).cumsum(axis=1), ((1, 0), (1, 0)))
    inside = sums[height:, width:] - sums[:-height, width:] - sums[height:, :-width] + sums[:-height, :-width]
    top, left = np.unravel_index(inside.argmax(), inside.shape)
    return slice(int(top), int(top) + height), slice(int(left), int(left) + width)


def _contrast(levels: Ints) -> float:
    """Return the binary logarithm of the standard deviation of the colours [levels]."""
    away = levels - levels.mean(axis=(0, 1))
    return float(elementary.log2(1 + np.sqrt(np.square(away).sum(axis=2).mean())))


def _levels(image: FloatArray) -> Ints:
    """Return an image in levels of 0..255."""
    return np.round(np.asarray(image) * 255).astype(np.int16)


def _colors(levels: Ints) -> tuple[Ints, Ints]:
    """Return the colours of an image and how many pixels have each."""
    packed = np.zeros(levels.shape[:2], np.int64)
    for channel in range(levels.shape[2]):
        packed = packed * 256 + levels[..., channel]
    keys, counts = np.unique(packed.reshape(-1), return_counts=True)
    shifts = 8 * np.arange(levels.shape[2])[::-1]
    return (keys[:, None] >> shifts) & 255, counts


def _isolated(levels: Ints) -> float:
    """Return the share of pixels that are darker than all four neighbours, or lighter, as at an edge."""
    tone = levels.mean(axis=2)
    inner = tone[1:-1, 1:-1]
    off = np.stack([inner - tone[y : y + inner.shape[0], x : x + inner.shape[1]] for y, x in CROSS])
    apart = (off > 2 * EDGE).all(axis=0) | (off < -2 * EDGE).all(axis=0)
    return float(apart.mean()) if inner.size else 0.0


def _step(levels: Ints) -> Ints:
    """Return the largest step to any of the four neighbours, over the channels, shape (height, width)."""
    right = channel_max(np.abs(np.diff(levels, axis=1)))
    below = channel_max(np.abs(np.diff(levels, axis=0)))
    step = np.zeros(levels.shape[:2], np.int16)
    for part in (slice(1, None), slice(None, -1)):
        step[:, part] = np.maximum(step[:, part], right)
        step[part] = np.maximum(step[part], below)
    return step


SPRITE, SMALL_SPRITE = 128, 24  # [px] longer side of an image whose pixels may each be a cell; in any colours
MOST_ALONE = 0.4  # largest share of pixels of a small sprite that are the only ones of their colours
EDGY = 0.2  # least share of its pixels at edges
FREQUENT, FREQUENT_PIXELS = 0.002, 3  # share of the pixels, and pixels, of a colour that is no antialiasing
MOSTLY_FREQUENT = 0.97  # least share of the pixels in such colours
SINGLE = 0.6  # share of columns, or rows, unlike both neighbours, above which an image was not enlarged


def _cells(image: FloatArray, counts: Ints) -> str | None:
    """Return what the cells of pixel art are like; None for other images. ``counts``: of its colours."""
    across, down = changes(image, _levels)
    cell = int(np.gcd.reduce(np.concatenate([across, down])))
    sides = image.shape[0] // cell, image.shape[1] // cell
    if _is_sprite(_levels(image[::cell, ::cell])):
        return f"{counted(len(counts), 'colour')} in cells of {cell}x{cell} px"
    if 2 <= len(counts) <= MOST_COLORS:
        if cell > 1:
            is_art = CELLS[0] <= min(sides) and max(sides) <= CELLS[1]
            return f"{counted(len(counts), 'colour')} in cells of {cell}x{cell} px" if is_art else None
        frequent = counts[counts >= max(FREQUENT_PIXELS, FREQUENT * counts.sum())].sum()
        sizes = np.diff(across), np.diff(down)
        is_scaled = all(len(each) >= CELLS[0] and (each == 1).mean() < SINGLE for each in sizes)
        if is_scaled and frequent >= MOSTLY_FREQUENT * counts.sum() and not _is_antialiased(_levels(image)):
            return f"{counted(len(counts), 'colour')} with hard edges"
    lattice = find_lattice(_levels(image).astype(np.uint8))
    if lattice is None:
        return None
    return f"{lattice.colors.shape[1]}x{lattice.colors.shape[0]} cells of {lattice.columns.period:.3g} px"


def _is_sprite(levels: Ints) -> bool:
    """Return whether a small image is drawn pixel by pixel: in recurring colours, without soft edges."""
    if not CELLS[0] <= min(levels.shape[:2]) <= max(levels.shape[:2]) <= SPRITE:
        return False
    counts = _colors(levels)[1]
    if len(counts) < 2:
        return False
    frequent = counts[counts >= max(FREQUENT_PIXELS, FREQUENT * counts.sum())].sum()
    if frequent < MOSTLY_FREQUENT * counts.sum() or len(counts) > MOST_COLORS:
        is_shaded = (counts == 1).sum() > MOST_ALONE * counts.sum() or (_step(levels) > EDGE).mean() < EDGY
        if is_shaded or max(levels.shape[:2]) > SMALL_SPRITE:
            return False
    # Opacities of a cut-out are all or nothing; what is antialiased has others.
    is_cut = levels.shape[2] == 4 and np.isin(levels[..., 3], (0, 255)).mean() > MOSTLY_FREQUENT
    return not _is_antialiased(levels, MIXED_CUT if is_cut else MIXED)


MIXED = 0.2  # share of mixtures among the pixels at edges from which on an image is antialiased
MIXED_CUT = 0.35  # the same of an image whose opacities are all or nothing
NEAR_MIXTURE = 6  # [levels] distance of a pixel from a mixture that it counts as


def _is_antialiased(levels: Ints, most: float = MIXED) -> bool:
    """Return whether many of the pixels at edges are mixtures of their neighbours on opposite sides."""
    mixed = np.zeros(levels.shape[:2], np.bool_)
    for part, seen in ((levels, mixed), (levels.swapaxes(0, 1), mixed.swapaxes(0, 1))):
        before, here, after = (part[:, i : part.shape[1] - 2 + i].astype(np.float32) for i in range(3))
        between = after - before
        share = ((here - before) * between).sum(axis=2) / np.maximum((between**2).sum(axis=2), 1)
        off = np.abs(here - before - share[..., None] * between).max(axis=2)
        is_edge = np.abs(between).max(axis=2) > EDGE
        seen[:, 1:-1] |= is_edge & (off < NEAR_MIXTURE) & (np.abs(share - 0.5) < 0.4)
    return bool(mixed.sum() > most * max(1, (_step(levels) > EDGE).sum()))


def _evenness(levels: Ints, inside: Bools) -> float:
    """Return the share of the pixels ``inside`` that hardly differ from the mean of those on either side."""
    bend = np.zeros(levels.shape[:2], np.int16)
    bend[:, 1:-1] = channel_max(np.abs(np.diff(levels, n=2, axis=1)))
    bend[1:-1] = np.maximum(bend[1:-1], channel_max(np.abs(np.diff(levels, n=2, axis=0))))
    return float((bend[inside] <= 1).mean()) if inside.any() else 0.0


FLAT_COLORS, FLAT_GREYS = 10, 4  # so many colours, of 13 levels each, are half of all greys
SAMPLES = 60_000  # pixels in which colours are counted
GREY = 4  # [levels] mean difference of the channels below which an image is grey
NEAR_COLOR = 6  # [levels] distance of a pixel from a colour that it counts as


def _calm(levels: Ints) -> Ints:
    """Return the median of the pixels around each one, shape (height, width, channel)."""
    return np.asarray(cv2.medianBlur(np.ascontiguousarray(levels, np.uint8), 5))


def _few_colors(calm: Ints, inside: Bools) -> float:
    """Return the share of the pixels ``inside`` near one of few colours; JPEG leaves it large in drawings."""
    rest: Floats = calm[inside].astype(np.float32)
    rest = rest[:: max(1, len(rest) // SAMPLES)]
    total = len(rest)
    is_grey = total and (rest[:, :3].max(axis=1) - rest[:, :3].min(axis=1)).mean() < GREY
    for _ in range(FLAT_GREYS if is_grey else FLAT_COLORS):
        if not len(rest):
            break
        key = np.zeros(len(rest), np.int64)
        for channel in (rest // 8).astype(np.int64).T:
            key = key * 32 + channel
        _, which, counts = np.unique(key, return_inverse=True, return_counts=True)
        center = np.median(rest[which == counts.argmax()], axis=0)
        rest = rest[np.abs(rest - center).max(axis=1) > NEAR_COLOR]
    return (total - len(rest)) / total if total else 0.0
