"""A scene's arrays on a device, with their gradients and Adam moments."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt
import warp as wp

from warpsplat.kernels import constants
from warpsplat.kernels.bezier import Contour
from warpsplat.kernels.constants import NONE
from warpsplat.kernels.paint.gradient import frame
from warpsplat.rendering.backend import Backend, view
from warpsplat.scene import (
    ATTRIBUTES,
    Attribute,
    Basis,
    FloatArray,
    IndexArray,
    Kind,
    Paint,
    Scene,
)
from warpsplat.scene.attributes import NO_DASHES, Cap, Join
from warpsplat.scene.scene import numbers_in, starts_of

ELEMENTS = {1: wp.float32, 2: wp.vec2, 3: wp.vec3, 6: frame}
"""Type as which kernels read a row of so many numbers."""


Moments = tuple[dict[str, FloatArray], dict[str, FloatArray]]
"""First and second, by attribute."""


@dataclass
class Group:
    """One attribute on the device: values, gradients and Adam moments, each (row, size) float32."""

    attribute: Attribute
    value: wp.array
    grad: wp.array
    moment1: wp.array
    moment2: wp.array
    owner: wp.array
    """[row] the shape of each row."""
    held: wp.array
    """[row] 1 where the value is held fixed."""


class Parameters:
    """Device arrays of a scene. Surgery (``rearrange``) carries moments and ages along with the rows."""

    def __init__(
        self, scene: Scene, backend: Backend, moments: Moments | None = None, ages: np.ndarray | None = None
    ) -> None:
        """Without ``moments`` and ``ages``, the shapes are new."""
        self.backend = backend
        self.revision = 0
        """Counts ``rearrange``: launches recorded on arrays of an earlier revision are out of date."""
        self.keeps_colors = False
        """Whether colours and opacities are fixed: their gradients are not computed then."""
        zeros = {a.name: np.zeros(scene.shape_of(a), np.float32) for a in ATTRIBUTES}
        self._upload(
            scene, moments or (zeros, zeros), np.zeros(len(scene), np.int32) if ages is None else ages
        )

    def _upload(self, scene: Scene, moments: Moments, ages: np.ndarray) -> None:
        self.structure = scene
        """The scene as it was last uploaded: its attributes may have changed since, the rest not."""
        self._upload_layout(scene, ages)
        self._upload_values(scene, moments)

    def _upload_layout(self, values: Scene, ages: np.ndarray) -> None:
        scene = values.drawn()
        shapes = np.arange(len(scene))
        owner = scene.contour_shapes()
        in_contour, in_shape = scene.contour_beziers(), scene.bezier_counts()
        contours = np.arange(len(owner))
        self.shape_count, self.point_count = len(scene), len(scene.points)
        self.contour_count, self.bezier_count = len(owner), int(in_shape.sum())
        self.arrays: dict[str, wp.array] = {
            "kind": self._ints(scene.kind),
            "part": self._ints(parts := _parts(scene)),
            "basis": self._ints(scene.basis),
            "rule": self._ints(scene.rule),
            "paint": self._ints(scene.paint),
            "spread": self._ints(scene.spread),
            "picture": self._ints(scene.picture),
            "stop_first": self._ints(scene.stop_first),
            "point_first": self._ints(scene.first),
            "point_shape": self._ints(np.repeat(shapes, scene.point_counts())),
            "point_contour": self._ints(np.repeat(contours, np.diff(scene.starts))),
            "contours": self._structs(
                Contour,
                shape=owner,
                basis=scene.basis[owner],
                closed=scene.closed,
                first=scene.starts[:-1],
                count=np.diff(scene.starts),
                bezier=starts_of(in_contour)[:-1],
                beziers=in_contour,
            ),
            "bezier_first": self._ints(starts_of(in_shape)),
            "bezier_contour": self._ints(np.repeat(contours, in_contour)),
            "ages": self._ints(ages),
        }
        """Arrays that kernels bind by name: the layout of the shapes, and each attribute with its
        gradient.
        """
        self.has_twins = bool(scene.twin.any())
        if self.has_twins:
            self.arrays["point_twin"] = self._ints(_twins(values))
        self.tie_circles(_circular(scene))
        self.parts = tuple(numbers_in(parts).tolist())
        """Parts of exact coverage that have shapes."""
        if constants.STYLED in self.parts:
            self._upload_styles(scene)
        self.broken = self.backend.array(wp.int32, self.shape_count)
        """[shape] 1 where an update met a number that is not finite; it was left out."""
        self.forms: tuple[Basis, ...] = ()
        """The bases of the shapes if some are forms, of which ``rendering.forms`` computes control points."""
        if values.forms():
            self.forms = tuple(map(Basis, numbers_in(values.basis).tolist()))

    def _upload_values(self, scene: Scene, moments: Moments) -> None:
        shapes = np.arange(len(scene))
        owners = {
            "point": self._ints(np.repeat(shapes, scene.point_counts())),
            "shape": self._ints(shapes),
            "stop": self._ints(np.repeat(shapes, np.diff(scene.stop_first))),
        }
        self.groups: dict[str, Group] = {}
        for a in ATTRIBUTES:
            value, m1, m2 = (
                self._floats(x, a) for x in (getattr(scene, a.name), moments[0][a.name], moments[1][a.name])
            )
            held = self.backend.array(wp.int32, value.shape[0])
            group = Group(a, value, wp.zeros_like(value), m1, m2, owners[a.per], held)
            self.groups[a.name] = group
            rows = (value.shape[0],)
            self.arrays[a.name] = view(group.value, ELEMENTS[a.size], rows)
            self.arrays[f"{a.name}_grad"] = view(group.grad, ELEMENTS[a.size], rows)
        if self.forms:
            self.arrays |= {
                "values": self.arrays["points"],
                "values_grad": self.arrays["points_grad"],
                "value_first": self._ints(scene.first),
                "value_shape": owners["point"],
                "form": self._ints(scene.basis),
                "points": self.backend.array(wp.vec2, self.point_count),
                "points_grad": self.backend.array(wp.vec2, self.point_count),
            }

    def tie_circles(self, rows: np.ndarray) -> None:
        """Keep the gradients of the shapes ``rows`` (true or 1) circular from now on."""
        self.has_circles = bool(rows.any())
        if self.has_circles:
            self.arrays["circular"] = self._ints(rows)

    def prefix(self, count: int) -> Parameters:
        """Return the first ``count`` shapes: the same values, in the same memory, with gradients of their
        own.

        It holds as long as the arrays do: until the next ``rearrange``.
        """
        part = Parameters(self.structure.take(np.arange(count)), self.backend)
        for name, group in part.groups.items():
            rows, size = group.value.shape
            group.value = view(self.groups[name].value, wp.float32, (rows, size))
            bound = "values" if part.forms and name == "points" else name
            part.arrays[bound] = view(group.value, ELEMENTS[size], (rows,))
        return part

    def _upload_styles(self, scene: Scene) -> None:
        from warpsplat.kernels.stroker.polygons import Style  # which few scenes need

        lengths = np.array([len(pattern) for pattern in scene.dashes], np.int32)
        numbers = np.array([x for pattern in scene.dashes for x in pattern], np.float32)
        self.arrays |= {
            "styles": self._structs(
                Style, cap=scene.cap, join=scene.join, miter_limit=scene.miter_limits, dash=scene.dash
            ),
            "dash_first": self._ints(starts_of(lengths)),
            "dashes": wp.array(numbers, dtype=wp.float32, device=self.backend.device),
        }

    def _ints(self, values: np.ndarray) -> wp.array:
        return wp.array(np.ascontiguousarray(values, np.int32), dtype=wp.int32, device=self.backend.device)

    def _structs(self, kind: Any, **columns: np.ndarray) -> wp.array:
        rows = np.zeros(len(next(iter(columns.values()))), kind.numpy_dtype())
        for name, values in columns.items():
            rows[name] = values
        return wp.array(rows, dtype=kind, device=self.backend.device)

    def _floats(self, values: FloatArray, attribute: Attribute) -> wp.array:
        flat = np.ascontiguousarray(values, np.float32).reshape(-1, attribute.size)
        return wp.array(flat, dtype=wp.float32, device=self.backend.device)

    @property
    def kinds(self) -> frozenset[Kind]:
        """Kinds of shapes in the scene."""
        return frozenset(Kind(k) for k in numbers_in(self.structure.kind))

    @property
    def curves(self) -> bool:
        """Whether some shapes are curves, rather than forms."""
        return not all(basis.is_form for basis in self.forms) or not self.forms

    @property
    def paints(self) -> frozenset[Paint]:
        """Paints of shapes in the scene."""
        return frozenset(Paint(k) for k in numbers_in(self.structure.paint))

    def scene(self) -> Scene:
        """Copy the current values to the host."""
        return replace(self.structure, **self._download("value"))

    def gradients(self) -> dict[str, FloatArray]:
        """Copy the gradients to the host, in the shapes of the scene's fields."""
        return self._download("grad")

    def moments(self) -> Moments:
        """Copy Adam's first and second moments to the host, in the shapes of the scene's fields."""
        return self._download("moment1"), self._download("moment2")

    def _download(self, field: str) -> dict[str, Any]:
        return {
            name: getattr(group, field).numpy().reshape(self.structure.shape_of(group.attribute)).copy()
            for name, group in self.groups.items()
        }

    def reshape(self, scene: Scene, keep: IndexArray) -> None:
        """Take the points of ``scene``, the same shapes with only the rows ``keep`` of their points; those
        keep their moments. As after ``rearrange``, launches must be recorded again.
        """

        def kept(field: str) -> dict[str, FloatArray]:
            old = self._download(field)
            return {a.name: old[a.name][keep] if a.per == "point" else old[a.name] for a in ATTRIBUTES}

        self._upload(scene, (kept("moment1"), kept("moment2")), self.arrays["ages"].numpy())
        self.revision += 1

    def repaint(self, scene: Scene) -> None:
        """Take ``scene``, the same shapes with other paints; stops of shapes that change start over. As after
        ``rearrange``, launches must be recorded again.
        """
        before = self.structure
        kept = np.flatnonzero((before.paint == scene.paint) & (np.diff(scene.stop_first) > 0))
        stops = next(a for a in ATTRIBUTES if a.per == "stop")

        def carried(field: str) -> dict[str, FloatArray]:
            old = self._download(field)
            for a in ATTRIBUTES:
                if a.per == "stop":
                    fresh = np.zeros(scene.shape_of(a), np.float32)
                    fresh[scene.rows(stops, kept)] = old[a.name][before.rows(stops, kept)]
                    old[a.name] = fresh
            return old

        self._upload(scene, (carried("moment1"), carried("moment2")), self.arrays["ages"].numpy())
        self.revision += 1

    def assign(self, scene: Scene) -> None:
        """Take the values of ``scene``, which has the same shapes."""
        for name, group in self.groups.items():
            group.value.assign(getattr(scene, name).reshape(group.value.shape))

    def hold(self, name: str, rows: npt.NDArray[np.bool_]) -> None:
        """Hold ``rows`` of attribute ``name`` fixed until the next ``rearrange``."""
        self.groups[name].held.assign(rows.astype(np.int32))

    def take_broken(self) -> npt.NDArray[np.bool_]:
        """Return which shapes an update skipped since the last call because of a non-finite number, shape
        (shape,).

        Reads one number per shape back from the device.
        """
        found = self.broken.numpy() != 0
        if found.any():
            self.broken.zero_()
        return np.asarray(found)

    def invalid(self) -> npt.NDArray[np.bool_]:
        """Return which shapes have a non-finite value or moment, shape (shape,). Copies all to the host."""
        found = np.zeros(self.shape_count, np.bool_)
        for group in self.groups.values():
            finite = [np.isfinite(x.numpy()).all(axis=1) for x in (group.value, group.moment1, group.moment2)]
            found[group.owner.numpy()[~np.logical_and.reduce(finite)]] = True
        return found

    def reset(self, shapes: npt.NDArray[np.bool_]) -> None:
        """Reset ``shapes`` to their values after the last surgery, or at the start, with age and moments
        0.
        """
        for name, group in self.groups.items():
            rows = shapes[group.owner.numpy()]
            first = getattr(self.structure, name).reshape(group.value.shape)
            for array, values in ((group.value, first), (group.moment1, 0.0), (group.moment2, 0.0)):
                array.assign(np.where(rows[:, None], values, array.numpy()).astype(np.float32))
        self.arrays["ages"].assign(np.where(shapes, 0, self.arrays["ages"].numpy()).astype(np.int32))

    def scale_moments(self, factor: float) -> None:
        """Scale Adam's moments to those of gradients ``factor`` times as long."""
        for group in self.groups.values():
            group.moment1.assign(np.float32(factor) * group.moment1.numpy())
            group.moment2.assign(np.float32(factor * factor) * group.moment2.numpy())

    def rearrange(self, keep: IndexArray, added: Scene) -> None:
        """Keep the shapes ``keep`` (in that order) with their moments and ages, put ``added`` in front.

        New shapes start with moments and age 0. Device arrays are replaced, so launches recorded on the old
        ones must be recorded again; ``revision`` counts this.
        """
        before = self.scene()

        def carried(field: str) -> dict[str, FloatArray]:
            old = self._download(field)
            fresh = {a.name: np.zeros(added.shape_of(a), np.float32) for a in ATTRIBUTES}
            return {
                a.name: np.concatenate([old[a.name][before.rows(a, keep)], fresh[a.name]]) for a in ATTRIBUTES
            }

        ages = np.concatenate([self.arrays["ages"].numpy()[keep], np.zeros(len(added), np.int32)])
        moments = carried("moment1"), carried("moment2")
        self._upload(before.take(keep).append(added), moments, ages)
        self.revision += 1


def _parts(scene: Scene) -> np.ndarray:
    """Return which part of exact coverage each shape belongs to."""
    plain = (scene.cap == Cap.ROUND) & (scene.join == Join.ROUND) & (scene.dash == NO_DASHES)
    return np.where((scene.kind == Kind.STROKE) & ~plain, constants.STYLED, scene.kind)


def _circular(scene: Scene) -> np.ndarray:
    """Return whether each shape has a radial gradient whose second axis is the first one, turned."""
    along, across = scene.frames[:, 2:4], scene.frames[:, 4:]
    turned = np.stack([-along[:, 1], along[:, 0]], axis=1)
    return (scene.paint == Paint.RADIAL) & (across == turned).all(axis=1)


def _twins(scene: Scene) -> IndexArray:
    """Return for each point the same point of the shape that its shape is the twin of, or NONE."""
    owner = np.repeat(np.arange(len(scene)), scene.point_counts())
    behind = np.arange(len(owner)) - scene.point_counts()[owner]
    return np.where(scene.twin[owner] == 1, behind, NONE)
