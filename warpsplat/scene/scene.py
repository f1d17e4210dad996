"""The scene: shapes as a struct of arrays, and pictures between them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields, replace
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from warpsplat.errors import counted
from warpsplat.field_docs import described
from warpsplat.forms import form_of
from warpsplat.scene.attributes import ATTRIBUTES, GRADIENTS, TRAITS, Attribute, Basis, Kind

FloatArray = npt.NDArray[np.float32]
Floats = npt.NDArray[np.float64]
Bools = npt.NDArray[np.bool_]
IndexArray = npt.NDArray[np.intp]
IntArray = npt.NDArray[np.int32]


@described
@dataclass(frozen=True, eq=False)
class Canvas:
    """The canvas that the shapes lie on."""

    width: int
    """[px of the input image], the canvas units."""
    height: int
    """[px]"""
    background: FloatArray | None
    """sRGB in [0, 1], shape (3,); None: transparent."""
    crisp: bool = False
    """Whether viewers should draw edges without antialiasing, because cells abut."""

    def __post_init__(self) -> None:
        """Raise a ``ValueError`` for a canvas without a pixel."""
        if not (self.width >= 1 and self.height >= 1):
            raise ValueError(f"a canvas of {self.width}x{self.height} px has no pixel")

    def __eq__(self, other: object) -> bool:
        return _equal(self, other) if isinstance(other, Canvas) else NotImplemented

    def __hash__(self) -> int:
        return hash((self.width, self.height))


@described
@dataclass(frozen=True, eq=False)
class KeptPicture:
    """SVG elements that no shape can hold, and their rendering. It equals only itself."""

    markup: str
    """The elements."""
    size: tuple[float, float]
    """Size of the canvas in the markup's units."""
    corner: tuple[int, int]
    """Row and column of the first pixel on the canvas."""
    pixels: FloatArray
    """Premultiplied sRGB and opacity, shape (height, width, 4); empty if nothing is visible."""


class Alike(NamedTuple):
    """Contours of the same kind and basis, all closed or all open, with equally many points."""

    kind: Kind
    basis: Basis
    closed: bool
    shapes: IndexArray
    """Index of each contour's shape, shape (contour,)."""
    contours: IndexArray
    """Index of each contour, shape (contour,)."""
    points: FloatArray
    """Shape (contour, point, 2)."""


@described
@dataclass(frozen=True, eq=False, repr=False)
class Scene:
    """Bézier shapes on a canvas; row 0 is painted first (furthest back).

    Shapes have any number of contours, and contours any number of Béziers. All control points are in one
    array: those of contour ``c`` from ``starts[c]`` to ``starts[c + 1]``, those of shape ``i`` from
    ``first[i]`` to ``first[i + 1]``; ``basis`` gives their meaning. Those of a closed contour are a ring: the
    last cubic ends at point 0, a spline has a quadratic for each point. Those of an open contour are a chain:
    cubics need one point more, a spline has two points more than quadratics. A shape of a form has one
    contour, and its points are the values from which control points are computed (``drawn``).

    Below, "shape (shape, 3)" is an array with a row for each shape and three columns.

    Scenes are equal if all their values are.

    Only ``canvas``, ``kind``, ``first`` and ``points`` must be given. By default, shapes are cubics of one
    contour, closed in fills and open in strokes, traits have their defaults, and attributes are 0.
    """

    canvas: Canvas
    """Canvas that the shapes lie on."""
    kind: IntArray
    """``Kind`` of each shape, shape (shape,)."""
    first: IntArray
    """First control point of each shape and, last, the number of points, shape (shape + 1,)."""
    basis: IntArray = None  # type: ignore[assignment]  # __post_init__ fills in what is left out
    """``Basis`` of each shape, shape (shape,)."""
    points: FloatArray = None  # type: ignore[assignment]
    """Control points [canvas units], shape (point, 2)."""
    colors: FloatArray = None  # type: ignore[assignment]
    """sRGB in [0, 1], shape (shape, 3)."""
    opacities: FloatArray = None  # type: ignore[assignment]
    """In [0, 1], shape (shape,)."""
    widths: FloatArray = None  # type: ignore[assignment]
    """Stroke widths [canvas units], shape (shape,); 0 for fills."""
    starts: IntArray = None  # type: ignore[assignment]
    """First control point of each contour and, last, the number of points, shape (contour + 1,)."""
    closed: IntArray = None  # type: ignore[assignment]
    """1 for closed contours, else 0, shape (contour,)."""
    rule: IntArray = None  # type: ignore[assignment]
    """``Rule`` of each shape, shape (shape,); used for fills only."""
    cap: IntArray = None  # type: ignore[assignment]
    """``Cap`` of each shape, shape (shape,); used for strokes only."""
    join: IntArray = None  # type: ignore[assignment]
    """``Join`` of each shape, shape (shape,); used for strokes only."""
    miter_limits: FloatArray = None  # type: ignore[assignment]
    """Longest miter over the width, shape (shape,); a join beyond is a bevel; used for strokes only."""
    dash: IntArray = None  # type: ignore[assignment]
    """Row of ``dashes`` of each shape, or NO_DASHES, shape (shape,); used for strokes only."""
    twin: IntArray = None  # type: ignore[assignment]
    """1 for a shape with the points of the one before: a path filled and stroked; shape (shape,)."""
    layer: IntArray = None  # type: ignore[assignment]
    """Number of each shape's layer, ascending, shape (shape,)."""
    paint: IntArray = None  # type: ignore[assignment]
    """``Paint`` of each shape, shape (shape,)."""
    spread: IntArray = None  # type: ignore[assignment]
    """``Spread`` of each shape, shape (shape,)."""
    frames: FloatArray = None  # type: ignore[assignment]
    """Origin, first and second axis of a gradient's unit space [canvas units], shape (shape, 6). A linear one
    goes from the origin along the first axis; a radial one ends at the unit circle."""
    focus: FloatArray = None  # type: ignore[assignment]
    """Centre and radius of the circle where a radial gradient begins, in its unit space, shape (shape, 3)."""
    stop_first: IntArray = None  # type: ignore[assignment]
    """First stop of each shape's gradient and, last, the number of stops, shape (shape + 1,)."""
    stop_offsets: FloatArray = None  # type: ignore[assignment]
    """Positions of the stops in [0, 1], shape (stop,); each counts as at least the one before."""
    stop_colors: FloatArray = None  # type: ignore[assignment]
    """sRGB in [0, 1], shape (stop, 3)."""
    stop_opacities: FloatArray = None  # type: ignore[assignment]
    """In [0, 1], a factor on the shape's, shape (stop,)."""
    fades: FloatArray = None  # type: ignore[assignment]
    """Offsets of a stroke's opacity in each of its thirds, shape (shape, 3); for soft Gaussians only, as a
    path has one opacity.
    """
    picture: IntArray = None  # type: ignore[assignment]
    """Row of ``pictures`` of each shape, or NO_PICTURE, shape (shape,)."""
    pictures: tuple[KeptPicture, ...] = ()
    """Pictures between the shapes, which are not optimised."""
    layer_names: tuple[str, ...] = ()
    """Names of the layers by number; empty: they are levels."""
    dashes: tuple[tuple[float, ...], ...] = ()
    """Dash patterns [canvas units]: an offset, then dashes and gaps in turn, equally many."""

    def __post_init__(self) -> None:
        """Check that the arrays fit one another.

        Raises:
            ValueError: They do not, or a shape has an impossible number of points.
        """
        if self.first.shape != (len(self) + 1,) or self.first[0] != 0 or self.first[-1] != len(self.points):
            raise ValueError(
                f"first does not run from 0 to {len(self.points)} points in {len(self) + 1} numbers"
            )
        self._fill_in()
        for attribute in ATTRIBUTES:
            shape = np.shape(getattr(self, attribute.name))
            wanted = self.shape_of(attribute)
            if shape != wanted:
                raise ValueError(f"{attribute.name} has shape {shape}, not {wanted}")
        for name in ("basis", *(trait.name for trait in TRAITS)):
            if getattr(self, name).shape != self.kind.shape:
                raise ValueError(f"{name} has shape {getattr(self, name).shape}, not {self.kind.shape}")
        self._check_contours()

    def _fill_in(self) -> None:
        defaults: dict[str, Any] = {t.name: np.full(len(self), t.default, t.dtype) for t in TRAITS}
        defaults["basis"] = np.full(len(self), Basis.CUBIC, np.int32)
        defaults["starts"] = self.first
        defaults["closed"] = (self.kind == Kind.FILL).astype(np.int32)
        defaults["stop_first"] = np.zeros(len(self) + 1, np.int32)
        for name, value in defaults.items():
            if getattr(self, name) is None:
                object.__setattr__(self, name, value)
        for attribute in ATTRIBUTES:
            if getattr(self, attribute.name) is None:
                object.__setattr__(self, attribute.name, np.zeros(self.shape_of(attribute), np.float32))

    def _check_contours(self) -> None:
        starts, counts = self.starts, np.diff(self.starts)
        if len(self.closed) != len(counts) or starts[0] != 0 or not np.isin(self.first, starts).all():
            raise ValueError("starts and closed are not those of the shapes' contours")
        owner = self.contour_shapes()
        odd = counts % 3 != np.where(self.closed, 0, 1)
        wrong = (counts < 3) | ((self.basis[owner] == Basis.CUBIC) & odd)
        for basis in self.forms():
            own, values = self.basis[owner] == basis, form_of(basis.name).VALUES
            impossible = counts != values if values else counts < np.where(self.closed, 3, 2)
            alone = np.bincount(owner, minlength=len(self))[owner] == 1
            wrong = np.where(own, impossible | ~alone, wrong)
        if wrong.any():
            bad = int(np.flatnonzero(wrong)[0])
            name = Kind(self.kind[owner[bad]]).name.lower()
            raise ValueError(f"a {name} cannot have {counts[bad]} control points")
        stops = np.diff(self.stop_first)
        if ((stops < 1) & np.isin(self.paint, GRADIENTS)).any() or (stops < 0).any():
            raise ValueError("a gradient has no stops")
        alone = self.twin.astype(np.bool_) & (
            np.concatenate([[0], self.point_counts()[:-1]]) != self.point_counts()
        )
        if alone.any():
            raise ValueError(f"shape {int(np.flatnonzero(alone)[0])} has not the points of the one before it")

    def __len__(self) -> int:
        return len(self.kind)

    def __eq__(self, other: object) -> bool:
        return _equal(self, other) if isinstance(other, Scene) else NotImplemented

    def __hash__(self) -> int:
        return hash((self.canvas, len(self), len(self.points)))  # values may change in place, sizes cannot

    def __repr__(self) -> str:
        strokes = int((self.kind == Kind.STROKE).sum())
        shapes, points = counted(len(self), "shape"), counted(len(self.points), "point")
        size = f"{self.canvas.width}x{self.canvas.height} px"
        return f"Scene({size}, {shapes}, {strokes} of them strokes, {points})"

    @staticmethod
    def uniform(
        kind: Kind,
        canvas: Canvas,
        points: FloatArray,
        basis: Basis = Basis.CUBIC,
        **attributes: Any,
    ) -> Scene:
        """Return shapes of one kind and basis with control points of shape (shape, point, 2)."""
        count, each = points.shape[:2]
        return Scene(
            canvas,
            np.full(count, kind, np.int32),
            each * np.arange(count + 1, dtype=np.int32),
            np.full(count, basis, np.int32),
            points=np.ascontiguousarray(points, np.float32).reshape(-1, 2),
            **{name: np.asarray(values, np.float32) for name, values in attributes.items()},  # type: ignore[arg-type]
        )

    def shape_of(self, attribute: Attribute) -> tuple[int, ...]:
        """Return the shape of an attribute's array."""
        rows = {"point": len(self.points), "shape": len(self), "stop": int(self.stop_first[-1])}
        size = () if attribute.size == 1 else (attribute.size,)
        return (rows[attribute.per], *size)

    def point_counts(self) -> IntArray:
        """Return the number of control points of each shape, shape (shape,)."""
        return np.diff(self.first)

    def has_twin(self) -> Bools:
        """Return which shapes share their points with the next one, shape (shape,)."""
        return np.append(self.twin[1:], 0)[: len(self)] == 1

    def are_alone(self) -> Bools:
        """Return which shapes share their points with no other, shape (shape,)."""
        return (self.twin == 0) & ~self.has_twin()

    def first_contours(self) -> IndexArray:
        """Return the first contour of each shape and, last, the number of contours, shape (shape + 1,)."""
        return np.searchsorted(self.starts, self.first)

    def contour_shapes(self) -> IndexArray:
        """Return the index of each contour's shape, shape (contour,)."""
        owner = np.searchsorted(self.first, self.starts[:-1], "right") - 1
        return np.asarray(np.minimum(owner, len(self) - 1), np.intp)

    def contour_beziers(self) -> IntArray:
        """Return the number of Béziers of each contour, shape (contour,)."""
        counts = np.diff(self.starts)
        spline = np.where(self.closed, counts, counts - 2)
        cubics = self.basis[self.contour_shapes()] == Basis.CUBIC
        return np.where(cubics, counts // 3, spline).astype(np.int32)

    def forms(self) -> tuple[Basis, ...]:
        """Return the forms that some shapes have."""
        return tuple(Basis(basis) for basis in numbers_in(self.basis).tolist() if Basis(basis).is_form)

    def drawn(self) -> Scene:
        """Return the scene with the shapes of forms as cubics; itself if there are none."""
        if not self.forms():
            return self
        counts, groups = np.diff(self.starts), []
        for group in self.alike():
            points = group.points
            if group.basis.is_form:
                points = form_of(group.basis.name).outline(points, group.closed)
            groups.append((group.contours, points))
            counts[group.contours] = points.shape[1]
        starts = starts_of(counts)
        points = np.empty((starts[-1], 2), np.float32)
        for contours, own in groups:
            points[starts[contours][:, None] + np.arange(own.shape[1])] = own
        return replace(
            self,
            basis=np.where(self.basis > Basis.SPLINE, Basis.CUBIC, self.basis).astype(np.int32),
            first=starts[self.first_contours()],
            starts=starts,
            points=points,
        )

    def bezier_counts(self) -> IntArray:
        """Return the number of Béziers of each shape, shape (shape,)."""
        owner = self.contour_shapes()
        return np.bincount(owner, self.contour_beziers(), len(self)).astype(np.int32)

    def points_of(self, shape: int) -> FloatArray:
        """Return the control points of one shape, shape (point, 2)."""
        return self.points[self.first[shape] : self.first[shape + 1]]

    def contours_of(self, shape: int) -> list[tuple[FloatArray, bool]]:
        """Return the points of each contour of a shape, shape (point, 2), and whether it is closed."""
        low, high = np.searchsorted(self.starts, self.first[shape : shape + 2])
        return [
            (self.points[self.starts[c] : self.starts[c + 1]], bool(self.closed[c])) for c in range(low, high)
        ]

    def alike(self) -> Iterator[Alike]:
        """Yield contours grouped by kind, basis, closedness and number of points."""
        owner, counts = self.contour_shapes(), np.diff(self.starts)
        keys = np.stack([self.kind[owner], self.basis[owner], self.closed, counts])
        order = np.lexsort(keys[::-1])
        ends = np.flatnonzero((np.diff(keys[:, order]) != 0).any(axis=0)) + 1
        for index in np.split(order, ends) if len(order) else ():
            kind, basis, closed, count = keys[:, index[0]].tolist()
            points = self.points[self.starts[index][:, None] + np.arange(count)]
            yield Alike(Kind(kind), Basis(basis), bool(closed), owner[index], index, points)

    def rows(self, attribute: Attribute, index: IndexArray) -> IndexArray:
        """Return the rows of an attribute's array that belong to the shapes ``index``, in that order."""
        if attribute.per == "shape":
            return index
        if attribute.per == "stop":
            return ranges(self.stop_first[index], np.diff(self.stop_first)[index])
        return ranges(self.first[index], self.point_counts()[index])

    @property
    def is_finite(self) -> bool:
        """Whether all its values are finite."""
        return all(np.isfinite(getattr(self, a.name)).all() for a in ATTRIBUTES)

    def take(self, index: IndexArray) -> Scene:
        """Return the shapes ``index``, in that order; one without its twin is no longer one."""
        index = np.asarray(index, np.intp)
        values: dict[str, Any] = {a.name: getattr(self, a.name)[self.rows(a, index)] for a in ATTRIBUTES}
        values |= {t.name: getattr(self, t.name)[index] for t in TRAITS}
        values["twin"] = values["twin"] * (np.concatenate([[-1], index[:-1]]) == index - 1)
        low, high = (np.searchsorted(self.starts, self.first[index + i]) for i in (0, 1))
        contours = ranges(low, high - low)
        return replace(
            self,
            kind=self.kind[index],
            basis=self.basis[index],
            first=starts_of(self.point_counts()[index]),
            starts=starts_of(np.diff(self.starts)[contours]),
            closed=self.closed[contours],
            stop_first=starts_of(np.diff(self.stop_first)[index]),
            **values,
        )

    def append(self, other: Scene) -> Scene:
        """Return this scene with the shapes of ``other`` in front."""
        values: dict[str, Any] = {
            row.name: np.concatenate([getattr(self, row.name), getattr(other, row.name)])
            for row in (*ATTRIBUTES, *TRAITS)
        }
        for name, rows in (("dash", "dashes"), ("picture", "pictures")):
            own, others = getattr(self, rows), getattr(other, rows)
            if others != own:
                index = getattr(other, name)
                values[name] = np.append(getattr(self, name), index + len(own) * (index >= 0)).astype(
                    np.int32
                )
                values[rows] = (*own, *others)
        return replace(
            self,
            kind=np.concatenate([self.kind, other.kind]),
            basis=np.concatenate([self.basis, other.basis]),
            first=starts_of(np.concatenate([self.point_counts(), other.point_counts()])),
            starts=starts_of(np.concatenate([np.diff(self.starts), np.diff(other.starts)])),
            closed=np.concatenate([self.closed, other.closed]),
            stop_first=starts_of(np.concatenate([np.diff(self.stop_first), np.diff(other.stop_first)])),
            **values,
        )

    def without_points(self, keep: Bools) -> Scene:
        """Return the shapes with only the points ``keep``, shape (point,)."""
        left = np.concatenate([[0], np.cumsum(keep)]).astype(np.int32)
        return replace(self, first=left[self.first], starts=left[self.starts], points=self.points[keep])


def _equal(one: Any, other: Any) -> bool:
    """Return whether all fields of two instances of a dataclass are equal; of arrays, the values."""
    pairs = ((getattr(one, field.name), getattr(other, field.name)) for field in fields(one))
    return all(
        np.array_equal(a, b) if isinstance(a, np.ndarray) or isinstance(b, np.ndarray) else a == b
        for a, b in pairs
    )


def check_scene(scene: object) -> None:
    """Raise a ``TypeError`` unless ``scene`` is a ``Scene``."""
    if isinstance(scene, Scene):
        return
    found = type(scene).__name__
    more = {"SceneTensors": ": give its scene()", "str": ": warpsplat.load_svg reads one from a file or text"}
    raise TypeError(f"a Scene is needed, not {found}{more.get(found, '')}")


def ranges(low: npt.NDArray[np.integer], counts: npt.NDArray[np.integer]) -> IndexArray:
    """Return ``counts`` consecutive numbers from each of ``low``, concatenated."""
    counts = counts.astype(np.intp)
    ends = np.cumsum(counts)
    return np.repeat(low - (ends - counts), counts) + np.arange(counts.sum())


def numbers_in(values: npt.NDArray[np.integer]) -> IndexArray:
    """Return the different ones among numbers of at least 0, ascending: faster than by ``np.unique``."""
    return np.flatnonzero(np.bincount(values.reshape(-1)))


def starts_of(counts: npt.NDArray[np.integer]) -> IntArray:
    """Return prefix sums with a 0 in front: ``Scene.first`` of shapes with ``counts`` points."""
    return np.concatenate([[0], np.cumsum(counts)]).astype(np.int32)


def level_ends(scene: Scene) -> tuple[int, ...]:
    """Return the number of shapes up to the end of each layer but the last."""
    return tuple(int(i) + 1 for i in np.flatnonzero(np.diff(scene.layer)))
