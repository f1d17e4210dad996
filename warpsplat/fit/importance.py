"""Weights of the pixels' errors."""

from __future__ import annotations

import functools

import numpy as np

from warpsplat.alpha import on
from warpsplat.portable import elementary, filters
from warpsplat.scene import FloatArray

BLACK_WEIGHT = 0.05
"""Weight of a black pixel of a mask over that of a white one. Not 0: shapes would grow unchecked over black
parts, and the surroundings of a face should still be recognisable."""

TEXTURE_SIGMA, TEXTURE_NOISE = 8.0, 4 / 255
"""Standard deviations: of the window in which texture is measured [px], and of colours in plain areas."""

PIXELS_PER_CHUNK = 1 << 16
"""Pixels whose weights are computed at once, to bound the memory."""


def pixel_weights(image: FloatArray, mask: FloatArray | None, texture: float) -> FloatArray | None:
    """Return weights of the pixels of ``image``, shape (height, width); None if all are equal.

    Args:
        image: sRGB in [0, 1], shape (height, width, 3); or premultiplied with opacity, (height, width, 4).
        mask: grey in [0, 1], of any size; weights grow linearly with it from ``BLACK_WEIGHT`` of white's.
        texture: power of the local variance by which weights fall. Errors are seen sooner in plain areas than
            in foliage (masking), and the shapes that foliage takes are worth more elsewhere.
    """
    height, width = image.shape[:2]
    factors: list[FloatArray] = []
    if texture > 0:
        grey = filters.grey(np.asarray(on(image, 1.0), np.float32))
        grey = grey - np.float32(0.5)  # so that 32 bits are enough for the squares
        mean, squares = (filters.gaussian_blur(x, TEXTURE_SIGMA) for x in (grey, grey * grey))
        weights = np.maximum(squares - mean * mean, 0) + np.float32(TEXTURE_NOISE * TEXTURE_NOISE)
        for rows in np.array_split(weights, weights.size // PIXELS_PER_CHUNK + 1):
            rows[:] = elementary.power(rows, -texture)
        factors.append(weights)
    if mask is not None:
        shrinks = mask.shape[1] >= width and mask.shape[0] >= height
        resize = filters.resize_area if shrinks else filters.resize_linear
        shares = BLACK_WEIGHT + (1 - BLACK_WEIGHT) * np.clip(resize(mask, (width, height)), 0, 1)
        # Divided by the mean, so that a mask of one grey is exactly none.
        factors.append(np.asarray(shares / shares.mean(dtype=np.float64), np.float32))
    # Weight of an empty pixel over others: what spills over an edge is visible on other backgrounds.
    empty_weight = 8.0
    if image.shape[2] == 4:
        factors.append(np.where(image[..., 3] == 0, np.float32(empty_weight), np.float32(1)))
    return functools.reduce(np.multiply, factors) if factors else None


def weights_at(weights: FloatArray, width: int, height: int) -> FloatArray:
    """Return ``weights`` at another size, with mean 1, as learning rates and other losses assume."""
    same = weights.shape == (height, width)
    resized = weights if same else filters.resize_area(weights, (width, height))
    return np.asarray(resized / resized.mean(dtype=np.float64), np.float32)
