"""Settings for files of few shapes: details that they cannot show mislead them (docs/experiments.md)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from warpsplat.fit.settings import Settings
from warpsplat.rendering.backend import Backend
from warpsplat.rendering.renderer import render
from warpsplat.scene import Basis, FloatArray, Kind, Scene

FEW = 32
"""Most shapes of such a file."""

COARSE_PIXELS, FINE_PIXELS = 6_000, 24_000
"""Image sizes that few shapes are fitted to [pixels]."""

POINTS, MEAN_POINTS = 8, 6.0
"""Points of a new fill, and their mean in the end: another shape is worth more than a finer outline."""

OPACITY = 0.7
"""Opacity of all shapes, written once for all: where they overlap there are more colours than shapes."""

SEEN = 1e-3
"""Least share of the canvas through which the background shows for its colour to be fitted."""


def for_few(settings: Settings) -> Settings:
    """Return the settings of a fit whose file can hold ``settings.curves`` shapes, if these are few."""
    if settings.curves > FEW or settings.renderer != "exact":
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


def fit_background(scene: Scene, image: FloatArray, backend: Backend) -> Scene:
    """Return ``scene`` with the best background colour, by least squares where it shows.

    Args:
        scene: with a background.
        image: sRGB in [0, 1], shape (height, width, 3).
        backend: where to render.
    """
    black, white = (
        render(replace(scene, canvas=replace(scene.canvas, background=color)), backend=backend)
        for color in (np.zeros(3, np.float32), np.ones(3, np.float32))
    )
    seen = (white - black).astype(np.float64)
    weight = (seen * seen).sum(axis=(0, 1))
    if weight.min() < SEEN * image.shape[0] * image.shape[1]:
        return scene
    color = np.clip((seen * (image - black)).sum(axis=(0, 1)) / weight, 0, 1)
    background = (np.round(color * 255) / 255).astype(np.float32)
    return replace(scene, canvas=replace(scene.canvas, background=background))
