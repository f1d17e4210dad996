"""Clearing: outlines that spill over pixels which are empty in the image are drawn back.

Spikes without area, which coarse fits of small images have, may leave a few such pixels.
"""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import numpy.typing as npt

from warpsplat.fit.export import export, show
from warpsplat.fit.problem import Run
from warpsplat.fit.settings import Settings
from warpsplat.rendering.backend import Viewport
from warpsplat.rendering.parameters import Parameters
from warpsplat.rendering.renderer import Renderer
from warpsplat.scene import FloatArray, Scene
from warpsplat.svg.write import rounded

FIRST_MOVE, ROUNDS_PER_MOVE = 0.2, 8
"""Maximum move of a point in the first round [px], as spills are a fraction of a pixel wide, and rounds after
which it is so much more."""


def clear_empty(scene: Scene, target: FloatArray, settings: Settings, run: Run, per_pixel: float) -> Scene:
    """Move points so that the file shows nothing where the image is empty, until the run has to end.

    ``scene`` is on a transparent canvas, and is rounded as in the file; ``target`` is premultiplied with
    opacity, shape (height, width, 4).
    """
    empty = target[..., 3] == 0
    for picture in scene.pictures:  # which are drawn as they are
        (top, left), (height, width) = picture.corner, picture.pixels.shape[:2]
        empty[top : top + height, left : left + width] &= picture.pixels[..., 3] == 0
    best, fewest, renderer = scene, -1, None
    max_rounds = 40  # nearly all images are clear after ten
    for number in range(max_rounds):
        if run.over():
            break
        tried = rounded(scene, per_pixel)
        shown = np.asarray(show(export(tried, settings, per_pixel), tried).convert("RGBA"))
        spill = empty & (shown[..., 3] > 0)
        count = int(spill.sum())
        if fewest < 0 or count < fewest:
            best, fewest = tried, count
        if count == 0:
            break
        viewport = Viewport(target.shape[1], target.shape[0])
        renderer = renderer or Renderer(Parameters(scene, run.backend), viewport)
        scene = _drawn_back(scene, spill, renderer, FIRST_MOVE * (1 + number / ROUNDS_PER_MOVE))
    return best


def _drawn_back(scene: Scene, spill: npt.NDArray[np.bool_], renderer: Renderer, reach: float) -> Scene:
    """Move points against the gradient of the opacity of the pixels ``spill``, by ``reach`` [px] at most.

    ``renderer``: of these shapes, with any values.
    """
    probe_opacity = 0.02  # opacity of all shapes while spilling is measured: so thin that none hides another
    renderer.parameters.assign(replace(scene, opacities=np.full_like(scene.opacities, probe_opacity)))
    renderer.forward_complete()
    gradient = np.zeros((*spill.shape, 4), np.float32)
    around = cv2.dilate(spill.astype(np.uint8), np.ones((3, 3), np.uint8))
    # Weight of the pixels around one that should be empty: a viewer may show what has no coverage here.
    neighbour_weight = 0.05
    gradient[..., 3] = spill + neighbour_weight * around
    renderer.write_image_grad(gradient)
    renderer.backward()
    slopes = renderer.parameters.gradients()["points"]
    spilt = float((renderer.read_image()[..., 3] * gradient[..., 3]).sum())
    # 1.5 times what would remove all that spills were coverage linear; a longer move would flip slivers.
    moved = 1.5 * spilt * slopes / max(float((slopes**2).sum()), 1e-30)
    lengths = np.linalg.norm(moved, axis=1, keepdims=True)
    moved *= np.minimum(1, reach / np.maximum(lengths, 1e-30))
    return replace(scene, points=(scene.points - moved).astype(np.float32))
