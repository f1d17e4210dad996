"""Images, scenes and training steps for tests of fits."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from tests.drawing.drawings import seam
from tests.scenes import forms_scene, mixed_scene, picture_scene, with_gradients
from warpsplat.extensions import renderer_names
from warpsplat.fit.custom_loss import CustomLoss
from warpsplat.fit.place import canvas_for
from warpsplat.fit.schedule import phases
from warpsplat.fit.settings import Settings, make_settings
from warpsplat.fit.state import FitState
from warpsplat.fit.step import Step, Target
from warpsplat.rendering.backend import Backend
from warpsplat.rendering.renderer import Capacity
from warpsplat.scene import Canvas, Cap, FloatArray, KeptPicture, Kind, Paint, Scene


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
    loss: CustomLoss | None = None,
) -> Step:
    """Return the first step of a fit of ``scene`` at the finest size."""
    settings = settings or make_settings()
    state = FitState.start(scene, Backend.on(device, threads), np.random.default_rng(0), base=base)
    target = Target(image, phases(settings, image.shape[1], image.shape[0])[-1], weights, loss)
    return Step(state, settings, target, capacity=capacity)


def steps_of_all_kinds(device: str, threads: int = 1) -> Iterator[Step]:
    """Yield steps that launch every kernel of a step between them."""
    for renderer in renderer_names():
        settings = make_settings(renderer=renderer, iterations=50, xing=0.01)
        scene = mixed_scene(64, 48, splines=renderer == "exact")
        yield step_for(scene, picture(), device, settings, threads=threads)
    painted = with_gradients(mixed_scene(64, 48))
    stroke = int(np.flatnonzero(painted.kind == Kind.STROKE)[0])
    twins = replace(painted.take(np.array([stroke, stroke])), twin=np.array([0, 1], np.int32))
    scene = painted.append(twins)
    scene = replace(scene, cap=np.full(len(scene), Cap.BUTT, np.int32), canvas=Canvas(64, 48, None))
    kept = KeptPicture("<g/>", (64, 48), (9, 9), np.full((20, 20, 4), 0.5, np.float32))
    target = np.concatenate([picture(), np.ones((48, 64, 1), np.float32)], axis=2)
    yield step_for(scene.append(picture_scene(scene.canvas, kept)), target, device, threads=threads)
    yield step_for(seam().scene, np.ones((32, 48, 3), np.float32), device, threads=threads)
    circle = np.array([30, 20, 9, 0, 0, 9], np.float32)
    radial = (painted.paint == Paint.RADIAL)[:, None]
    layers = np.minimum(np.arange(len(painted)), 1).astype(np.int32)
    layered = replace(painted, frames=np.where(radial, circle, painted.frames), layer=layers)
    yield step_for(layered, picture(), device, make_settings(loss="edges"), threads=threads)
    yield step_for(forms_scene(64, 48).append(mixed_scene(64, 48)), picture(), device, threads=threads)
