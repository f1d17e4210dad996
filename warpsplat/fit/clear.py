"""What is empty in the picture is empty in the file: outlines that spill over draw back.

Spikes without area, which coarse fits of small pictures have, may leave a few pixels.
"""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import numpy.typing as npt

from warpsplat.fit.export import export, show
from warpsplat.fit.settings import Settings
from warpsplat.rendering.backend import Backend, Viewport
from warpsplat.rendering.parameters import Parameters
from warpsplat.rendering.renderer import Renderer
from warpsplat.scene import FloatArray, Scene
from warpsplat.svg.write import rounded

ROUNDS = 40
"""Most that a picture takes; nearly all are clear after ten."""

STEP = 0.2
"""How far a point moves in the first round [px]; what spills over is a part of a pixel wide."""

PATIENCE = 8
"""Rounds after which points move twice as far, then three times, and so on."""

THIN = 0.02
"""Opacity at which it is measured what spills over."""

LEAST = 0.05
"""Weight of a pixel beside one that is not empty though it should."""


def clear_empty(
    scene: Scene, target: FloatArray, settings: Settings, backend: Backend, per_pixel: float
) -> Scene:
    """The scene, its points moved so that the file shows nothing where the picture is empty.

    Args:
        scene: on a transparent canvas; it is rounded as in the file.
        target: premultiplied with opacity, shape (height, width, 4).
        settings: of the file.
        backend: where to compute.
        per_pixel: units of the file's view box a pixel.
    """
    empty = target[..., 3] == 0
    for picture in scene.pictures:  # which shows what it shows
        (top, left), (height, width) = picture.corner, picture.pixels.shape[:2]
        empty[top : top + height, left : left + width] &= picture.pixels[..., 3] == 0
    best, least = scene, -1
    for number in range(ROUNDS):
        held = rounded(scene, per_pixel)
        spill = _spill(held, empty, settings, per_pixel)
        count = int(spill.sum())
        if least < 0 or count < least:
            best, least = held, count
        if count == 0:
            break
        scene = _drawn_back(scene, spill, backend, STEP * (1 + number / PATIENCE))
    return best


def _spill(
    scene: Scene, empty: npt.NDArray[np.bool_], settings: Settings, per_pixel: float
) -> npt.NDArray[np.bool_]:
    shown = np.asarray(show(export(scene, settings, per_pixel), scene).convert("RGBA"))
    return empty & (shown[..., 3] > 0)


def _drawn_back(scene: Scene, spill: npt.NDArray[np.bool_], backend: Backend, step: float) -> Scene:
    """The points that have a part in the opacity of the pixels ``spill`` move against its gradient, by
    ``step`` [px] at the most.
    """
    height, width = spill.shape
    # So thin that none hides another: all of them have to go.
    thin = replace(scene, opacities=np.full_like(scene.opacities, THIN))
    renderer = Renderer(Parameters(thin, backend), Viewport(width, height, 1.0))
    renderer.forward_complete()
    gradient = np.zeros((height, width, 4), np.float32)
    # A viewer's rounding may show what has no coverage here: the pixels around count a little as well.
    near = cv2.dilate(spill.astype(np.uint8), np.ones((3, 3), np.uint8))
    gradient[..., 3] = spill + LEAST * near
    renderer.write_image_grad(gradient)
    renderer.backward()
    ways = renderer.parameters.gradients()["points"]
    # As far as takes off all that spills over, were it linear, and half as much again. Further, slivers would
    # flip over.
    spilt = float((renderer.read_image()[..., 3] * gradient[..., 3]).sum())
    moved = 1.5 * spilt * ways / max(float((ways**2).sum()), 1e-30)
    lengths = np.linalg.norm(moved, axis=1, keepdims=True)
    moved *= np.minimum(1, step / np.maximum(lengths, 1e-30))
    return replace(scene, points=(scene.points - moved).astype(np.float32))
