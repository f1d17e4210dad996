"""An image as it is drawn: without enlargement, noise and surplus margin; and the way back to its size."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from warpsplat.drawing.chroma import has_blurred_colors, with_sharp_colors
from warpsplat.drawing.denoise import without_noise
from warpsplat.drawing.illumination import evened
from warpsplat.drawing.reduced import before_enlarging
from warpsplat.drawing.thin import THIN_SIDE, margins
from warpsplat.drawing.trace.pixels import cell_size
from warpsplat.drawing.trace.seeds import noise_of
from warpsplat.fit.optics import Illumination, Optics
from warpsplat.scene import FloatArray, Scene
from warpsplat.scene.geometry import enlarged

LEAST_ORIGINAL_SIDE = 96
"""Least side of an image before it was enlarged [px]: smaller ones hardly define outlines."""

MARGIN = 8
"""Plain ground around what is drawn [px]: as far as the tracer looks."""


@dataclass(frozen=True, eq=False)
class Picture:
    """An image as it was before it was enlarged, with a margin of fixed width where its ground is plain.

    So its margin has no part in how it is drawn.
    """

    pixels: FloatArray
    """sRGB in [0, 1], shape (height, width, 3); premultiplied with opacity, shape (height, width, 4)."""
    noise: float | None
    """Noise of mixtures of colours [levels of 255]; None: not known, flat colours may have it too."""
    enlargement: npt.NDArray[np.float64]
    """How many times as large the image was made, along x and y."""
    corner: npt.NDArray[np.intp]
    """Where the upper left corner lies in the image before it was enlarged, x and y [px]."""
    original_size: npt.NDArray[np.intp]
    """Width and height of the image before it was enlarged [px]."""
    drawn_size: npt.NDArray[np.intp]
    """Width and height of what is drawn [px]."""
    is_thin: bool
    """Whether the image has few rows or columns, which are repeated beyond its borders."""

    seen: FloatArray | None = None
    """The pixels before they were made sharp, if they were."""
    optics: Optics | None = None
    """How they were made, if they were blurred, sharpened or mixed in linear light."""
    is_halved: bool = False
    """Whether its colours had half the resolution of its lightness, and were made sharp; flat colours have
    noise then."""
    is_interpolated: bool = False
    """Whether the image was enlarged by interpolation, which is undone."""

    illumination: Illumination | None = None
    """The light on its paper, which was uneven and is even now."""

    @classmethod
    def of(
        cls, image: FloatArray, *, is_soft: bool = False, illumination: Illumination | None = None
    ) -> Picture:
        """Return the picture of an image.

        Args:
            image: sRGB in [0, 1], or premultiplied with opacity.
            is_soft: Leave what interpolation made of it.
            illumination: To be undone, unless it has opacity.
        """
        factor = _enlargement(image)
        before = None if is_soft or factor > 1 else before_enlarging(np.round(image * np.float32(255)))
        is_interpolated = before is not None
        repeated = np.ascontiguousarray(image[::factor, ::factor])
        small = repeated if before is None else before / np.float32(255)
        enlargement = np.array(image.shape[1::-1]) / small.shape[1::-1]
        if small.shape[2] == 4:
            illumination = None
        if illumination:
            small = evened(small, illumination)
        is_halved = has_blurred_colors(small)
        pixels, noise = without_noise(small)
        if is_halved:
            pixels, noise = with_sharp_colors(small), noise_of(small * np.float32(255))
        size, thin = np.array(pixels.shape[1::-1]), np.array(margins(pixels, THIN_SIDE))
        box = _drawn_box(pixels)
        first, last = (-thin, size + thin) if box is None else (box[0] - MARGIN, box[1] + MARGIN)
        if is_halved:  # from whole squares of pixels on
            first = first - first % 2
        low, high = np.maximum(first, 0), np.minimum(last, size)
        widths = [((low - first)[axis], (last - high)[axis]) for axis in (1, 0)]

        def framed(image: FloatArray) -> FloatArray:
            wide = np.pad(image[low[1] : high[1], low[0] : high[0]], [*widths, (0, 0)], mode="edge")
            return np.ascontiguousarray(wide)

        drawn = size if box is None else box[1] - box[0]
        return cls(
            framed(pixels),
            noise,
            enlargement,
            first,
            size,
            drawn,
            bool(thin.any()),
            seen=framed(small) if is_halved else None,
            is_halved=is_halved,
            is_interpolated=is_interpolated,
            illumination=illumination,
        )

    @property
    def share(self) -> float:
        """Pixels of the picture over those of the image before it was enlarged."""
        return self.pixels[..., 0].size / int(self.original_size.prod())

    @property
    def drawn_share(self) -> float:
        """Share of the picture that what is drawn takes."""
        return int(self.drawn_size.prod()) / self.pixels[..., 0].size

    def placed(self, scene: Scene) -> Scene:
        """Return a scene of the picture at the size of the whole image."""
        inner, frames = np.array(self.pixels.shape[1::-1]), scene.frames.copy()
        frames[:, :2] += self.corner
        points = scene.points + self.corner.astype(np.float32)
        if (inner != self.original_size).any() and len(points):
            low, high = (ends.reduceat(scene.points, scene.starts[:-1]) for ends in (np.minimum, np.maximum))
            counts = np.diff(scene.starts)
            is_ground = np.repeat(((low <= 0) & (high >= inner)).all(axis=1), counts)[:, None]
            # What covers the picture goes on beyond it.
            points = np.where(is_ground & (scene.points <= 0), 0, points)
            points = np.where(is_ground & (scene.points >= inner), self.original_size, points)
        width, height = np.round(self.enlargement * self.original_size).astype(int).tolist()
        across, down = self.enlargement.tolist()
        large = enlarged(
            replace(scene, points=points.astype(np.float32), frames=frames), across, width, height
        )
        if down == across:
            return large
        sides = np.array([1, down / across])
        return replace(
            large,
            points=(large.points * sides).astype(np.float32),
            frames=(large.frames * np.tile(sides, 3)).astype(np.float32),
        )


def _enlargement(image: FloatArray) -> int:
    """Return how many times an image was enlarged by repeating its pixels.

    Its antialiasing is that of the smaller image, and the steps of its pixels are not part of what it shows.
    """
    size, side = cell_size(image), min(image.shape[:2])
    fits = (n for n in range(1, size + 1) if size % n == 0 and side >= n * LEAST_ORIGINAL_SIDE)
    return max(fits, default=1)


def _drawn_box(pixels: FloatArray) -> tuple[npt.NDArray[np.intp], npt.NDArray[np.intp]] | None:
    """Return where what is drawn on a ground of one colour begins and ends, x and y; None: it has none.

    The border has exactly this colour: with a tolerance, pale lines that reach it would be lost.
    """
    drawn = (pixels != pixels[0, 0]).any(axis=2)
    rows, columns = np.flatnonzero(drawn.any(axis=1)), np.flatnonzero(drawn.any(axis=0))
    border = drawn[0].any() or drawn[-1].any() or drawn[:, 0].any() or drawn[:, -1].any()
    if border or not len(rows):
        return None
    return np.array([columns[0], rows[0]]), np.array([columns[-1] + 1, rows[-1] + 1])
