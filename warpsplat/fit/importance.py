"""How much the error of each pixel counts."""

from __future__ import annotations

import cv2
import numpy as np

from warpsplat.scene import FloatArray

LEAST = 0.05
"""Weight of a black pixel of a mask over that of a white one. Not 0: shapes that nothing holds would grow
over what is black, and the picture around a face is still to be a picture."""


def pixel_weights(mask: FloatArray, width: int, height: int) -> FloatArray:
    """Weights of the pixels of a ``width`` x ``height`` image, of mean 1.

    ``mask``: grey in [0, 1], of any size; a weight grows linearly with the grey from ``LEAST`` of white's.
    Since their mean is 1, learning rates and the other losses mean what they do without a mask.
    """
    shrinks = mask.shape[1] >= width and mask.shape[0] >= height
    how = cv2.INTER_AREA if shrinks else cv2.INTER_LINEAR
    grey = np.clip(cv2.resize(mask, (width, height), interpolation=how), 0, 1)
    weights = LEAST + (1 - LEAST) * grey
    return np.asarray(weights / weights.mean(dtype=np.float64), np.float32)
