"""A recorded run."""

from __future__ import annotations

import numpy as np

import warpsplat
from warpsplat import Recorder, Result


def recording(iterations: int) -> tuple[Recorder, Result]:
    """Vectorize an image of 48 x 36 px; progress is reported every ten steps."""
    y, x = np.mgrid[:36, :48] / 48
    pixels = np.stack([x, y, 0.5 + 0.3 * np.sin(9 * x * y)], axis=2)
    recorder = Recorder()
    result = warpsplat.vectorize(
        pixels, 6, subject="photo", iterations=iterations, device="cpu", callback=recorder
    )
    return recorder, result
