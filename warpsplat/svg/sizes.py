"""About how long a file is, without its text: for prices, which need no exact number."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from warpsplat.scene import Floats, Scene
from warpsplat.scene.scene import starts_of
from warpsplat.svg.data import cubic_rows, straight_cubics, units
from warpsplat.svg.paints import gradients
from warpsplat.svg.primitives import primitives

HEAD, PATH, MOVE = 130, 32, 2
"""Characters of the file's beginning and end, of a path but for its data, and the letters of a contour's
move and end."""

USE, GRADIENT = 34, 185
"""Bytes of a ``use`` element, and of a gradient of two stops with the reference to it."""


def digits(numbers: Floats) -> npt.NDArray[np.intp]:
    """Return the characters of whole numbers, each with a sign or a space before it."""
    largest = 9  # most digits that are counted
    powers = np.cumprod(np.full(largest - 1, 10.0))
    return 2 + np.searchsorted(powers, np.abs(numbers), "right")


def estimated_size(scene: Scene, per_pixel: float) -> int:
    """Return about the bytes of a file of fills of cubics with ``per_pixel`` units to a pixel."""
    exact = scene.points.astype(np.float64) * units(scene, per_pixel)
    rows = cubic_rows(scene)
    rows = rows[np.argsort(rows[:, 0], kind="stable")]
    straight = straight_cubics(scene, exact)[rows[:, 0]]
    grid = np.round(exact)
    corners = grid[rows]
    relative, absolute = (digits(x).reshape(-1, 6) for x in (corners[:, 1:] - corners[:, :1], corners[:, 1:]))
    before = np.roll(corners, 1, axis=0)
    mirrored = (corners[:, 1] == 2 * before[:, 3] - before[:, 2]).all(axis=1) & ~np.roll(straight, 1)
    handles = [np.where(mirrored, own[:, 2:].sum(axis=1), own.sum(axis=1)) for own in (relative, absolute)]
    step = corners[:, 3] - corners[:, 0]
    lines = [np.where(step == 0, 0, own[:, 4:]).sum(axis=1) for own in (relative, absolute)]
    line = np.minimum(*lines)
    size = np.where(straight, line, np.minimum(*handles))
    starts = scene.starts.astype(np.intp)
    ends = starts_of(np.diff(starts) // 3)[:-1]
    # The last line of an outline is not written.
    spared = np.maximum.reduceat(np.append(np.where(straight, line, 0), 0), ends)
    begun = grid[starts[:-1]]
    moves = np.minimum(digits(begun), digits(np.diff(begun, axis=0, prepend=0))).sum(axis=1)
    by_contour = np.add.reduceat(np.append(size, 0), ends) - spared + moves + MOVE
    round_ones = [contour for contour, made in primitives(scene, exact) if made.radii[0] > 0]
    basic = 24  # characters of a circle, or an outline of arcs, over those of a path
    by_contour[round_ones] = basic
    elements, _ = gradients(scene, per_pixel)
    return HEAD + PATH * len(scene) + int(by_contour.sum()) + sum(map(len, elements))
