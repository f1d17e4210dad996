"""The scene: shapes as a struct of arrays."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from warpsplat.scene.attributes import ATTRIBUTES, Attribute, Basis, Kind

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


class Alike(NamedTuple):
    """Shapes of one kind and basis with equally many points."""

    kind: Kind
    basis: Basis
    shapes: IndexArray
    """Which they are, shape (shape,)."""
    points: FloatArray
    """Shape (shape, point, 2)."""


@dataclass(frozen=True)
class Scene:
    """Bézier shapes on a canvas; row 0 is painted first (furthest back).

    Shapes have as many Béziers as they need: the control points of all lie in one array, those of shape ``i``
    from ``first[i]`` to ``first[i + 1]``. The shape's ``basis`` says what they are. Of a fill they are a
    ring: the last cubic ends at point 0, a spline has a quadratic for each point. Of a stroke they are a
    chain: cubics have one point more, a spline has two points more than quadratics.
    """

    canvas: Canvas
    kind: IntArray
    """``Kind`` of each shape, shape (shape,)."""
    basis: IntArray
    """``Basis`` of each shape, shape (shape,)."""
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
    fades: FloatArray
    """What is added to a stroke's opacity in each of its thirds (of three cubics: in each), shape (shape, 3).
    Soft Gaussians alone know of it: a path has one opacity."""

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
        if self.basis.shape != self.kind.shape:
            raise ValueError(f"basis has shape {self.basis.shape}, not {self.kind.shape}")
        counts = self.point_counts()
        odd = counts % 3 != np.where(self.kind == Kind.FILL, 0, 1)
        wrong = (counts < 3) | ((self.basis == Basis.CUBIC) & odd)
        if wrong.any():
            bad = int(np.flatnonzero(wrong)[0])
            raise ValueError(
                f"a {Kind(self.kind[bad]).name.lower()} cannot have {counts[bad]} control points"
            )

    def __len__(self) -> int:
        return len(self.kind)

    @staticmethod
    def of(
        canvas: Canvas,
        kind: IntArray,
        first: IntArray,
        basis: IntArray | None = None,
        **attributes: FloatArray,
    ) -> Scene:
        """Shapes with the ``attributes`` that are known.

        Args:
            canvas: what they lie on.
            kind: shape (shape,).
            first: shape (shape + 1,).
            basis: shape (shape,); default: cubics.
            attributes: of the table, ``points`` among them; those left out are 0.
        """
        rows: dict[str, Any] = {}
        for a in ATTRIBUTES:
            if a.per == "shape":
                rows[a.name] = np.zeros((len(kind), a.size) if a.size > 1 else len(kind), np.float32)
        if basis is None:
            basis = np.full(len(kind), Basis.CUBIC, np.int32)
        return Scene(canvas, kind, basis, first, **(rows | attributes))

    @staticmethod
    def uniform(
        kind: Kind,
        canvas: Canvas,
        points: FloatArray,
        basis: Basis = Basis.CUBIC,
        **attributes: FloatArray,
    ) -> Scene:
        """Shapes of one kind and basis with equally many control points.

        Args:
            kind: of all shapes.
            canvas: what they lie on.
            points: shape (shape, point, 2).
            basis: of all shapes.
            attributes: the others of the table; those left out are 0.
        """
        count, each = points.shape[:2]
        return Scene.of(
            canvas,
            np.full(count, kind, np.int32),
            each * np.arange(count + 1, dtype=np.int32),
            np.full(count, basis, np.int32),
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

    def bezier_counts(self) -> IntArray:
        """Béziers of each shape, shape (shape,)."""
        counts = self.point_counts()
        spline = np.where(self.kind == Kind.FILL, counts, counts - 2)
        return np.where(self.basis == Basis.CUBIC, counts // 3, spline).astype(np.int32)

    def points_of(self, shape: int) -> FloatArray:
        """Control points of one shape, shape (point, 2)."""
        return self.points[self.first[shape] : self.first[shape + 1]]

    def alike(self) -> Iterator[Alike]:
        """Groups of shapes of one kind and basis with equally many points."""
        counts = self.point_counts()
        keys = np.stack([self.kind, self.basis, counts], axis=1)
        for kind, basis, count in sorted(set(map(tuple, keys.tolist()))):
            index = np.flatnonzero((keys == (kind, basis, count)).all(axis=1))
            points = self.points[self.first[index][:, None] + np.arange(count)]
            yield Alike(Kind(kind), Basis(basis), index, points)

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
        first = starts_of(self.point_counts()[index])
        return replace(self, kind=self.kind[index], basis=self.basis[index], first=first, **values)

    def append(self, other: Scene) -> Scene:
        """This scene with the shapes of ``other`` in front."""
        values: dict[str, Any] = {
            a.name: np.concatenate([getattr(self, a.name), getattr(other, a.name)]) for a in ATTRIBUTES
        }
        return replace(
            self,
            kind=np.concatenate([self.kind, other.kind]),
            basis=np.concatenate([self.basis, other.basis]),
            first=starts_of(np.concatenate([self.point_counts(), other.point_counts()])),
            **values,
        )


def starts_of(counts: npt.NDArray[np.integer]) -> IntArray:
    """Prefix sum with a 0 in front: ``Scene.first`` of shapes with ``counts`` points."""
    return np.concatenate([[0], np.cumsum(counts)]).astype(np.int32)
