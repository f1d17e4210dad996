"""What tests fit shapes to."""

from __future__ import annotations

import numpy as np

from warpsplat.scene import FloatArray


def picture(width: int = 64, height: int = 48) -> FloatArray:
    """A bright disc on a gradient."""
    y, x = np.mgrid[:height, :width].astype(np.float32)
    image = np.stack([x / width, y / height, 0.3 + 0 * x], axis=2)
    image[np.hypot(x - 40, y - 20) < 12] = [0.9, 0.8, 0.1]
    return image
