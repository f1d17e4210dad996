"""Images of few rows or columns: continued beyond their borders, so that what they show has an extent."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from warpsplat.scene import FloatArray, Scene

THIN_SIDE = 16
"""Most rows or columns of an image in which tracing may miss regions: edges take a pixel on each side."""

BEYOND = 4
"""How far a thin image is continued [px]: regions and lines are distinguished within less."""

TRACED_PSNR = 25.0
"""PSNR from which on a thin image counts as traced [dB]; below, regions were missed."""


def margins(image: FloatArray, thin: int) -> tuple[int, int]:
    """Return by how many columns and rows an image is continued on each side: if it has up to ``thin``."""
    height, width = image.shape[:2]
    return (BEYOND if width <= thin else 0), (BEYOND if height <= thin else 0)


def continued(image: FloatArray, across: int, down: int) -> FloatArray:
    """Return an image whose outermost pixels are repeated beyond its borders, by so many columns and rows."""
    return np.pad(image, ((down, down), (across, across), (0, 0)), mode="edge")


def cut(scene: Scene, across: int, down: int) -> Scene:
    """Return the scene of a continued image on the canvas of the image itself, beyond which shapes reach."""
    shift = np.array([across, down], np.float32)
    width, height = scene.canvas.width - 2 * across, scene.canvas.height - 2 * down
    canvas = replace(scene.canvas, width=width, height=height)
    frames = np.concatenate([scene.frames[:, :2] - shift, scene.frames[:, 2:]], axis=1)
    return replace(scene, canvas=canvas, points=scene.points - shift, frames=frames)
