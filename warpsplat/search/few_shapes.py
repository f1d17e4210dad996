"""Files of a few shapes: details that they cannot show only mislead them (docs/experiments.md)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from warpsplat.fit.renderers import renderer_of
from warpsplat.fit.settings import Settings
from warpsplat.rendering.backend import Backend
from warpsplat.rendering.renderer import render
from warpsplat.scene import Basis, FloatArray, Kind, Scene

FEW = 32
"""Shapes up to which a file is tiny."""

COARSE_PIXELS, FINE_PIXELS = 6_000, 24_000
"""Sizes of the images that the shapes are fitted to [pixels]."""

POINTS, MEAN_POINTS = 8, 6.0
"""Of a new fill, and in the mean in the end: one more shape is worth more than a finer outline."""

OPACITY = 0.7
"""Of all shapes, so that one group says it: where they overlap there are more colours than shapes."""

SEEN = 1e-3
"""Share of the canvas through which the ground has to show for its colour to matter."""


def for_few(settings: Settings) -> Settings:
    """The settings of a run whose file has room for few shapes, ``settings.curves``."""
    if settings.curves > FEW or not renderer_of(settings.renderer).exact:
        return settings
    settings = replace(
        settings,
        coarse_pixels=min(settings.coarse_pixels, COARSE_PIXELS),
        fine_pixels=min(settings.fine_pixels, FINE_PIXELS),
        texture=0.0,
    )
    if settings.kind == Kind.STROKE or settings.basis != Basis.SPLINE or settings.opaque:
        return settings
    return replace(
        settings,
        spline_points=min(settings.spline_points, POINTS),
        density=replace(settings.density, mean_points=min(settings.density.mean_points, MEAN_POINTS)),
        opacity=OPACITY,
        rates={**settings.rates, "opacities": 0.0},
    )


def grounded(scene: Scene, image: FloatArray, backend: Backend) -> Scene:
    """``scene`` on the ground that is best under it, by least squares on what is seen of it.

    Args:
        scene: with a background.
        image: sRGB in [0, 1], shape (height, width, 3).
        backend: where to render.
    """
    black, white = (
        render(replace(scene, canvas=replace(scene.canvas, background=ground)), backend=backend)
        for ground in (np.zeros(3, np.float32), np.ones(3, np.float32))
    )
    seen = (white - black).astype(np.float64)
    weight = (seen * seen).sum(axis=(0, 1))
    if weight.min() < SEEN * image.shape[0] * image.shape[1]:
        return scene
    color = np.clip((seen * (image - black)).sum(axis=(0, 1)) / weight, 0, 1)
    ground = (np.round(color * 255) / 255).astype(np.float32)
    return replace(scene, canvas=replace(scene.canvas, background=ground))
