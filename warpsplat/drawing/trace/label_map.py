"""Label maps finer than the pixels of an image, cut up into cells where labels meet and nowhere else."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from warpsplat.drawing.trace.grids import (
    AROUND,
    NO_REGION,
    Bools,
    Ints,
    joined,
    linked_components,
    prefers_main_diagonal,
)


@dataclass(frozen=True, eq=False)
class LabelMap:
    """A label for each cell of an image, of which ``scale`` lie along each side of a pixel.

    A pixel whose neighbours have the same label is kept whole, so that memory and time grow with the length
    of borders. Around the image is a frame of pixels without a label, NO_REGION.
    """

    pixels: Ints
    """The label of each pixel that is whole, with the frame, shape (height + 2, width + 2)."""
    block: Ints
    """Where the cells of a pixel are in ``blocks``, -1 if it is whole; shape (height + 2, width + 2)."""
    blocks: Ints
    """The labels of cells, shape (block, scale, scale)."""

    @classmethod
    def of(cls, labels: Ints) -> LabelMap:
        """Return a map whose cells are pixels, of shape (height, width)."""
        nothing = np.zeros(0, np.intp)
        return cls.cut(labels, nothing, nothing, np.zeros((0, 1, 1), labels.dtype))

    @classmethod
    def cut(cls, labels: Ints, rows: Ints, columns: Ints, cells: Ints) -> LabelMap:
        """Return a map of which some pixels have several labels.

        Args:
            labels: Of pixels, shape (height, width).
            rows: Of the pixels that are cut up, shape (pixel,).
            columns: Of these, shape (pixel,).
            cells: Labels in these, shape (pixel, scale, scale).
        """
        pixels = np.pad(labels, 1, constant_values=NO_REGION)
        is_cut = np.zeros(pixels.shape, np.bool_)
        is_cut[rows + 1, columns + 1] = True
        # Of two cells with a border between, the lower or right one is in a block.
        in_block = is_cut.copy()
        in_block[:, 1:] |= is_cut[:, :-1] | (pixels[:, 1:] != pixels[:, :-1])
        in_block[1:] |= is_cut[:-1] | (pixels[1:] != pixels[:-1])
        block = np.full(pixels.shape, -1, np.int32)
        whole = pixels[in_block]
        block[in_block] = np.arange(len(whole))
        blocks = np.broadcast_to(whole[:, None, None], (len(whole), *cells.shape[1:])).copy()
        blocks[block[rows + 1, columns + 1]] = cells
        return cls(pixels, block, blocks)

    @property
    def scale(self) -> int:
        """Cells along a pixel."""
        return self.blocks.shape[1]

    @property
    def shape(self) -> tuple[int, int]:
        """Cells along the height and the width of the image."""
        height, width = self.pixels.shape
        return (height - 2) * self.scale, (width - 2) * self.scale

    @cached_property
    def corners(self) -> tuple[Ints, Ints]:
        """The row and the column of the first cell of each block, shape (block,) each."""
        rows, columns = np.nonzero(self.block >= 0)
        return self.scale * (rows - 1), self.scale * (columns - 1)

    def place(self, rows: Ints, columns: Ints) -> Ints:
        """Return where cells are among those of all blocks; -1 for those of whole pixels."""
        size = self.scale
        block = self.block[rows // size + 1, columns // size + 1].astype(np.intp)
        return np.where(block < 0, -1, (block * size + rows % size) * size + columns % size)

    def at(self, rows: Ints, columns: Ints) -> Ints:
        """Return the labels of cells, up to a pixel outside the image."""
        place = self.place(rows, columns)
        whole = self.pixels[rows // self.scale + 1, columns // self.scale + 1]
        return np.where(place < 0, whole, self.blocks.reshape(-1)[place])

    def window(self, top: int, left: int, bottom: int, right: int) -> Ints:
        """Return the labels in a rectangle of cells inside the image, shape (bottom - top, right - left)."""
        size = self.scale
        first, last = (top // size, left // size), (-(-bottom // size), -(-right // size))
        part = np.s_[first[0] + 1 : last[0] + 1, first[1] + 1 : last[1] + 1]
        block, pixels = self.block[part], self.pixels[part]
        cells = np.repeat(np.repeat(pixels, size, axis=0), size, axis=1)
        rows, columns = np.nonzero(block >= 0)
        by_pixel = cells.reshape(pixels.shape[0], size, pixels.shape[1], size)
        by_pixel[rows, :, columns] = self.blocks[block[rows, columns]]
        return cells[top - size * first[0] :, left - size * first[1] :][: bottom - top, : right - left]

    def mapped(self, values: Ints, outside: int = NO_REGION) -> LabelMap:
        """Return the map with other values in place of labels, and of what has none; shape (label,)."""
        table = np.append(values, outside)  # NO_REGION is the last
        return replace(self, pixels=table[self.pixels], blocks=table[self.blocks])

    def sizes(self, count: int) -> Ints:
        """Return how many cells have each label, shape (count,)."""
        whole = self.pixels[self.block < 0]
        found = self.scale * self.scale * np.bincount(whole[whole >= 0], minlength=count)
        return found + np.bincount(self.blocks[self.blocks >= 0], minlength=count)

    def border(self) -> Ints:
        """Return the labels along the border of the image, those of corners twice."""
        height, width = self.shape
        rows, columns = np.arange(height), np.arange(width)
        ends = (np.zeros(1, np.intp), columns), (np.full(1, height - 1), columns)
        sides = (rows, np.zeros(1, np.intp)), (rows, np.full(1, width - 1))
        return np.concatenate([self.at(*cells) for cells in (*ends, *sides)])

    def sides(self) -> list[tuple[Ints, Ints, Ints, Ints]]:
        """Return the sides of cells on which labels meet: those above cells, and those on their left.

        Each as the row and the column of the cell, the label beyond, and its own; shape (side,) each.
        """
        (top, left), along = self.corners, np.arange(self.scale)
        above = self.at(top[:, None] - 1, left[:, None] + along)
        before = self.at(top[:, None] + along, left[:, None] - 1)
        found: list[tuple[Ints, Ints, Ints, Ints]] = []
        for beyond in (
            np.concatenate([above[:, None], self.blocks[:, :-1]], axis=1),
            np.concatenate([before[:, :, None], self.blocks[:, :, :-1]], axis=2),
        ):
            at = block, down, right = np.nonzero(beyond != self.blocks)
            found.append((top[block] + down, left[block] + right, beyond[at], self.blocks[at]))
        return found

    def prefers_main(self, rows: Ints, columns: Ints) -> Bools:
        """Return which cells are connected with the one above on their left, where two labels cross."""
        around = np.arange(-AROUND, AROUND)
        height, width = self.shape
        down = np.clip(rows[:, None, None] + around[:, None], -1, height)
        return prefers_main_diagonal(self.at(down, np.clip(columns[:, None, None] + around, -1, width)))


def label_components(values: LabelMap) -> tuple[LabelMap, Ints]:
    """Number the connected components of equal values, which are not negative; return the value of each, too.

    Where two values cross as on a chessboard, ``prefers_main`` decides which pair is connected.
    """
    size, pixels, is_whole = values.scale, values.pixels, values.block < 0
    whole, outer = linked_components(pixels[:, 1:] == pixels[:, :-1], pixels[1:] == pixels[:-1], is_whole)
    # All blocks as one column, in which none is linked to the next.
    lines = values.blocks.reshape(-1, size)
    down = lines[1:] == lines[:-1]
    down[size - 1 :: size] = False
    cut, inner = linked_components(lines[:, 1:] == lines[:, :-1], down, np.ones(lines.shape, np.bool_))
    parts = replace(values, pixels=outer, blocks=(whole + inner).reshape(values.blocks.shape))
    number = joined(whole + cut, *np.concatenate([*_links(values, parts), _diagonals(values, parts)], axis=1))
    value = np.full(int(number.max()) + 1, NO_REGION, np.int32)
    value[number[parts.blocks]] = values.blocks
    value[number[parts.pixels[is_whole]]] = pixels[is_whole]
    is_real = value >= 0
    label = np.where(is_real, np.cumsum(is_real) - 1, NO_REGION).astype(np.int32)
    return parts.mapped(label[number]), value[is_real]


def _links(values: LabelMap, parts: LabelMap) -> list[Ints]:
    """Return which parts of blocks have the value of one in a pixel beside them, shape (2, pair) each."""
    size, along = values.scale, np.arange(values.scale)
    (top, left), (height, width) = values.corners, values.shape
    inside = np.flatnonzero((top < height) & (left < width))
    top, left = top[inside, None], left[inside, None]
    found = []
    for line, rows, columns in (
        (np.s_[:, 0], top - 1, left + along),
        (np.s_[:, -1], top + size, left + along),
        (np.s_[:, :, 0], top + along, left - 1),
        (np.s_[:, :, -1], top + along, left + size),
    ):
        same = values.at(rows, columns) == values.blocks[inside][line]
        found.append(np.stack([parts.at(rows, columns)[same], parts.blocks[inside][line][same]]))
    return found


def _diagonals(values: LabelMap, parts: LabelMap) -> Ints:
    """Return the parts that are connected where two values cross as on a chessboard, shape (2, pair)."""
    rows, columns, above, own = values.sides()[0]
    crossing = values.at(rows - 1, columns - 1) == own
    rows, columns, above = rows[crossing], columns[crossing], above[crossing]
    crossing = values.at(rows, columns - 1) == above
    rows, columns = rows[crossing], columns[crossing]
    main = values.prefers_main(rows, columns).astype(np.intp)
    return np.stack([parts.at(rows - 1, columns - main), parts.at(rows, columns + main - 1)])
