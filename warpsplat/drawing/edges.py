"""Clean edges of a picture: those between two flat colours, which tell how it was made."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from warpsplat.drawing.trace.grids import Bools, Floats, Ints, channel_max
from warpsplat.drawing.trace.mixtures import MIXED, mixed
from warpsplat.drawing.trace.seeds import EDGE, ROUNDING
from warpsplat.portable import filters
from warpsplat.scene.scene import ranges

FLAT = 3
"""Pixels in a row that are flat between edges."""

WIDEST = 7
"""Pixels of an edge with its rings, at the most: what a kernel of five pixels makes of a step."""

OVERSHOOT = 0.5
"""Share of an edge's step that its rings are at the most: outlines differ by more."""

SURE = 3.0
"""Standard deviations that votes for linear light are ahead by."""

SLANT = 0.06
"""How far an edge moves within two rows, to tell in which light it was mixed [px]."""

LINEAR = (np.round(16 * 255 * filters.linear_light(np.arange(256) / 255)) / 16).astype(np.float32)
"""The linear light of each level of sRGB, in sixteenths of levels, so that sums are exact."""

MIDDLES = (LINEAR[1:] + LINEAR[:-1]) / 2
"""Where one level of sRGB ends and the next begins, in linear light."""


@dataclass(frozen=True, eq=False)
class Edges:
    """The clean edges of an image."""

    plain: Floats
    """The image with their pixels as mixtures of their two colours, shape (height, width, channel)."""
    clean: Bools
    """Their pixels, shape (height, width)."""
    has_rings: bool
    """Whether most begin or end with pixels beyond their colours, as filters that sharpen leave."""
    is_linear: bool
    """Whether their colours were mixed in linear light."""


@dataclass(frozen=True, eq=False)
class _Crossings:
    """Where rows of an image cross its clean edges."""

    rows: Ints
    before: Ints
    """The last flat pixel before each edge."""
    after: Ints
    one: Floats
    """The colour there, shape (crossing, channel)."""
    other: Floats
    """That after the edge."""
    owner: Ints
    """The crossing of each pixel between."""
    columns: Ints
    """The column of each."""

    def beside(self, shape: tuple[int, ...], tolerance: float) -> list[Ints]:
        """Return the crossing of the same edge in the row above and below each; -1: none."""
        after = np.full((shape[0] + 2, shape[1] + 4), -1)
        after[self.rows + 1, self.before + 2] = np.arange(len(self.rows))
        beside = []
        for down in (-1, 1):
            number = np.full(len(self.rows), -1)
            for right in (2, -2, 1, -1, 0):
                other = after[self.rows + 1 + down, self.before + 2 + right]
                same = [channel_max(np.abs(c - c[other])) <= tolerance for c in (self.one, self.other)]
                is_next = (other >= 0) & same[0] & same[1]
                number[is_next] = other[is_next]
            beside.append(number)
        return beside


def find_edges(image: Floats, noise: float = 0.0, *, is_linear: bool | None = None) -> Edges:
    """Find the clean edges of an image.

    Args:
        image: Whole levels, shape (height, width, channel).
        noise: Of flat colours [levels].
        is_linear: Whether it was mixed in linear light; None: not known.
    """
    tolerance = ROUNDING + noise
    sides = [image, image.swapaxes(0, 1)]
    crossings, lines = zip(*[_crossings(side, tolerance) for side in sides], strict=True)
    if image.shape[2] == 4:
        is_linear = False
    if is_linear is None:
        votes = [_votes(side, found, tolerance) for side, found in zip(sides, crossings, strict=True)]
        votes += [_line_votes(side, found, tolerance) for side, found in zip(sides, lines, strict=True)]
        linear, gamma = (sum(vote[i] for vote in votes) for i in (0, 1))
        is_linear = linear - gamma > SURE * float(np.sqrt(linear + gamma))
    plain, clean = image.copy(), np.zeros(image.shape[:2], np.bool_)
    count, ringed = 0, 0
    for side, found, out, done in zip(
        sides, crossings, (plain, plain.swapaxes(0, 1)), (clean, clean.T), strict=True
    ):
        one, other = found.one[found.owner], found.other[found.owner]
        at = found.rows[found.owner], found.columns
        low, high = (_is_ring(side[at], *pair, tolerance) for pair in ((one, other), (other, one)))
        share, off = mixed(side[at], one, other)
        between = off <= MIXED
        color = np.where(low[:, None], one, np.where(high[:, None], other, side[at]))
        if is_linear:
            light = [LINEAR[np.asarray(each, np.intp)] for each in (side[at], one, other)]
            share = np.clip(mixed(*light)[0], 0, 1)[:, None]
            color = np.where(
                (between & ~low & ~high)[:, None], np.round(share * one + (1 - share) * other), color
            )
        some = (low | high | between) & ~done[at]
        out[at[0][some], at[1][some]], done[at[0][some], at[1][some]] = color[some], True
        first, last = (
            found.columns == found.before[found.owner] + 1,
            found.columns == found.after[found.owner] - 1,
        )
        count += len(found.rows)
        ringed += len(np.unique(found.owner[(low & first) | (high & last)]))
    return Edges(plain, clean, 2 * ringed > count, is_linear)


def _crossings(image: Floats, tolerance: float) -> tuple[_Crossings, _Crossings]:
    """Return where the rows of an image cross its clean edges, and where lines on a flat colour."""
    width = image.shape[1]
    same = channel_max(np.abs(np.diff(image, axis=1))) <= tolerance
    flat = np.zeros(image.shape[:2], np.bool_)
    count = max(width - FLAT + 1, 0)
    runs = np.logical_and.reduce([same[:, k : k + count] for k in range(FLAT - 1)])
    for k in range(FLAT):
        flat[:, k : k + count] |= runs
    rows, before = np.nonzero(flat[:, :-1] & ~flat[:, 1:])
    ends_rows, after = np.nonzero(flat[:, 1:] & ~flat[:, :-1])
    # The next end in the same row, if there is one.
    number = np.searchsorted(ends_rows * width + after + 1, rows * width + before)
    known = number < len(after)
    rows, before, number = rows[known], before[known], number[known]
    after = after[number] + 1
    near = (ends_rows[number] == rows) & (after - before <= WIDEST + 1)
    rows, before, after = rows[near], before[near], after[near]
    one, other = image[rows, before], image[rows, after]
    apart = channel_max(np.abs(other - one))

    def taken(some: Bools) -> _Crossings:
        counts = (after - before - 1)[some]
        owner, columns = np.repeat(np.arange(len(counts)), counts), ranges(before[some] + 1, counts)
        return _Crossings(rows[some], before[some], after[some], one[some], other[some], owner, columns)

    return taken(apart > EDGE), taken(apart <= tolerance)


def _is_ring(pixels: Floats, near: Floats, far: Floats, tolerance: float) -> Bools:
    """Return where pixels are beyond a colour in all channels, seen from another one."""
    beyond = (near - pixels) * np.where(far < near, -1, 1)
    excess = np.maximum(-beyond, beyond - OVERSHOOT * np.abs(far - near))
    return np.asarray(channel_max(excess) <= tolerance)


def _votes(image: Floats, found: _Crossings, tolerance: float) -> tuple[int, int]:
    """Return how many crossings say that colours were mixed in linear light, and how many in sRGB.

    The area beside an edge changes evenly from row to row, in the light in which colours were mixed.
    """
    beside = found.beside(image.shape, tolerance)
    known, bends = (beside[0] >= 0) & (beside[1] >= 0), []
    for values in (LINEAR, np.arange(256, dtype=np.float32)):
        one, other, pixels = (
            values[np.asarray(each, np.intp)]
            for each in (found.one, found.other, image[found.rows[found.owner], found.columns])
        )
        share, _ = mixed(pixels, one[found.owner], other[found.owner])
        place = found.before + np.bincount(found.owner, share, len(found.rows))
        known &= np.abs(place[beside[0]] - place[beside[1]]) > SLANT
        bend = place[beside[0]] - 2 * place + place[beside[1]]
        # That of a round edge is the same in the next row.
        bends.append(np.abs(bend - bend[beside[1]]))
    known &= known[beside[1]]
    # A level more or less in any of the rows bends an edge, too.
    known &= np.maximum(*bends) * channel_max(np.abs(found.other - found.one)) > 2 * tolerance
    linear, gamma = (bend[known] for bend in bends)
    return int((linear < gamma).sum()), int((gamma < linear).sum())


def _line_votes(image: Floats, found: _Crossings, tolerance: float) -> tuple[int, int]:
    """Return how many crossings of lines say that colours were mixed in linear light, and how many in sRGB.

    What a line takes from the ground is as much in each row, in the light in which colours were mixed.
    """
    beside = found.beside(image.shape, tolerance)
    at = found.rows[found.owner], found.columns
    bends = []
    for values in (LINEAR, np.arange(256, dtype=np.float32)):
        pixels, ground = (values[np.asarray(each, np.intp)] for each in (image[at], found.one[found.owner]))
        sums = [np.bincount(found.owner, less, len(found.rows)) for less in (ground - pixels).T]
        taken = np.stack(sums, axis=1).astype(np.float64)
        size = np.maximum(_length(taken), 1)
        bends.append(_length(taken[beside[0]] - 2 * taken + taken[beside[1]]) / size)
    known = (beside[0] >= 0) & (beside[1] >= 0) & (size > EDGE)
    known &= np.maximum(*bends) * size > 2 * tolerance
    linear, gamma = (bend[known] for bend in bends)
    return int((linear < gamma).sum()), int((gamma < linear).sum())


def _length(vectors: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    return np.asarray(np.sqrt((vectors**2).sum(axis=1)))
