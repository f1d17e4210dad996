"""Pixel art and QR codes: the exact outlines of the cells of each colour."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from warpsplat.alpha import straight
from warpsplat.drawing.trace.grids import Bools, Floats, Ints
from warpsplat.errors import ImageError
from warpsplat.scene import Basis, Canvas, FloatArray, Kind, Rule, Scene
from warpsplat.scene.scene import starts_of

MOST_CELLS = 1 << 18
"""Of pixel art: a picture with more has outlines that nobody would edit."""

MOST_CORNERS = 32_000
"""Of a shape."""

SAME = 0.5 / 255
"""Colours that differ by less are one in 8 bits."""

Point = tuple[int, int]


@dataclass(frozen=True)
class Cells:
    """A picture as cells of one colour each."""

    colors: Ints
    """Number of each cell's colour, shape (row, column)."""
    palette: Floats
    """sRGB in [0, 1] of each colour, and its opacity if there is one; shape (color, 3 or 4)."""
    size: int
    """Side of a cell [px]."""


def find_cells(image: FloatArray) -> Cells:
    """The largest cells that each have one colour.

    Args:
        image: sRGB in [0, 1], shape (height, width, 3); premultiplied with opacity, shape (height, width, 4).

    Raises:
        ImageError: there are more than ``MOST_CELLS``.
    """
    channels = image.shape[2]
    shown = np.concatenate([straight(image), image[..., 3:]], axis=2)
    levels = np.round(shown * 255).astype(np.uint8)  # as a file can say them
    size = cell_size(levels)
    cells = levels[::size, ::size]
    if cells.shape[0] * cells.shape[1] > MOST_CELLS:
        shape = f"{cells.shape[1]}x{cells.shape[0]}"
        raise ImageError(f"{shape} cells of {size} px, more than pixel art may have ({MOST_CELLS})")
    palette, colors = np.unique(cells.reshape(-1, channels), axis=0, return_inverse=True)
    return Cells(colors.reshape(cells.shape[:2]), np.asarray(palette / 255, np.float32), size)


def cell_size(levels: npt.NDArray[Any]) -> int:
    """Side of the largest cells of one colour each of an image, shape (height, width, channel) [px]."""
    height, width = levels.shape[:2]
    columns = np.flatnonzero((np.diff(levels, axis=1) != 0).any(axis=(0, 2))) + 1
    rows = np.flatnonzero((np.diff(levels, axis=0) != 0).any(axis=(1, 2))) + 1
    return int(np.gcd.reduce(np.concatenate([columns, rows, [width, height]])))


def outlines(inside: Bools) -> list[list[Point]]:
    """Corners of the cells ``inside``, shape (row, column), in cells: closed polygons, x and y.

    The inside lies on the right of each edge as it runs, so that holes run the other way. Cells that touch by
    a corner only are outlined apart.
    """
    padded = np.pad(inside, 1)
    edges: dict[Point, list[Point]] = {}

    def add(mask: Bools, start: Point, end: Point) -> None:
        for y, x in np.argwhere(mask).tolist():
            edges.setdefault((x + start[0], y + start[1]), []).append((x + end[0], y + end[1]))

    core = padded[1:-1, 1:-1]
    add(core & ~padded[:-2, 1:-1], (0, 0), (1, 0))
    add(core & ~padded[1:-1, 2:], (1, 0), (1, 1))
    add(core & ~padded[2:, 1:-1], (1, 1), (0, 1))
    add(core & ~padded[1:-1, :-2], (0, 1), (0, 0))
    found = []
    while edges:
        start = next(iter(edges))
        ring = [start, _leave(edges, start, None)]
        while ring[-1] != start:
            ring.append(_leave(edges, ring[-1], ring[-2]))
        found.append(_corners(ring[:-1]))
    return found


def _leave(edges: dict[Point, list[Point]], at: Point, before: Point | None) -> Point:
    """Take the edge on from ``at``; where two leave it, the one that turns right, along the same cell."""
    ends = edges[at]
    end = ends[0]
    if len(ends) > 1 and before is not None:
        dx, dy = at[0] - before[0], at[1] - before[1]
        end = (at[0] - dy, at[1] + dx)
    ends.remove(end)
    if not ends:
        del edges[at]
    return end


def _corners(ring: list[Point]) -> list[Point]:
    """The points of a ring where it turns."""
    around = zip([ring[-1], *ring[:-1]], ring, [*ring[1:], ring[0]], strict=True)
    return [b for a, b, c in around if (b[0] - a[0], b[1] - a[1]) != (c[0] - b[0], c[1] - b[1])]


def polygons(inside: Bools, most: int = MOST_CORNERS) -> list[list[list[Point]]]:
    """The cells ``inside``, shape (row, column), as sets of polygons with no more than ``most`` corners each.

    One set where that is enough; else the picture is halved, across its longer side, until it is.
    """
    whole = outlines(inside)
    height, width = inside.shape
    if sum(map(len, whole)) <= most or inside.size == 1:
        return [whole]
    if height >= width:
        halves = [(inside[: height // 2], 0, 0), (inside[height // 2 :], 0, height // 2)]
    else:
        halves = [(inside[:, : width // 2], 0, 0), (inside[:, width // 2 :], width // 2, 0)]
    return [
        [[(x + left, y + top) for x, y in ring] for ring in rings]
        for half, left, top in halves
        for rings in polygons(half, most)
        if rings
    ]


def _lines(corners: list[Point], size: int) -> Floats:
    """A polygon as a ring of cubics, handles at the thirds of its lines."""
    start = np.asarray(corners, np.float64) * size
    way = np.roll(start, -1, axis=0) - start
    return np.stack([start, start + way / 3, start + way * 2 / 3], axis=1).reshape(-1, 2)


def trace_pixels(
    image: FloatArray, background: FloatArray | None = None, *, most: int = MOST_CORNERS
) -> tuple[Scene, float]:
    """A scene that shows the very image, one shape a colour; several, where that has very many corners.

    Args:
        image: as in ``find_cells``.
        background: colour of an opaque image's canvas; without, the colour with the longest outline.
        most: corners of a shape.

    Returns:
        the scene, and units of the view box a pixel that its points lie on.

    Raises:
        ImageError: as ``find_cells``.
    """
    cells = find_cells(image)
    sets = [polygons(cells.colors == i, most) for i in range(len(cells.palette))]
    seen = np.ones(len(sets), np.bool_)
    height, width = image.shape[:2]
    if image.shape[2] == 4:
        seen = cells.palette[:, 3] > 0
    elif background is None:
        corners = [sum(len(ring) for rings in own for ring in rings) for own in sets]
        paper = int(np.argmax(corners))
        seen[paper], background = False, np.asarray(cells.palette[paper], np.float32)
    else:
        seen = (np.abs(cells.palette - background) > SAME).any(axis=1)
    owner = [i for i in np.flatnonzero(seen).tolist() for _ in sets[i]]
    contours = [
        [_lines(ring, cells.size) for ring in rings] for i in np.flatnonzero(seen) for rings in sets[i]
    ]
    palette = np.asarray(cells.palette[owner], np.float32)
    opacities = palette[:, 3] if image.shape[2] == 4 else np.ones(len(palette), np.float32)
    flat = list(itertools.chain.from_iterable(contours))
    ground = None if image.shape[2] == 4 else np.asarray(background, np.float32)
    # Antialiased, shapes that abut show what is behind them: at zooms where cells end within pixels.
    scene = Scene.of(
        Canvas(width, height, ground, crisp=len(contours) > 1),
        np.full(len(contours), Kind.FILL, np.int32),
        starts_of(np.array([sum(map(len, ring)) for ring in contours], np.int32)),
        np.full(len(contours), Basis.CUBIC, np.int32),
        starts=starts_of(np.array([len(points) for points in flat], np.int32)),
        closed=np.ones(len(flat), np.int32),
        points=np.concatenate([*flat, np.empty((0, 2))]).astype(np.float32),
        colors=palette[:, :3],
        opacities=opacities,
        rule=np.full(len(contours), Rule.EVENODD, np.int32),
    )
    return scene, 1 / cells.size
