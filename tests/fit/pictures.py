"""Images, scenes and training steps for tests of fits."""

from __future__ import annotations

import numpy as np

from warpsplat.fit.place import canvas_for
from warpsplat.fit.schedule import phases
from warpsplat.fit.settings import Settings, make_settings
from warpsplat.fit.state import FitState
from warpsplat.fit.step import Step, Target
from warpsplat.rendering.backend import Backend
from warpsplat.rendering.renderer import Capacity
from warpsplat.scene import FloatArray, Kind, Scene


def picture(width: int = 64, height: int = 48) -> FloatArray:
    """A bright disc on a gradient."""
    y, x = np.mgrid[:height, :width].astype(np.float32)
    image = np.stack([x / width, y / height, 0.3 + 0 * x], axis=2)
    image[np.hypot(x - 40, y - 20) < 12] = [0.9, 0.8, 0.1]
    return image


def empty_scene(settings: Settings, target: FloatArray) -> Scene:
    """Return a scene without shapes."""
    points = np.zeros((0, 6 * settings.chain_cubics, 2), np.float32)
    return Scene.uniform(Kind.FILL, canvas_for(make_settings(), target), points)


def step_for(
    scene: Scene,
    image: FloatArray,
    device: str = "cpu",
    settings: Settings | None = None,
    *,
    threads: int | None = None,
    base: int = 0,
    weights: FloatArray | None = None,
    capacity: Capacity | None = None,
) -> Step:
    """Return the first step of a fit of ``scene`` at the finest size."""
    settings = settings or make_settings()
    state = FitState.start(scene, Backend.on(device, threads), np.random.default_rng(0), base=base)
    target = Target(image, phases(settings, image.shape[1], image.shape[0])[-1], weights)
    return Step(state, settings, target, capacity=capacity)
