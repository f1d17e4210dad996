"""Images and shapes for fits of one's own."""

from __future__ import annotations

import numpy as np

from warpsplat.files.sources import ImageSource, image_of
from warpsplat.fit.place import grid_scene
from warpsplat.fit.settings import make_settings
from warpsplat.run.prepare import load_target
from warpsplat.scene import FloatArray, Kind, Scene


def load_image(image: ImageSource) -> FloatArray:
    """Read an image as it is fitted: upright, sRGB in [0, 1], shape (height, width, 3), float32; with opacity
    premultiplied, shape (height, width, 4).

    Args:
        image: as for ``vectorize``.

    Raises:
        ImageError: it cannot be read.
    """
    return image_of(image)


def starting_scene(
    image: ImageSource, curves: int = 128, *, open: bool = False, seed: int = 0, background: str = "auto"
) -> Scene:
    """Return shapes to start a fit of your own from: a loose grid over the canvas, in the image's colours.

    Args:
        image: as for ``vectorize``.
        curves: number of shapes.
        open: strokes of three cubics instead of filled rings of quadratics.
        seed: of random numbers.
        background: as for ``vectorize``.

    Raises:
        UsageError: a value out of range.
        ImageError: the image cannot be read.
    """
    settings = make_settings(
        curves=curves, kind=Kind.STROKE if open else None, seed=seed, background=background
    )
    target = load_target(image, None, background)
    return grid_scene(settings, target, curves, np.random.default_rng(seed))
