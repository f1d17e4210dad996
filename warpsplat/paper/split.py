"""Splitting: a stroke that fades in the middle becomes two, as it spans two objects (paper section 3.4)."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from warpsplat.scene import Basis, FloatArray, IndexArray, Kind, Scene

MIN_FADE = 0.5
"""Minimum difference in opacity between a stroke's middle and both ends at which it is split."""

STROKE_POINTS = 10
"""Control points of strokes that are split: of three cubics, each with an opacity of its own."""


def opacities_by_third(scene: Scene) -> FloatArray:
    """Return the opacity of each third of each shape, shape (shape, 3)."""
    return np.clip(scene.opacities[:, None] + scene.fades, 0, 1)


def faded(scene: Scene) -> IndexArray:
    """Return the strokes of three cubics whose middle one is much fainter than both others."""
    first, middle, last = opacities_by_third(scene).T
    strokes = (scene.kind == Kind.STROKE) & (scene.basis == Basis.CUBIC)
    strokes &= scene.point_counts() == STROKE_POINTS
    return np.flatnonzero(strokes & (middle < np.minimum(first, last) - MIN_FADE))


def split(scene: Scene, index: IndexArray) -> Scene:
    """Return the first and the last cubic of each of the strokes ``index``, each cut into three cubics."""
    strokes = np.repeat(np.asarray(index, np.intp), 2)
    ends = np.tile([0, STROKE_POINTS - 4], len(index))
    first = (scene.first[strokes] + ends)[:, None] + np.arange(4)
    thirds = [subcurve(scene.points[first], k / 3, (k + 1) / 3) for k in range(3)]
    return Scene.uniform(
        Kind.STROKE,
        scene.canvas,
        np.concatenate([thirds[0], thirds[1][:, 1:], thirds[2][:, 1:]], axis=1),
        colors=scene.colors[strokes],
        opacities=opacities_by_third(scene)[strokes, np.tile([0, 2], len(index))],
        widths=scene.widths[strokes],
    )


def subcurve(cubics: npt.NDArray[np.floating], a: float, b: float) -> npt.NDArray[np.floating]:
    """Return the part of cubics [n, 4, 2] between the parameters ``a`` and ``b``, by their blossoms."""

    def blossom(*at: float) -> npt.NDArray[np.floating]:
        p = cubics
        for t in at:
            p = (1 - t) * p[:, :-1] + t * p[:, 1:]
        return p[:, 0]

    return np.stack([blossom(a, a, a), blossom(a, a, b), blossom(a, b, b), blossom(b, b, b)], axis=1)
