"""Strokes whose middle fades become two: one curve that spans what two should show (paper section 3.4)."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from warpsplat.scene import Basis, FloatArray, IndexArray, Kind, Scene

FADED = 0.5
"""How much fainter than both ends the middle of a stroke is that is split."""

POINTS = 10
"""Control points of the strokes that are split: of three cubics, each with an opacity of its own."""


def opacities_by_third(scene: Scene) -> FloatArray:
    """Return the opacity of each third of each shape, shape (shape, 3)."""
    return np.clip(scene.opacities[:, None] + scene.fades, 0, 1)


def faded(scene: Scene) -> IndexArray:
    """Return the strokes of three cubics whose middle is much fainter than both ends."""
    first, middle, last = opacities_by_third(scene).T
    strokes = (scene.kind == Kind.STROKE) & (scene.basis == Basis.CUBIC) & (scene.point_counts() == POINTS)
    return np.flatnonzero(strokes & (middle < np.minimum(first, last) - FADED))


def split(scene: Scene, index: IndexArray) -> Scene:
    """Return the first and last cubic of each stroke of ``index``, as two strokes of three cubics each."""
    strokes = np.repeat(np.asarray(index, np.intp), 2)
    ends = np.tile([0, POINTS - 4], len(index))
    first = (scene.first[strokes] + ends)[:, None] + np.arange(4)
    thirds = [_piece(scene.points[first], k / 3, (k + 1) / 3) for k in range(3)]
    points = np.concatenate([thirds[0], thirds[1][:, 1:], thirds[2][:, 1:]], axis=1)
    own = opacities_by_third(scene)[strokes, np.tile([0, 2], len(index))]
    return Scene.uniform(
        Kind.STROKE,
        scene.canvas,
        points,
        colors=scene.colors[strokes],
        opacities=own,
        widths=scene.widths[strokes],
    )


def _piece(cubics: npt.NDArray[np.floating], a: float, b: float) -> npt.NDArray[np.floating]:
    """The part of cubics [n, 4, 2] between the parameters ``a`` and ``b``, by their blossoms."""

    def blossom(*at: float) -> npt.NDArray[np.floating]:
        p = cubics
        for t in at:
            p = (1 - t) * p[:, :-1] + t * p[:, 1:]
        return p[:, 0]

    return np.stack([blossom(a, a, a), blossom(a, a, b), blossom(a, b, b), blossom(b, b, b)], axis=1)
