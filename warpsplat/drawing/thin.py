"""Pictures of few rows or columns: continued beyond their borders, so that what they show has an extent."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from warpsplat.fit.loop import Fit
from warpsplat.scene import FloatArray, Scene

THIN = 16
"""Rows or columns up to which tracing may find no regions, whose edges take a pixel on each side."""

THINNEST = 4
"""The same, of what has no lines either."""

BEYOND = 4
"""How far a thin picture is continued [px]: regions and lines are told apart within less."""

SEEN = 30.0
"""PSNR from which on a thin picture was traced [dB]; below, regions were missed."""


def margins(image: FloatArray, thin: int) -> tuple[int, int]:
    """By how many columns and rows a picture is continued on each side: where it has up to ``thin``."""
    height, width = image.shape[:2]
    return (BEYOND if width <= thin else 0), (BEYOND if height <= thin else 0)


def continued(image: FloatArray, across: int, down: int) -> FloatArray:
    """A picture whose outermost pixels go on beyond its borders, by so many columns and rows."""
    return np.ascontiguousarray(np.pad(image, ((down, down), (across, across), (0, 0)), mode="edge"))


def cut(scene: Scene, across: int, down: int) -> Scene:
    """What the picture shows of a continued one's scene, whose shapes go on beyond its canvas."""
    shift = np.array([across, down], np.float32)
    width, height = scene.canvas.width - 2 * across, scene.canvas.height - 2 * down
    frames = scene.frames.copy()
    frames[:, :2] -= shift
    return replace(
        scene,
        canvas=replace(scene.canvas, width=width, height=height),
        points=scene.points - shift,
        frames=frames,
    )


def best_of_thin(ways: list[Callable[[], Fit]]) -> Fit:
    """What the first of some ways makes that shows the picture; the best of all, where none does."""
    best = ways[0]()
    for way in ways[1:]:
        if best.render_psnr >= SEEN:
            break
        made = way()
        best = made if made.render_psnr > best.render_psnr else best
    return best
