"""A scene's arrays on a device, with their gradients and Adam moments."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import warp as wp

from warpsplat.scene import FloatArray, IndexArray, Scene


@dataclass
class Group:
    """One parameter group: values, gradients and Adam moments, each (curve, value) float32."""

    value: wp.array
    grad: wp.array
    moment1: wp.array
    moment2: wp.array

    @staticmethod
    def upload(value: FloatArray, moment1: FloatArray, moment2: FloatArray, device: wp.Device) -> Group:
        """Copy to ``device``; the gradient starts at 0."""
        flat = [np.ascontiguousarray(x, np.float32) for x in (value, moment1, moment2)]
        arrays: list[wp.array] = [wp.array(x, dtype=wp.float32, device=device) for x in flat]
        return Group(arrays[0], wp.zeros_like(arrays[0]), arrays[1], arrays[2])


def view(array: wp.array, dtype: type, shape: tuple[int, ...]) -> wp.array:
    """The same memory as ``array``, read as ``shape`` elements of ``dtype``."""
    return wp.array(ptr=array.ptr, dtype=dtype, shape=shape, device=array.device, copy=False)


NAMES = ("points", "colors", "opacities", "widths")


class Parameters:
    """Device arrays of a scene. Surgery (``rearrange``) carries moments and ages along with the rows."""

    def __init__(self, scene: Scene, device: wp.Device) -> None:
        self.device = device
        self._template = scene
        self._upload(scene, None, np.zeros(len(scene), np.int32))

    def _upload(
        self, scene: Scene, moments: dict[str, tuple[FloatArray, FloatArray]] | None, ages: np.ndarray
    ) -> None:
        self._template = scene
        self.groups: dict[str, Group] = {}
        for name in NAMES:
            value = np.asarray(getattr(scene, name), np.float32)
            value = value.reshape(len(scene), math.prod(value.shape[1:]))
            m1, m2 = moments[name] if moments else (np.zeros_like(value), np.zeros_like(value))
            self.groups[name] = Group.upload(value, m1, m2, self.device)
        self.ages: wp.array = wp.array(ages, dtype=wp.int32, device=self.device)
        count, point_count = scene.points.shape[:2]
        opacity_count = scene.opacities.shape[1]
        self.curve_count, self.point_count, self.opacity_count = count, point_count, opacity_count
        self.part_count = count * opacity_count
        for suffix, field in (("", "value"), ("_grad", "grad")):
            arrays = {name: getattr(group, field) for name, group in self.groups.items()}
            setattr(self, f"points{suffix}", view(arrays["points"], wp.vec2, (count, point_count)))
            setattr(self, f"colors{suffix}", view(arrays["colors"], wp.vec3, (count,)))
            setattr(self, f"opacities{suffix}", arrays["opacities"])
            setattr(self, f"widths{suffix}", view(arrays["widths"], wp.float32, (count,)))

    points: wp.array
    colors: wp.array
    opacities: wp.array
    widths: wp.array
    points_grad: wp.array
    colors_grad: wp.array
    opacities_grad: wp.array
    widths_grad: wp.array

    @property
    def kind(self) -> str:
        """Kind of the curves: closed or open."""
        return self._template.kind

    @property
    def background(self) -> FloatArray:
        """The scene's background, sRGB in [0, 1]."""
        return self._template.background

    def scene(self) -> Scene:
        """Copy the current values to the host."""
        values = {name: group.value.numpy() for name, group in self.groups.items()}
        shapes = {name: getattr(self._template, name).shape for name in NAMES}
        return replace(self._template, **{name: values[name].reshape(shapes[name]).copy() for name in NAMES})

    def gradients(self) -> dict[str, FloatArray]:
        """Copy the gradients to the host, in the shapes of the scene's fields."""
        return {
            name: group.grad.numpy().reshape(getattr(self._template, name).shape)
            for name, group in self.groups.items()
        }

    def rearrange(self, keep: IndexArray, added: Scene) -> None:
        """Keep the curves ``keep`` (in that order) with their moments and ages, put ``added`` in front.

        New curves start with moments and age 0. Device arrays are made anew, so launches recorded on the
        old ones must be recorded again.
        """
        scene = self.scene().take(keep).append(added)
        moments = {}
        for name, group in self.groups.items():
            fresh = np.zeros((len(added), group.value.shape[1]), np.float32)
            moments[name] = (
                np.concatenate([group.moment1.numpy()[keep], fresh]),
                np.concatenate([group.moment2.numpy()[keep], fresh]),
            )
        ages = np.concatenate([self.ages.numpy()[keep], np.zeros(len(added), np.int32)])
        self._upload(scene, moments, ages)
