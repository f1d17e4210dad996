"""The scene: what is optimised and what is exported."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float32]
IndexArray = npt.NDArray[np.intp]
Kind = Literal["closed", "open"]

OPEN_SEGMENTS = 3
"""Cubics in a stroke (paper section 3.2, as in DiffVG)."""


@dataclass(frozen=True)
class Scene:
    """Bézier shapes of one kind on a canvas; row 0 is painted first (furthest back).

    A closed curve is a ring of cubics: points 0, 3, 6 ... lie on the outline, the others are control
    points, and the last cubic ends at point 0. Its first half of cubics is one chain, its second half,
    run backwards, the other (the paper's paired structure). An open curve is a chain of cubics,
    three where warpsplat makes it.
    """

    kind: Kind
    width: int
    """Canvas width [px of the input image]."""
    height: int
    """Canvas height [px]."""
    points: FloatArray
    """Control points [canvas units], shape (curve, point, xy); closed: 6 per chain cubic, open: 10."""
    colors: FloatArray
    """sRGB in [0, 1], shape (curve, 3)."""
    opacities: FloatArray
    """In [0, 1], shape (curve, 1), or (curve, 3) for strokes with an opacity per segment."""
    widths: FloatArray
    """Stroke widths [canvas units], shape (curve,); 0 for closed curves."""
    background: FloatArray
    """sRGB in [0, 1], shape (3,)."""

    def __post_init__(self) -> None:
        """Check that the arrays fit one another."""
        count, point_count = self.points.shape[:2]
        if self.kind == "closed":
            fits = point_count >= 6 and point_count % 6 == 0
        else:
            fits = point_count >= 4 and point_count % 3 == 1
        if not fits:
            raise ValueError(f"a {self.kind} curve cannot have {point_count} control points")
        shapes = (self.points.shape, self.colors.shape, self.widths.shape, self.background.shape)
        if shapes != ((count, point_count, 2), (count, 3), (count,), (3,)):
            raise ValueError(f"scene arrays do not fit: points, colors, widths, background are {shapes}")
        allowed = (1, OPEN_SEGMENTS) if self.kind == "open" else (1,)
        if self.opacities.shape[0] != count or self.opacities.shape[1] not in allowed:
            raise ValueError(f"opacities have shape {self.opacities.shape} for {count} {self.kind} curves")

    def __len__(self) -> int:
        return len(self.points)

    def take(self, index: IndexArray) -> Scene:
        """The curves ``index``, in that order."""
        return replace(
            self,
            points=self.points[index],
            colors=self.colors[index],
            opacities=self.opacities[index],
            widths=self.widths[index],
        )

    def append(self, other: Scene) -> Scene:
        """This scene with the curves of ``other`` in front."""
        return replace(
            self,
            points=np.concatenate([self.points, other.points]),
            colors=np.concatenate([self.colors, other.colors]),
            opacities=np.concatenate([self.opacities, other.opacities]),
            widths=np.concatenate([self.widths, other.widths]),
        )

    def cubics(self) -> FloatArray:
        """Each curve's cubics, shape (curve, cubic, 4, 2)."""
        count = self.points.shape[1]
        starts = np.arange(0, count - (self.kind == "open"), 3)
        return self.points[:, (starts[:, None] + np.arange(4)[None, :]) % count]

    def flatten(self, pieces: int = 8) -> FloatArray:
        """Outlines as polylines with ``pieces`` straight pieces a cubic, shape (curve, vertex, 2)."""
        t = np.arange(pieces, dtype=np.float32)[:, None] / pieces
        s = 1 - t
        weights = np.concatenate([s**3, 3 * s * s * t, 3 * s * t * t, t**3], axis=1)
        vertices = np.einsum("vk,cjkx->cjvx", weights, self.cubics()).reshape(len(self), -1, 2)
        if self.kind == "open":
            vertices = np.concatenate([vertices, self.points[:, -1:]], axis=1)
        return vertices.astype(np.float32)

    def areas(self) -> FloatArray:
        """Area of each shape [canvas units squared]: the outline's, or length times width."""
        vertices = self.flatten()
        if self.kind == "open":
            length = np.linalg.norm(np.diff(vertices, axis=1), axis=2).sum(axis=1)
            return np.asarray(length * self.widths, dtype=np.float32)
        x, y = vertices[..., 0], vertices[..., 1]
        doubled = x * np.roll(y, -1, axis=1) - y * np.roll(x, -1, axis=1)
        return np.asarray(0.5 * np.abs(doubled.sum(axis=1)), dtype=np.float32)

    def bounds(self) -> FloatArray:
        """Boxes (x0, y0, x1, y1) of the shapes [canvas units], shape (curve, 4), stroke width included."""
        vertices = self.flatten()
        pad = 0.5 * self.widths[:, None]
        return np.concatenate([vertices.min(axis=1) - pad, vertices.max(axis=1) + pad], axis=1)
