"""The scene: shapes as a struct of arrays."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from warpsplat.scene.attributes import ATTRIBUTES, Attribute, Kind

FloatArray = npt.NDArray[np.float32]
IndexArray = npt.NDArray[np.intp]
IntArray = npt.NDArray[np.int32]


@dataclass(frozen=True)
class Canvas:
    """What the shapes lie on."""

    width: int
    """[px of the input image], which are the canvas units."""
    height: int
    """[px]"""
    background: FloatArray
    """sRGB in [0, 1], shape (3,)."""


@dataclass(frozen=True)
class Scene:
    """Bézier shapes on a canvas; row 0 is painted first (furthest back).

    Shapes have as many cubics as they need: the control points of all lie in one array, those of shape ``i``
    from ``first[i]`` to ``first[i + 1]``. Of a fill they are a ring of cubics: points 0, 3, 6 ... lie on the
    outline, the others are control points, and the last cubic ends at point 0. Of a stroke they are a chain
    of cubics, with one point more.
    """

    canvas: Canvas
    kind: IntArray
    """``Kind`` of each shape, shape (shape,)."""
    first: IntArray
    """First control point of each shape and, last, the number of points, shape (shape + 1,)."""
    points: FloatArray
    """Control points [canvas units], shape (point, 2)."""
    colors: FloatArray
    """sRGB in [0, 1], shape (shape, 3)."""
    opacities: FloatArray
    """In [0, 1], shape (shape,)."""
    widths: FloatArray
    """Stroke widths [canvas units], shape (shape,); 0 for fills."""

    def __post_init__(self) -> None:
        """Check that the arrays fit one another.

        Raises:
            ValueError: they do not, or a shape has a number of points that its kind cannot have.
        """
        if self.first.shape != (len(self) + 1,) or self.first[0] != 0 or self.first[-1] != len(self.points):
            raise ValueError(
                f"first does not run from 0 to {len(self.points)} points in {len(self) + 1} numbers"
            )
        for attribute in ATTRIBUTES:
            shape = np.shape(getattr(self, attribute.name))
            wanted = self.shape_of(attribute)
            if shape != wanted:
                raise ValueError(f"{attribute.name} has shape {shape}, not {wanted}")
        counts = self.point_counts()
        wrong = np.where(
            self.kind == Kind.FILL, (counts < 3) | (counts % 3 != 0), (counts < 4) | (counts % 3 != 1)
        )
        if wrong.any():
            bad = int(np.flatnonzero(wrong)[0])
            raise ValueError(
                f"a {Kind(self.kind[bad]).name.lower()} cannot have {counts[bad]} control points"
            )

    def __len__(self) -> int:
        return len(self.kind)

    @staticmethod
    def of(canvas: Canvas, kind: IntArray, first: IntArray, **attributes: FloatArray) -> Scene:
        """Shapes with the ``attributes`` that are known.

        Args:
            canvas: what they lie on.
            kind: shape (shape,).
            first: shape (shape + 1,).
            attributes: of the table, ``points`` among them; those left out are 0.
        """
        rows: dict[str, Any] = {}
        for a in ATTRIBUTES:
            if a.per == "shape":
                rows[a.name] = np.zeros((len(kind), a.size) if a.size > 1 else len(kind), np.float32)
        return Scene(canvas, kind, first, **(rows | attributes))

    @staticmethod
    def uniform(kind: Kind, canvas: Canvas, points: FloatArray, **attributes: FloatArray) -> Scene:
        """Shapes of one kind with equally many control points.

        Args:
            kind: of all shapes.
            canvas: what they lie on.
            points: shape (shape, point, 2).
            attributes: the others of the table; those left out are 0.
        """
        count, each = points.shape[:2]
        return Scene.of(
            canvas,
            np.full(count, kind, np.int32),
            each * np.arange(count + 1, dtype=np.int32),
            points=np.ascontiguousarray(points, np.float32).reshape(-1, 2),
            **{name: np.asarray(values, np.float32) for name, values in attributes.items()},
        )

    def shape_of(self, attribute: Attribute) -> tuple[int, ...]:
        """Shape of the array of ``attribute``."""
        rows = len(self.points) if attribute.per == "point" else len(self)
        return (rows, attribute.size) if attribute.size > 1 else (rows,)

    def point_counts(self) -> IntArray:
        """Control points of each shape, shape (shape,)."""
        return np.diff(self.first)

    def points_of(self, shape: int) -> FloatArray:
        """Control points of one shape, shape (point, 2)."""
        return self.points[self.first[shape] : self.first[shape + 1]]

    def alike(self) -> Iterator[tuple[Kind, IndexArray, FloatArray]]:
        """Groups of shapes of one kind with equally many points: their indices, and their points as one
        array of shape (shape, point, 2).
        """
        counts = self.point_counts()
        for kind, count in sorted(set(zip(self.kind.tolist(), counts.tolist(), strict=True))):
            index = np.flatnonzero((self.kind == kind) & (counts == count))
            yield Kind(kind), index, self.points[self.first[index][:, None] + np.arange(count)]

    def rows(self, attribute: Attribute, index: IndexArray) -> IndexArray:
        """Rows of ``attribute``'s array that belong to the shapes ``index``, in that order."""
        if attribute.per == "shape":
            return index
        counts = self.point_counts()[index].astype(np.intp)
        starts = np.cumsum(counts) - counts
        return np.repeat(self.first[index] - starts, counts) + np.arange(counts.sum())

    def take(self, index: IndexArray) -> Scene:
        """The shapes ``index``, in that order."""
        index = np.asarray(index, np.intp)
        values: dict[str, Any] = {a.name: getattr(self, a.name)[self.rows(a, index)] for a in ATTRIBUTES}
        return replace(self, kind=self.kind[index], first=starts_of(self.point_counts()[index]), **values)

    def append(self, other: Scene) -> Scene:
        """This scene with the shapes of ``other`` in front."""
        values: dict[str, Any] = {
            a.name: np.concatenate([getattr(self, a.name), getattr(other, a.name)]) for a in ATTRIBUTES
        }
        return replace(
            self,
            kind=np.concatenate([self.kind, other.kind]),
            first=starts_of(np.concatenate([self.point_counts(), other.point_counts()])),
            **values,
        )


def starts_of(counts: npt.NDArray[np.integer]) -> IntArray:
    """Prefix sum with a 0 in front: ``Scene.first`` of shapes with ``counts`` points."""
    return np.concatenate([[0], np.cumsum(counts)]).astype(np.int32)
