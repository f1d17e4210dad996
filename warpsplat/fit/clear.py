"""What is empty in the picture is empty in the file: outlines that spill over draw back."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import numpy.typing as npt

from warpsplat.fit.export import export
from warpsplat.fit.settings import Settings
from warpsplat.render.backend import Backend, Viewport
from warpsplat.render.parameters import Parameters
from warpsplat.render.renderer import Renderer
from warpsplat.scene import FloatArray, Scene
from warpsplat.svg.viewer import render_own
from warpsplat.svg.write import rounded

ROUNDS = 40
"""Most that a picture takes; nearly all are clear after ten."""

STEP = 0.2
"""How far a point moves in the first round [px]; what spills over is a part of a pixel wide."""

PATIENCE = 8
"""Rounds after which points move twice as far, then three times, and so on."""

LEAST = 0.05
"""Of the largest gradient of a point, that of shapes that have a part in what spills over."""


def clear_empty(
    scene: Scene, target: FloatArray, settings: Settings, backend: Backend, per_pixel: float
) -> Scene:
    """The scene, its points moved so that the file shows nothing where the picture is empty.

    Args:
        scene: on a transparent canvas, as the file has it.
        target: premultiplied with opacity, shape (height, width, 4).
        settings: of the file.
        backend: where to compute.
        per_pixel: units of the file's view box a pixel.
    """
    empty = target[..., 3] == 0
    best, least = scene, -1
    for number in range(ROUNDS):
        spill = _spill(scene, empty, settings, per_pixel)
        count = int(spill.sum())
        if least < 0 or count < least:
            best, least = scene, count
        if count == 0:
            break
        scene = rounded(_drawn_back(scene, spill, backend, STEP * (1 + number / PATIENCE)), per_pixel)
    return best


def _spill(
    scene: Scene, empty: npt.NDArray[np.bool_], settings: Settings, per_pixel: float
) -> npt.NDArray[np.bool_]:
    shown = np.asarray(render_own(export(scene, settings, per_pixel)).convert("RGBA"))
    return empty & (shown[..., 3] > 0)


def _drawn_back(scene: Scene, spill: npt.NDArray[np.bool_], backend: Backend, step: float) -> Scene:
    """The points of shapes that have a part in the opacity of the pixels ``spill`` move against its gradient,
    each shape's by ``step`` [px] at the most.
    """
    height, width = spill.shape
    renderer = Renderer(Parameters(scene, backend), Viewport(width, height, 1.0))
    renderer.forward_complete()
    gradient = np.zeros((height, width, 4), np.float32)
    # A viewer's rounding may show what has no coverage here: the pixels around count a little as well.
    near = cv2.dilate(spill.astype(np.uint8), np.ones((3, 3), np.uint8))
    gradient[..., 3] = spill + LEAST * near
    renderer.write_image_grad(gradient)
    renderer.backward()
    ways = renderer.parameters.gradients()["points"]
    lengths = np.linalg.norm(ways, axis=1)
    largest = np.maximum.reduceat(lengths, scene.first[:-1])
    largest = np.repeat(np.where(largest > LEAST * lengths.max(), largest, np.inf), scene.point_counts())
    return replace(scene, points=(scene.points - step * ways / largest[:, None]).astype(np.float32))
