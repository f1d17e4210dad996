"""What a picture shows, from its statistics: which way of vectorizing suits it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import cv2
import numpy as np

from warpsplat.drawing.trace.grids import Bools, Floats, Ints
from warpsplat.portable.filters import distance
from warpsplat.portable.sequences import convolve
from warpsplat.scene import FloatArray

Subject = Literal["photo", "drawing", "line", "pixel"]

LARGEST = 1024
"""Longer side of what is looked at [px]; of a larger picture the middle."""

STRIP_ROWS = 64
"""Rows that are looked at in one go, where that is all of an image."""

STEP = 24
"""Step between neighbours from which on there is an edge [levels]."""

EVEN = 0.7
"""Share of even pixels, paper and edges aside, from which on a picture is drawn."""

FEW = 0.945
"""Share of pixels in FEW_COLORS colours from which on one with noise is."""

GRAINY = 0.02
"""Share of pixels beside no edge below which these are grain, unless there is paper."""

FEW_IN_GRAIN = 0.75
"""As FEW, of what is left of grain. With grain of 11 to 16 levels photographs have
0.2 to 0.6, drawings from 0.85 on."""

FEW_COLORS = 10
SAMPLES = 60_000
"""Pixels that colours are counted in."""

NEAR = 6
"""How far a pixel may be from such a colour [levels]."""

RESTLESS = 0.25
"""Share of pixels on strong edges from which on a picture is dithered."""

PAPER = 0.7
"""Least share of paper in a line drawing."""

THIN = 0.006
"""Half the width of a line over the longer side of the picture, at most, if it is more than LINE."""

LINE = 2.5
"""Half the width of a line in a small picture [px]."""

CELLS = (8, 256)
"""Fewest and most cells on a side of pixel art."""

SMALL = 128
"""Longer side of a picture whose pixels may each be a cell [px]."""

PIXEL_COLORS = 64

FEWEST = (2, 64, 1024)
"""Rows or columns, or pixels, up to which a picture is its pixels rather than a photograph; and pixels of
such rows at the most.
"""

MIXED = 0.2
"""Share of mixtures among the pixels at edges from which on a picture is antialiased."""


@dataclass(frozen=True)
class Guess:
    """What a picture shows."""

    subject: Subject
    why: str
    """Half a sentence."""


def guess_subject(image: FloatArray) -> Guess:
    """Tell photographs, drawings, line art and pixel art apart.

    Args:
        image: sRGB in [0, 1], shape (height, width, 3); premultiplied with opacity, shape (height, width, 4).
    """
    guess = _guess(image)
    side, pixels = min(image.shape[:2]), image.shape[0] * image.shape[1]
    if guess.subject == "photo" and (pixels <= FEWEST[1] or (side <= FEWEST[0] and pixels <= FEWEST[2])):
        return Guess("pixel", f"no more than {pixels} pixels")
    return guess


def _guess(image: FloatArray) -> Guess:
    """As ``guess_subject``, whatever the size."""
    part = _levels(_middle(image))
    colors, counts = _colors(part)
    cell = _cell(image, counts)
    if cell is not None:
        return Guess("pixel", f"{len(counts)} colours in cells of {cell}x{cell} px")
    step = _step(part)
    edges = step > STEP
    if (step > 2 * STEP).mean() > RESTLESS:
        return Guess("photo", f"{(step > 2 * STEP).mean():.0%} of the pixels are edges")
    if _is_line_art(part):
        return Guess("line", "thin ink on paper")
    paper = (part == colors[counts.argmax()]).all(axis=2)
    beside = cv2.dilate(edges.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
    if (paper | ~beside).mean() < GRAINY:
        few = _few_colors(part, np.zeros_like(edges), calmed=2)
        why = f"{few:.0%} of it, grain aside, has one of {FEW_COLORS} colours"
        return Guess("drawing" if few >= FEW_IN_GRAIN else "photo", why)
    evenness = _evenness(part, step, ~paper & ~beside)
    if evenness >= EVEN:
        return Guess("drawing", f"{evenness:.0%} of what is no edge is even")
    few = _few_colors(part, edges)
    if few >= FEW:
        return Guess("drawing", f"{few:.0%} of what is no edge has one of {FEW_COLORS} colours")
    return Guess("photo", f"{evenness:.0%} of what is no edge is even")


def _levels(image: FloatArray) -> Ints:
    """In 8 bits."""
    return np.round(np.asarray(image) * 255).astype(np.int16)


def _colors(levels: Ints) -> tuple[Ints, Ints]:
    """The colours of a picture and how many pixels have each."""
    packed = np.zeros(levels.shape[:2], np.int64)
    for channel in range(levels.shape[2]):
        packed = packed * 256 + levels[..., channel]
    keys, counts = np.unique(packed.reshape(-1), return_counts=True)
    shifts = 8 * np.arange(levels.shape[2])[::-1]
    return (keys[:, None] >> shifts) & 255, counts


def _middle(image: FloatArray) -> FloatArray:
    height, width = image.shape[:2]
    top, left = max(0, height - LARGEST) // 2, max(0, width - LARGEST) // 2
    return image[top : top + LARGEST, left : left + LARGEST]


def _step(levels: Ints) -> Ints:
    """Largest step to any of the four neighbours, over the channels, shape (height, width)."""
    right = np.abs(np.diff(levels, axis=1)).max(axis=2)
    below = np.abs(np.diff(levels, axis=0)).max(axis=2)
    step = np.zeros(levels.shape[:2], np.int16)
    step[:, 1:], step[:, :-1] = right, np.maximum(step[:, :-1], right)
    step[:, 1:] = np.maximum(step[:, 1:], right)
    step[1:] = np.maximum(step[1:], below)
    step[:-1] = np.maximum(step[:-1], below)
    return step


def _cell(image: FloatArray, counts: Ints) -> int | None:
    """Side of the cells that pixel art is made of [px]; None for other pictures."""
    height, width = image.shape[:2]
    if len(counts) > PIXEL_COLORS or len(counts) < 2:
        return None
    columns, rows = _borders(image)
    cell = int(np.gcd.reduce(np.concatenate([columns, rows, [width, height]])))
    across, down = width // cell, height // cell
    if cell > 1:
        return cell if CELLS[0] <= min(across, down) and max(across, down) <= CELLS[1] else None
    # Antialiasing makes many colours of few pixels each.
    frequent = counts[counts >= max(3, 0.002 * width * height)].sum()
    if max(width, height) > SMALL or frequent < 0.97 * width * height:
        return None
    return None if _antialiased(_levels(image)) else 1


def _borders(image: FloatArray) -> tuple[Ints, Ints]:
    """Columns and rows where some pixel differs from the one before, by strips."""
    across, down = np.zeros(image.shape[1] - 1, np.bool_), np.zeros(image.shape[0] - 1, np.bool_)
    for top in range(0, len(down), STRIP_ROWS):
        levels = _levels(image[top : top + STRIP_ROWS + 1])
        across |= (np.diff(levels, axis=1) != 0).any(axis=(0, 2))
        down[top : top + STRIP_ROWS] = (np.diff(levels, axis=0) != 0).any(axis=(1, 2))
    return np.flatnonzero(across) + 1, np.flatnonzero(down) + 1


def _antialiased(levels: Ints) -> bool:
    """Whether many of the pixels at edges are mixtures of their neighbours on opposite sides."""
    mixed = np.zeros(levels.shape[:2], np.bool_)
    for part, seen in ((levels, mixed), (levels.swapaxes(0, 1), mixed.swapaxes(0, 1))):
        before, here, after = (part[:, i : part.shape[1] - 2 + i].astype(np.float32) for i in range(3))
        between = after - before
        share = ((here - before) * between).sum(axis=2) / np.maximum((between**2).sum(axis=2), 1)
        off = np.abs(here - before - share[..., None] * between).max(axis=2)
        contrast = np.abs(between).max(axis=2) > STEP
        seen[:, 1:-1] |= contrast & (off < NEAR) & (np.abs(share - 0.5) < 0.4)
    return bool(mixed.sum() > MIXED * max(1, (_step(levels) > STEP).sum()))


def _is_line_art(levels: Ints) -> bool:
    """Whether there is little but thin dark lines on light paper."""
    flat = levels[..., :3].astype(np.int32)
    if levels.shape[2] == 4:
        flat = flat + 255 - levels[..., 3:].astype(np.int32)
    grey = flat.min(axis=2).astype(np.uint8)
    histogram = np.bincount(grey.reshape(-1), minlength=256)
    paper = int(convolve(np.pad(histogram, 4), np.ones(9)).argmax())
    darkest = float(np.percentile(grey, 0.2))
    if paper < 160 or paper - darkest < 80:
        return False
    ink = grey < 0.5 * (paper + darkest)
    blank = np.abs(grey.astype(np.int32) - paper) <= 24
    if blank.mean() < PAPER or ink.mean() < 0.002:
        return False
    beside = cv2.dilate(ink.astype(np.uint8), np.ones((5, 5), np.uint8)) > 0
    if (~blank & ~beside).mean() > max(0.005, 0.1 * ink.mean()):
        return False
    depth = distance(np.pad(ink, 1))[1:-1, 1:-1]
    widest = max(LINE, THIN * max(grey.shape))
    return bool(np.quantile(depth[ink], 0.97) <= widest)


def _evenness(levels: Ints, step: Ints, rest: Bools) -> float:
    """Share of flat or evenly changing pixels among ``rest``: what is neither paper nor beside an edge."""
    bend = np.zeros(levels.shape[:2], np.int16)
    bend[:, 1:-1] = np.abs(np.diff(levels, n=2, axis=1)).max(axis=2)
    bend[1:-1] = np.maximum(bend[1:-1], np.abs(np.diff(levels, n=2, axis=0)).max(axis=2))
    if rest.sum() < 0.002 * rest.size:
        return 1.0  # paper and edges only
    return float(max((step[rest] <= 1).mean(), (bend[rest] <= 1).mean()))


def _few_colors(levels: Ints, edges: Bools, calmed: int = 1) -> float:
    """Share of the pixels that lie near one of few colours, edges aside: what JPEG leaves of a drawing.

    ``calmed``: how often each pixel becomes the median of those around it before.
    """
    calm = np.ascontiguousarray(levels.astype(np.uint8))
    for _ in range(calmed):
        calm = np.asarray(cv2.medianBlur(calm, 5), np.uint8)
    rest: Floats = calm[~edges].astype(np.float32)
    rest = rest[:: max(1, len(rest) // SAMPLES)]
    if not len(rest):
        return 0.0
    total, covered = len(rest), 0
    for _ in range(FEW_COLORS):
        if not len(rest):
            break
        coarse = (rest // 8).astype(np.int64)
        key = np.zeros(len(rest), np.int64)
        for channel in range(rest.shape[1]):
            key = key * 32 + coarse[:, channel]
        _, which, counts = np.unique(key, return_inverse=True, return_counts=True)
        center = np.median(rest[which == counts.argmax()], axis=0)
        near = np.abs(rest - center).max(axis=1) <= NEAR
        covered += int(near.sum())
        rest = rest[~near]
    return covered / total
