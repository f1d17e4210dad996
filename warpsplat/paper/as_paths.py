"""Approximate soft Gaussians by paths, for the file.

A path is equally opaque throughout and ends at its outline; a soft shape is neither. Its path has the opacity
and, of strokes, the width that keep the integrals of the coverage and of its square: of all boxes the nearest
to a soft profile in mass and in contrast. Of fills it has the opacity of the middle and an outline a little
outside of the shape's, where soft edges have half of it.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from warpsplat.paper import constants as paper
from warpsplat.portable import elementary
from warpsplat.portable.sequences import interp
from warpsplat.scene import FloatArray, Kind, Scene

Floats = npt.NDArray[np.floating]

REACH = 3
"""Neighbours on each side that a Gaussian overlaps with: 1.5 standard deviations apart, the cut is at 3."""

OUTSET = 1.1
"""How far outside of its outline a soft fill ends [canvas units]. Measured on discs of radii 2.5 to 20 px:
0.6 (small and faint) to 1.8 (large and opaque)."""

LEVELS = np.linspace(0, 1, 201)
"""Opacities at which profiles are integrated."""


def _row_profile(opacity: Floats, distance: Floats) -> Floats:
    """Return coverages at distances [standard deviations] from a row of Gaussians: (opacity, distance)."""
    along = np.arange(-REACH, REACH + 1) / paper.SPREAD
    g = elementary.exp(-0.5 * (along[:, None] ** 2 + distance**2))
    return np.asarray(1 - np.prod(1 - paper.GAUSSIAN_MAX * opacity[:, None, None] * g, axis=1))


def _plateau(opacity: Floats) -> Floats:
    """Return the coverage well inside a grid of Gaussians."""
    along = np.arange(-REACH, REACH + 1) / paper.SPREAD
    g = elementary.exp(-0.5 * (along[:, None] ** 2 + along**2)).ravel()
    return np.asarray(1 - np.prod(1 - paper.GAUSSIAN_MAX * opacity[:, None] * g, axis=1))


def _outlines(scene: Scene) -> FloatArray:
    """Return the scene's points, those of fills moved outwards by ``OUTSET``: shape (point, 2)."""
    points = scene.points.copy()
    least_tangent = 1e-6  # length below which an outline has no direction [canvas units]
    for group in scene.alike():
        if group.kind != Kind.FILL:
            continue
        ring = group.points.astype(np.float64)
        following = np.roll(ring, -1, axis=1)
        doubled_area = (ring[..., 0] * following[..., 1] - ring[..., 1] * following[..., 0]).sum(axis=1)
        along = following - np.roll(ring, 1, axis=1)
        outwards = np.stack([along[..., 1], -along[..., 0]], axis=2) * np.sign(doubled_area)[:, None, None]
        length = np.maximum(np.linalg.norm(outwards, axis=2, keepdims=True), least_tangent)
        rows = scene.first[group.shapes][:, None] + np.arange(ring.shape[1])
        points[rows] = (ring + OUTSET * outwards / length).astype(np.float32)
    return points


def as_paths(scene: Scene, softness: float) -> Scene:
    """Return paths that look like a scene of Gaussians of at least ``softness`` [canvas units]."""
    distance = np.linspace(-4, 4, 161)
    profile = _row_profile(LEVELS, distance)
    mass, energy = profile.sum(axis=1), np.square(profile).sum(axis=1)
    height = np.where(mass > 0, energy / np.maximum(mass, 1e-12), 0)
    breadth = mass**2 / np.maximum(energy, 1e-12) * (distance[1] - distance[0])
    breadth[0] = breadth[1]
    opacity = np.clip(scene.opacities[:, None] + scene.fades, 0, 1)
    sigma = elementary.hypot(paper.WIDTH_SIGMA * scene.widths, softness)
    stroke = scene.kind == Kind.STROKE
    shown = np.where(
        stroke,
        interp(opacity, LEVELS, height).mean(axis=1),
        interp(scene.opacities, LEVELS, _plateau(LEVELS)),
    )
    widths = np.where(stroke, sigma * interp(opacity, LEVELS, breadth).mean(axis=1), 0)
    return replace(
        scene,
        points=_outlines(scene),
        opacities=shown.astype(np.float32),
        widths=widths.astype(np.float32),
        fades=np.zeros_like(scene.fades),
    )
