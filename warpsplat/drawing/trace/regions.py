"""Image -> label map and palette: flat regions and smooth ramps, with antialiasing and JPEG noise removed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from warpsplat.drawing.trace.assign import fill_gaps, without_specks
from warpsplat.drawing.trace.bands import split_uneven
from warpsplat.drawing.trace.grids import Floats, Ints, components, unchecked
from warpsplat.drawing.trace.palette import Coloring, paint_parts
from warpsplat.drawing.trace.ramps import Gradients
from warpsplat.drawing.trace.seeds import find_seeds, noise_of
from warpsplat.drawing.trace.thin_parts import add_thin_parts
from warpsplat.portable import filters
from warpsplat.scene.attributes import GRADIENTS

NEGLIGIBLE_NOISE = 0.5  # [levels] noise below which an image counts as clean
MOST_NOISE = 12.0  # [levels] that tolerances take into account
MOST_SEED_NOISE = 3.0  # [levels] that seeds take into account: they must stay apart
SMOOTHED_STEP, SMOOTHED_NOISE = 12.0, 6.0  # [levels] steps that are smoothed, and per level of noise


@dataclass(frozen=True)
class Regions:
    """An image as connected regions."""

    image: Floats
    """The segmented image, smoothed if it was noisy: premultiplied, 0..255, shape (height, width, 4)."""
    labels: Ints
    """The region of each pixel, shape (height, width)."""
    fills: Floats
    """The colour of each pixel if its region covered it, shape (height, width, 4)."""
    paint: Ints
    """The colouring of each region, shape (region,)."""
    colorings: list[Coloring]
    noise: float
    """How much flat regions vary [levels]."""
    scale: int = 1
    """Pixels along one of the image."""


def find_regions(
    image: Floats,
    price: float = 1.0,
    check: Callable[[], None] = unchecked,
    gradients: Gradients = GRADIENTS,
    noise: float | None = None,
) -> Regions:
    """Cut an image up into regions.

    Args:
        image: Premultiplied sRGB with opacity, 0..255, shape (height, width, 4).
        price: As for ``trace``; below 1, specks that are hardly seen stay.
        check: As for ``trace``.
        gradients: As for ``trace``.
        noise: As for ``trace``.
    """
    image = np.asarray(image, np.float32)
    if noise is None:
        noise = noise_of(image)
        noise = 0.0 if noise < NEGLIGIBLE_NOISE else noise
        image = smoothed(image, noise) if noise else image
    noise = min(noise, MOST_NOISE)
    check()
    seeds = find_seeds(image, min(noise, MOST_SEED_NOISE))
    check()
    painted_parts = paint_parts(image, seeds, noise, gradients)
    parts = split_uneven(image, painted_parts, noise, check, gradients)
    check()
    parts = add_thin_parts(image, parts, noise)
    check()
    # From here on, pixels have the number of a colouring instead of a part.
    painted, fills = without_specks(image, *fill_gaps(image, parts), noise, price)
    labels, paint = components(painted)
    return Regions(image, labels, fills, paint, parts.colorings, noise)


def smoothed(image: Floats, noise: float) -> Floats:
    """Return the image without the traces of JPEG beside edges.

    ``image``: levels, shape (height, width, 3 or 4); ``noise``: of flat regions [levels].
    """
    smooth = image.copy()
    for channels in (slice(0, 3), slice(3, 4)):
        part = image[..., channels]
        if part.size and np.ptp(part) > 0:
            for _ in range(3):
                part = filters.bilateral(part, 7, SMOOTHED_STEP + SMOOTHED_NOISE * noise, 2.5)
            smooth[..., channels] = part
    return smooth
