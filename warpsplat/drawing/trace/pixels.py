"""Pixel art and QR codes: the exact outlines of the cells of each colour."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from warpsplat.alpha import straight
from warpsplat.drawing.trace.grids import Bools, Floats, Ints, linked_components
from warpsplat.drawing.trace.lattice import MOST_COLORS, SNAP, Lattice, find_lattice
from warpsplat.drawing.trace.planar import find_loops
from warpsplat.errors import ImageError
from warpsplat.scene import Basis, Canvas, FloatArray, Kind, Rule, Scene
from warpsplat.scene.scene import starts_of

MOST_CELLS = 262_144  # of pixel art: nobody would edit the outlines of more

STRIP_ROWS = 64  # compared at once, which bounds the memory
MOST_CORNERS = 32_000  # of a shape
FINE = 0.25  # [px] that the borders of cells are rounded to


@dataclass(frozen=True)
class PixelArt:
    """An image as cells of one colour each."""

    colors: Ints
    """Number of each cell's colour, shape (row, column)."""
    palette: Floats
    """sRGB in [0, 1] of each colour, and its opacity if there is one; shape (color, 3 or 4)."""
    across: Floats | Ints
    """Borders of the columns [px], shape (column + 1,)."""
    down: Floats | Ints
    """Borders of the rows [px], shape (row + 1,)."""
    per_pixel: float
    """Units per pixel in which all borders are whole numbers."""


def find_cells(image: FloatArray) -> PixelArt:
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
            return _of_lattice(lattice, levels.shape[1], levels.shape[0])
    if cells.shape[0] * cells.shape[1] > MOST_CELLS:
        shape = f"{cells.shape[1]}x{cells.shape[0]}"
        raise ImageError(f"{shape} cells, more than pixel art may have ({MOST_CELLS})")
    return PixelArt(colors.reshape(cells.shape[:2]), _shares(palette), across, down, 1 / size)


def _of_lattice(lattice: Lattice, width: int, height: int) -> PixelArt:
    """Return the cells of a lattice: in units of a cell if the image begins with one, else of ``FINE`` px."""
    columns, rows = lattice.columns, lattice.rows
    longer = abs(height / columns.period - height / rows.period)  # what the sides of cells add up to [cells]
    is_aligned = columns.origin == rows.origin == 0 and longer < SNAP
    per_pixel = 1 / columns.period if is_aligned else 1 / FINE
    across, down = columns.borders(width), rows.borders(height)
    if is_aligned:
        down = np.round(down * per_pixel) / per_pixel
    return PixelArt(lattice.colors, _shares(lattice.palette), across, down, per_pixel)


def _shares(levels: Ints) -> FloatArray:
    """Return 8-bit levels as numbers in [0, 1]."""
    return np.asarray(levels / 255, np.float32)


def changes(
    image: npt.NDArray[Any], converted: Callable[..., npt.NDArray[Any]] = np.asarray
) -> tuple[Ints, Ints]:
    """Return where the columns, and the rows, of an image differ from those before, its borders included.

    Args:
        image: Shape (height, width, channel).
        converted: Applied to strips of it before they are compared.
    """
    height, width = image.shape[:2]
    across, down = np.ones(width + 1, np.bool_), np.ones(height + 1, np.bool_)
    across[1:-1] = False
    for top in range(0, height, STRIP_ROWS):
        strip = converted(image[top : top + STRIP_ROWS + 1])
        across[1:-1] |= (strip[:, 1:] != strip[:, :-1]).any(axis=(0, 2))
        down[top + 1 : top + len(strip)] = (strip[1:] != strip[:-1]).any(axis=(1, 2))
    return np.flatnonzero(across), np.flatnonzero(down)


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
    loops = find_loops(parts, inside[..., None].astype(np.float32), np.ones(int(parts.max()) + 1, np.bool_))
    loop = np.repeat(np.arange(len(loops)), np.diff(loops.first))
    before = np.arange(len(loop)) - 1
    before[loops.first[:-1]] = loops.first[1:] - 1
    turns = loops.directions != loops.directions[before]
    return np.split(loops.vertices[turns], np.cumsum(np.bincount(loop[turns]))[:-1])


def polygons(inside: Bools) -> list[list[Ints]]:
    """Return the outlines of cells as sets of polygons with no more than ``MOST_CORNERS`` each.

    One set if that is enough; otherwise the cells are halved across their longer side, until it is.
    """
    if not inside.any():
        return []
    whole = outlines(inside)
    height, width = inside.shape
    if sum(map(len, whole)) <= MOST_CORNERS:
        return [whole]
    if height >= width:
        halves = [(inside[: height // 2], 0, 0), (inside[height // 2 :], 0, height // 2)]
    else:
        halves = [(inside[:, : width // 2], 0, 0), (inside[:, width // 2 :], width // 2, 0)]
    return [[ring + (left, top) for ring in rings] for half, left, top in halves for rings in polygons(half)]


def _lines(corners: Ints, cells: PixelArt) -> Floats:
    """Return a polygon as a ring of cubics, with handles at the thirds of its lines."""
    columns, rows = corners.T
    start = np.stack([cells.across[columns], cells.down[rows]], axis=1)
    way = np.roll(start, -1, axis=0) - start
    return np.stack([start, start + way / 3, start + way * 2 / 3], axis=1).reshape(-1, 2)


def trace_pixels(image: FloatArray, background: FloatArray | None = None) -> tuple[Scene, float]:
    """Return a scene that shows exactly the image, with one shape for a colour, or several for many corners.

    Args:
        image: As ``find_cells`` takes it.
        background: Colour of an opaque image's canvas; None for the colour with the longest outline.

    Returns:
        The scene, and the units of the view box for each pixel that its points lie on.

    Raises:
        ImageError: As ``find_cells``.
    """
    cells = find_cells(image)
    sets = [polygons(cells.colors == i) for i in range(len(cells.palette))]
    height, width = image.shape[:2]
    is_opaque = image.shape[2] == 3
    if not is_opaque:
        seen = cells.palette[:, 3] > 0
    elif background is None:
        paper = int(np.argmax([sum(len(ring) for rings in own for ring in rings) for own in sets]))
        background = np.asarray(cells.palette[paper], np.float32)
        seen = np.arange(len(sets)) != paper
    else:
        seen = (np.round(255 * cells.palette) != np.round(255 * background)).any(axis=1)
    shown = [(i, rings) for i in np.flatnonzero(seen).tolist() for rings in sets[i]]
    contours = [[_lines(ring, cells) for ring in rings] for _, rings in shown]
    palette = np.asarray(cells.palette[[i for i, _ in shown]], np.float32)
    flat = list(itertools.chain.from_iterable(contours))
    count = len(contours)
    ground = np.asarray(background, np.float32) if is_opaque else None
    scene = Scene(
        # Adjacent shapes that are antialiased show what is behind them, at zooms where cells end in pixels.
        Canvas(width, height, ground, crisp=count > 1),
        np.full(count, Kind.FILL, np.int32),
        starts_of(np.array([sum(map(len, ring)) for ring in contours], np.int32)),
        np.full(count, Basis.CUBIC, np.int32),
        starts=starts_of(np.array([len(points) for points in flat], np.int32)),
        closed=np.ones(len(flat), np.int32),
        points=np.concatenate([*flat, np.empty((0, 2))]).astype(np.float32),
        colors=palette[:, :3],
        opacities=np.ones(count, np.float32) if is_opaque else palette[:, 3],
        rule=np.full(count, Rule.EVENODD, np.int32),
    )
    return scene, cells.per_pixel
