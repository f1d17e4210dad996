"""The different glyphs of an image on a sheet of their own, and their outlines in all places."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from warpsplat.alpha import straight
from warpsplat.drawing.constraints import of_contours
from warpsplat.drawing.trace.grids import components
from warpsplat.drawing.trace.palette import Coloring
from warpsplat.drawing.trace.partition import find_partition
from warpsplat.drawing.trace.regions import Regions
from warpsplat.drawing.trace.trace import Traced, trace_partition
from warpsplat.scene import FloatArray, Scene
from warpsplat.scene.scene import ranges

GAP, BORDER = 4, 16
"""Distances on the sheet between glyphs, and from its sides, where outlines may leave it unseen [px]."""

Ints = npt.NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class GlyphSheet:
    """The different glyphs of an image, and where they are in it."""

    image: FloatArray
    """Each glyph once, in black on white; shape (height, width, 3)."""
    corners: Ints
    """Upper left corner of each glyph on the sheet, x and y, shape (glyph, 2)."""
    sizes: Ints
    """Width and height of each glyph, shape (glyph, 2)."""
    inks: FloatArray
    """Colour of each glyph, premultiplied sRGB and opacity, shape (glyph, 4)."""
    grounds: FloatArray
    """The same of what is behind it."""
    copies: Ints
    """Which glyph is where, shape (copy,)."""
    places: Ints
    """Upper left corner of each copy in the image, shape (copy, 2)."""

    def trace(self, removal: str | None = None) -> Traced:
        """Trace the sheet; with ``removal``, as for ``trace.trace``, holes of glyphs are empty."""
        levels = np.asarray(self.image, np.float32) * 255
        levels = np.concatenate([levels, np.full_like(levels[..., :1], 255)], axis=2)
        painted = (levels[..., 0] < 128).astype(np.int32)
        labels, paint = components(painted)
        colors = np.array([[255, 255, 255, 255], [0, 0, 0, 255]], np.float64)
        fills = colors.astype(np.float32)[painted]
        regions = Regions(levels, labels, fills, paint, [Coloring(color) for color in colors], 0.0)
        return trace_partition(find_partition(regions), removal=removal)

    def placed(self, drawn: Scene, rest: Scene) -> Scene:
        """Return the whole image's scene, of the sheet's and that of the rest."""
        if not len(drawn):
            return rest
        owner = self._owners(drawn)
        shape_of = drawn.contour_shapes()
        own_colors = np.concatenate([self.inks, self.grounds], axis=1)[self.copies]
        colors, look = np.unique(own_colors, axis=0, return_inverse=True)
        scene = rest
        for number, color in enumerate(colors):
            some = np.flatnonzero(look == number)
            for shape in range(len(drawn)):
                contours, copies = self._contours(owner, shape_of == shape, some)
                if len(contours):
                    is_ink = drawn.colors[shape].max() < 0.5
                    scene = scene.append(
                        self._shape(drawn, contours, copies, color[:4] if is_ink else color[4:], rest)
                    )
        return scene

    def _contours(self, owner: Ints, mine: npt.NDArray[np.bool_], copies: Ints) -> tuple[Ints, Ints]:
        """Return the contours that make up some copies, one copy after the other, and the copy of each."""
        order = np.flatnonzero(mine)[np.argsort(owner[mine], kind="stable")]
        low, high = (np.searchsorted(owner[order], self.copies[copies], side) for side in ("left", "right"))
        return order[ranges(low, high - low)], np.repeat(copies, high - low)

    def _shape(self, drawn: Scene, contours: Ints, copies: Ints, color: FloatArray, rest: Scene) -> Scene:
        """Return contours of the sheet in the places of copies, as one shape."""
        counts = np.diff(drawn.starts)[contours]
        glyphs = self.copies[copies]
        made = of_contours(drawn, contours)
        moved = made.points + np.repeat(self.places[copies] - self.corners[glyphs], counts, axis=0)
        # What leaves the sheet, where nobody sees it, would be seen in the image. Handles reach farther.
        places, sizes = (
            np.repeat(each, counts, axis=0) for each in (self.places[copies], self.sizes[glyphs])
        )
        beyond = np.where((np.arange(len(moved)) % 3 > 0)[:, None], sizes, GAP)
        return replace(
            made,
            canvas=rest.canvas,
            points=np.clip(moved, places - beyond, places + sizes + beyond).astype(np.float32),
            colors=straight(color[None]),
            opacities=color[3:].astype(np.float32),
        )

    def _owners(self, scene: Scene) -> Ints:
        """Return the glyph whose box is nearest to each contour's middle, shape (contour,)."""
        on, starts = scene.points[::3], scene.starts[:-1] // 3  # handles may lie farther out
        middles = (np.minimum.reduceat(on, starts, axis=0) + np.maximum.reduceat(on, starts, axis=0)) / 2
        half = self.sizes / 2
        away = (np.abs(middle - self.corners - half) - half for middle in middles)
        return np.array([np.max(each, axis=1).argmin() for each in away], np.intp)


def packed(patches: list[npt.NDArray[np.float64]]) -> tuple[FloatArray, Ints]:
    """Return an image of patches of black in rows on white, and their upper left corners."""
    area = sum((patch.shape[0] + GAP) * (patch.shape[1] + GAP) for patch in patches)
    width = max(math.isqrt(area), *(patch.shape[1] for patch in patches))
    corners = np.zeros((len(patches), 2), np.intp)
    x, y, height = 0, 0, 0
    for i in sorted(range(len(patches)), key=lambda i: -patches[i].shape[0]):
        down, across = patches[i].shape
        if x + across > width:
            x, y, height = 0, y + height + GAP, 0
        corners[i] = x + BORDER, y + BORDER
        x, height = x + across + GAP, max(height, down)
    sheet = np.ones((y + height + 2 * BORDER, width + 2 * BORDER), np.float32)
    for patch, (left, top) in zip(patches, corners.tolist(), strict=True):
        sheet[top : top + patch.shape[0], left : left + patch.shape[1]] = 1 - patch
    return np.repeat(sheet[..., None], 3, axis=2), corners
