"""Images with opacity: premultiplied sRGB and opacity, shape (..., 4); opaque ones are (..., 3)."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.floating]

CLEAR = 1 / 1024
"""Opacity below which a colour is undefined."""


def on(image: Floats, paper: float) -> Floats:
    """Return the image on grey ``paper`` in [0, 1], shape (..., 3); an opaque one as it is."""
    if image.shape[-1] == 3:
        return image
    return np.asarray(image[..., :3] + np.float32(paper) * (1 - image[..., 3:]))


def straight(image: Floats) -> Floats:
    """Return the colours without premultiplication, shape (..., 3); black where transparent."""
    if image.shape[-1] == 3:
        return image
    opacity = image[..., 3:]
    known = np.where(opacity > CLEAR, opacity, 1)
    return np.asarray(np.clip(np.where(opacity > CLEAR, image[..., :3] / known, 0), 0, 1), image.dtype)


def squares(difference: npt.NDArray[Any], axis: int = -1) -> npt.NDArray[Any]:
    """Return the squared error of each pixel, summed over the colours along ``axis``.

    With opacity it is the mean of those on black and on white.
    """
    parts = np.moveaxis(difference, axis, 0)
    red, green, blue = parts[:3]
    # The same bits as a sum along the last axis, at a fraction of the time.
    on_black = red**2 + green**2 + blue**2
    if len(parts) == 3:
        return np.asarray(on_black)
    on_white = (red - parts[3]) ** 2 + (green - parts[3]) ** 2 + (blue - parts[3]) ** 2
    return np.asarray((on_black + on_white) / 2)
