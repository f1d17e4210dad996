"""What a file can hold: finite numbers."""

from __future__ import annotations

import numpy as np

from warpsplat.errors import UsageError
from warpsplat.scene import ATTRIBUTES, Scene


def check_finite(scene: Scene) -> None:
    """Whether all numbers of ``scene`` are finite.

    Raises:
        UsageError: one is not; the message names the shape and what of it.
    """
    background = scene.canvas.background
    if background is not None and not np.isfinite(background).all():
        raise UsageError("the background has a number that is not finite")
    for attribute in ATTRIBUTES:
        values = getattr(scene, attribute.name)
        if not np.isfinite(values).all():
            owners = {
                "point": np.repeat(np.arange(len(scene)), scene.point_counts()),
                "shape": np.arange(len(scene)),
                "stop": np.repeat(np.arange(len(scene)), np.diff(scene.stop_first)),
            }[attribute.per]
            rows = np.isfinite(values).reshape(len(owners), -1).all(axis=1)
            shape = int(owners[np.flatnonzero(~rows)[0]])
            raise UsageError(f"shape {shape}: {attribute.name} with a number that is not finite")
