"""Pictures of a scene as arrays of tiles on a device."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import warp as wp

from warpsplat.kernels import constants
from warpsplat.portable.filters import resize_area
from warpsplat.rendering.backend import Backend, Viewport
from warpsplat.rendering.tiles import to_tiles
from warpsplat.scene import FloatArray, KeptPicture

TILE = constants.TILE

CLEAR = 1e-4
"""Opacity below which a colour is unknown."""


def picture_arrays(
    pictures: Sequence[KeptPicture], viewport: Viewport, backend: Backend
) -> dict[str, wp.array]:
    """Return the arrays of ``kernels.paint.picture``: the tiles of each picture in which it is visible."""
    boxes, tiles = [], []
    for one in pictures:
        box, shown = _tiles(one, viewport)
        boxes.append(box)
        tiles.append(shown)
    counts = np.array([len(shown) for shown in tiles], np.int32)

    def made(values: Any, dtype: Any) -> wp.array:
        return wp.array(np.ascontiguousarray(values), dtype=dtype, device=backend.device)

    return {
        "picture_first": made(np.cumsum(counts, dtype=np.int32) - counts, wp.int32),
        "picture_tiles": made(np.array(boxes, np.int32), wp.int32),
        "picture_columns": backend.columns_of(np.concatenate(tiles)),
    }


def _tiles(picture: KeptPicture, viewport: Viewport) -> tuple[tuple[int, int, int, int], FloatArray]:
    """Return the rectangle of tiles in which a picture is visible, and its straight colours there."""
    top, left = picture.corner
    height, width = picture.pixels.shape[:2]
    size = round(viewport.width / viewport.scale), round(viewport.height / viewport.scale)
    x0, y0, x1, y1 = _reach(left, top, left + width, top + height, viewport)
    whole = np.zeros((size[1], size[0], 4), np.float32)
    whole[top : top + height, left : left + width] = picture.pixels
    if size != (viewport.width, viewport.height):
        whole = resize_area(whole, (viewport.width, viewport.height))
    seen = whole[TILE * y0 : TILE * y1, TILE * x0 : TILE * x1]
    opacity = seen[..., 3:]
    color = np.where(opacity > CLEAR, seen[..., :3] / np.maximum(opacity, CLEAR), 0)
    return (x0, y0, x1, y1), to_tiles(np.concatenate([color, opacity], axis=2))


def _reach(left: int, top: int, right: int, bottom: int, viewport: Viewport) -> tuple[int, int, int, int]:
    """Return the tiles that a rectangle of the canvas touches; at least one."""
    (x0, x1), (y0, y1) = (
        _range(low * viewport.scale, high * viewport.scale, tiles)
        for low, high, tiles in ((left, right, viewport.tiles_x), (top, bottom, viewport.tiles_y))
    )
    return x0, y0, x1, y1


def _range(low: float, high: float, tiles: int) -> tuple[int, int]:
    """Return the tiles from ``low`` to ``high`` px, with a margin of a pixel for the blur of reduced
    pictures.
    """
    first = min(max(int((low - 1) // TILE), 0), tiles - 1)
    return first, min(max(int(-(-(high + 1) // TILE)), first + 1), tiles)
