"""Pixel art and QR codes: the exact outlines of the cells of each colour."""

from __future__ import annotations

import itertools
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from warpsplat.alpha import straight
from warpsplat.drawing.trace.grids import Bools, Floats, Ints, border, linked_components
from warpsplat.drawing.trace.label_map import LabelMap
from warpsplat.drawing.trace.lattice import MOST_COLORS, Cells, find_lattice
from warpsplat.drawing.trace.planar import find_loops
from warpsplat.errors import ImageError
from warpsplat.scene import Basis, Canvas, FloatArray, Kind, Rule, Scene
from warpsplat.scene.scene import starts_of

MOST_CELLS = 262_144  # of pixel art: nobody would edit the outlines of more
AT_ONCE = 64  # [px] of each row compared at a time


def find_cells(image: FloatArray) -> Cells:
    """Return the cells of pixel art: exactly, or with noise and soft borders removed if there is a lattice.

    Args:
        image: sRGB in [0, 1], shape (height, width, 3); premultiplied with opacity, shape (height, width, 4).

    Raises:
        ImageError: There are more than ``MOST_CELLS``.
    """
    shown = np.concatenate([straight(image), image[..., 3:]], axis=2)
    levels = np.round(shown * 255).astype(np.uint8)  # the colours of a file have 8 bits
    across, down = changes(levels)
    size = int(np.gcd.reduce(np.concatenate([across, down])))
    cells = levels[down[:-1, None], across[:-1]]
    palette, colors = np.unique(cells.reshape(-1, image.shape[2]), axis=0, return_inverse=True)
    if size == 1 and len(palette) > MOST_COLORS:
        lattice = find_lattice(levels)
        if lattice:
            return lattice
    if cells.shape[0] * cells.shape[1] > MOST_CELLS:
        shape = f"{cells.shape[1]}x{cells.shape[0]}"
        raise ImageError(f"{shape} cells, more than pixel art may have ({MOST_CELLS})")
    return Cells(colors.reshape(cells.shape[:2]), palette, across, down, 1 / size)


def changes(image: npt.NDArray[Any]) -> tuple[Ints, Ints]:
    """Return where the columns, and the rows, of an image differ from those before, its borders included."""
    height, width = image.shape[:2]
    across, down = _differing(image.swapaxes(0, 1)), _differing(image)
    return np.concatenate([[0], across, [width]]), np.concatenate([[0], down, [height]])


def _differing(lines: npt.NDArray[Any]) -> Ints:
    """Return the rows that differ from those before; most that do are told by their first pixels."""
    left = np.arange(1, len(lines))
    found = [left[:0]]
    for begin in range(0, lines.shape[1], AT_ONCE):
        if not len(left):
            break
        part = slice(begin, begin + AT_ONCE)
        differs = (lines[left, part] != lines[left - 1, part]).any(axis=(1, 2))
        found.append(left[differs])
        left = left[~differs]
    return np.sort(np.concatenate(found))


def cell_size(image: npt.NDArray[Any]) -> int:
    """Return the side of the largest cells of one colour each that make up an image [px]."""
    middle = image.shape[0] // 2
    if np.gcd.reduce(changes(image[middle : middle + 1])[0]) == 1:  # mostly, and soon known
        return 1
    return int(np.gcd.reduce(np.concatenate(changes(image))))


def outlines(inside: Bools) -> list[Ints]:
    """Return the corners (corner, 2), x and y, of closed polygons around the cells ``inside``, (row, column).

    The inside lies on the right of each edge, so that holes run the other way round. Cells that touch at a
    corner only are outlined separately.
    """
    _, parts = linked_components(inside[:, 1:], inside[1:], inside)
    labels = LabelMap.of(parts)
    loops = find_loops(labels, labels, np.ones(int(parts.max()) + 1, np.bool_))
    loop = np.repeat(np.arange(len(loops)), np.diff(loops.first))
    before = np.arange(len(loop)) - 1
    before[loops.first[:-1]] = loops.first[1:] - 1
    turns = loops.directions != loops.directions[before]
    return np.split(loops.vertices[turns], np.cumsum(np.bincount(loop[turns]))[:-1])


def _lines(corners: Ints, cells: Cells) -> Floats:
    """Return a polygon as a ring of cubics, with handles at the thirds of its lines."""
    columns, rows = corners.T
    start = np.stack([cells.across[columns], cells.down[rows]], axis=1)
    way = np.roll(start, -1, axis=0) - start
    return np.stack([start, start + way / 3, start + way * 2 / 3], axis=1).reshape(-1, 2)


def trace_pixels(
    image: FloatArray, background: FloatArray | None = None, removal: str | None = None
) -> tuple[Scene, float]:
    """Return a scene that shows exactly the image, with one shape for a colour.

    Args:
        image: As ``find_cells`` takes it.
        background: Colour of an opaque image's canvas; None for the colour with the longest outline.
        removal: As for ``trace.trace``.

    Returns:
        The scene, and the units of the view box for each pixel that its points lie on.

    Raises:
        ImageError: As ``find_cells``.
    """
    cells = find_cells(image)
    is_opaque = image.shape[2] == 3
    if removal and is_opaque:
        cells, ground = without_ground(cells, removal)
        background = (ground / 255).astype(np.float32)
    palette = (cells.palette / 255).astype(np.float32)
    shapes = [outlines(cells.colors == i) for i in range(len(palette))]
    height, width = image.shape[:2]
    if removal and is_opaque:
        seen = np.isin(np.arange(len(palette)), cells.colors)
    elif not is_opaque:
        seen = cells.palette[:, 3] > 0
    else:
        if background is None:
            background = palette[np.argmax([sum(map(len, rings)) for rings in shapes])]
        seen = (cells.palette != np.round(255 * background)).any(axis=1)
    palette, shapes = palette[seen], list(itertools.compress(shapes, seen))
    contours = [_lines(ring, cells) for rings in shapes for ring in rings]
    count = len(shapes)
    scene = Scene(
        # Adjacent shapes that are antialiased show what is behind them, at zooms where cells end in pixels.
        Canvas(width, height, background if is_opaque else None, crisp=count > 1),
        np.full(count, Kind.FILL, np.int32),
        starts_of(np.array([3 * sum(map(len, rings)) for rings in shapes], np.int32)),
        np.full(count, Basis.CUBIC, np.int32),
        starts=starts_of(np.array([len(points) for points in contours], np.int32)),
        closed=np.ones(len(contours), np.int32),
        points=np.concatenate([*contours, np.empty((0, 2))]).astype(np.float32),
        colors=palette[:, :3],
        opacities=np.ones(count, np.float32) if is_opaque else palette[:, 3],
        rule=np.full(count, Rule.EVENODD, np.int32),
    )
    return scene, cells.per_pixel


def without_ground(cells: Cells, removal: str) -> tuple[Cells, npt.NDArray[Any]]:
    """Return cells of which those of the ground are of no colour, -1, and the ground's colour.

    ``removal``: as for ``trace.trace``.
    """
    colors = cells.colors
    ground = int(np.bincount(border(colors)).argmax())
    inside = colors == ground
    if removal == "outside":
        framed = np.pad(inside, 1, constant_values=True)  # the frame joins what reaches the border
        _, parts = linked_components(framed[:, 1:], framed[1:], framed)
        inside = inside & (parts == parts[0, 0])[1:-1, 1:-1]
    return replace(cells, colors=np.where(inside, -1, colors)), cells.palette[ground]
