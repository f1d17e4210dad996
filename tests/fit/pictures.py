"""What tests fit shapes to."""

from __future__ import annotations

import numpy as np

from warpsplat.fit.place import canvas_for
from warpsplat.fit.settings import Settings, make_settings
from warpsplat.scene import FloatArray, Kind, Scene


def picture(width: int = 64, height: int = 48) -> FloatArray:
    """A bright disc on a gradient."""
    y, x = np.mgrid[:height, :width].astype(np.float32)
    image = np.stack([x / width, y / height, 0.3 + 0 * x], axis=2)
    image[np.hypot(x - 40, y - 20) < 12] = [0.9, 0.8, 0.1]
    return image


def empty_scene(settings: Settings, target: FloatArray) -> Scene:
    """No shapes yet."""
    points = np.zeros((0, 6 * settings.chain_cubics, 2), np.float32)
    return Scene.uniform(Kind.FILL, canvas_for(make_settings(), target), points)
