"""A run that was recorded, and a drawing."""

from __future__ import annotations

import numpy as np
import pytest

import warpsplat
from warpsplat import Recorder, Result


@pytest.fixture(scope="session")
def recorded() -> tuple[Recorder, Result]:
    """Of a photograph of 48 x 36 px, seven reports."""
    y, x = np.mgrid[:36, :48] / 48
    pixels = np.stack([x, y, 0.5 + 0.3 * np.sin(9 * x * y)], axis=2)
    recorder = Recorder()
    result = warpsplat.vectorize(pixels, 6, subject="photo", iterations=70, device="cpu", callback=recorder)
    return recorder, result
