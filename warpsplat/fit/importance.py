"""How much the error of each pixel counts."""

from __future__ import annotations

import numpy as np

from warpsplat.alpha import on
from warpsplat.portable import elementary, filters
from warpsplat.scene import FloatArray

LEAST = 0.05
"""Weight of a black pixel of a mask over that of a white one. Not 0: shapes that nothing holds would grow
over what is black, and the picture around a face is still to be a picture."""

EMPTY = 8.0
"""Weight of a pixel where nothing is, over others: what spills over an edge is seen on other backgrounds."""

TEXTURE_SIGMA = 8.0
"""Standard deviation of the window in which texture is measured [px]."""

AT_ONCE = 1 << 16
"""Pixels whose weights are found in one go: bounds the memory."""

TEXTURE_NOISE = 4 / 255
"""Standard deviation of what counts as plain."""


def pixel_weights(image: FloatArray, mask: FloatArray | None, texture: float) -> FloatArray | None:
    """Weights of the pixels of ``image``, shape (height, width); None where all are alike.

    Args:
        image: sRGB in [0, 1], shape (height, width, 3); or premultiplied with opacity, (height, width, 4).
        mask: grey in [0, 1], of any size: a weight grows linearly with it from ``LEAST`` of white's.
        texture: power of the local variance by which a weight falls. An eye sees an error in what is plain
            sooner than in foliage (masking), and the shapes that foliage takes are worth more elsewhere.
    """
    height, width = image.shape[:2]
    weights: FloatArray | None = None
    if texture > 0:
        grey = filters.grey(np.asarray(on(image, 1.0), np.float32))
        grey = grey - np.float32(0.5)  # about which 32 bits are enough
        mean, squares = (filters.gaussian_blur(x, TEXTURE_SIGMA) for x in (grey, grey * grey))
        variance = np.maximum(squares - mean * mean, 0) + np.float32(TEXTURE_NOISE * TEXTURE_NOISE)
        weights = variance
        for rows in np.array_split(weights, weights.size // AT_ONCE + 1):
            rows[:] = elementary.power(rows, -texture)
    if mask is not None:
        shrinks = mask.shape[1] >= width and mask.shape[0] >= height
        resize = filters.resize_area if shrinks else filters.resize_linear
        shares = LEAST + (1 - LEAST) * np.clip(resize(mask, (width, height)), 0, 1)
        # So that a mask of one grey is exactly none.
        counts = np.asarray(shares / shares.mean(dtype=np.float64), np.float32)
        weights = counts if weights is None else weights * counts
    if image.shape[2] == 4:
        counts = np.where(image[..., 3] == 0, np.float32(EMPTY), np.float32(1))
        weights = counts if weights is None else weights * counts
    return weights


def weights_at(weights: FloatArray, width: int, height: int) -> FloatArray:
    """``weights`` at another size, of mean 1: learning rates and other losses mean what they do without."""
    resized = weights
    if weights.shape != (height, width):
        resized = filters.resize_area(weights, (width, height))
    return np.asarray(resized / resized.mean(dtype=np.float64), np.float32)
