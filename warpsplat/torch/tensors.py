"""A scene whose attributes are tensors."""

from __future__ import annotations

import functools
import math
import warnings
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import torch

from warpsplat.field_docs import described
from warpsplat.scene import ATTRIBUTES, Attribute, Scene, Unit
from warpsplat.scene.scene import check_scene

TABLE = {attribute.name: attribute for attribute in ATTRIBUTES}

WITHOUT_GRADIENT = ("focus",)
"""Attributes whose gradient is not computed."""


@described
@dataclass(frozen=True)
class SceneTensors:
    """Shapes whose attributes are tensors, on one device."""

    layout: Scene
    """All that stays: canvas, kinds, contours, bases, styles, paints; and attributes that have no tensor."""
    values: Mapping[str, torch.Tensor]
    """By names of ``ATTRIBUTES``: float32 or float64, in the shapes and units of the fields of ``Scene``.
    Those of float64 are rendered in float32; their gradients are float64."""

    def __post_init__(self) -> None:
        """Check that the tensors fit the layout.

        Raises:
            ValueError: an unknown name, another shape than the layout's, or several devices.
            TypeError: not a tensor, or neither float32 nor float64.
        """
        if torch.compiler.is_compiling():
            return  # the operator checks them, when it runs
        if not isinstance(self.layout, Scene):
            raise TypeError(f"the layout is a {type(self.layout).__name__}, not a Scene")
        for name, value in self.values.items():
            if name not in TABLE:
                raise ValueError(f"no attribute {name!r}; there are {', '.join(TABLE)}")
            if not isinstance(value, torch.Tensor):
                raise TypeError(f"{name} is a {type(value).__name__}, not a torch.Tensor")
            if value.dtype not in (torch.float32, torch.float64):
                raise TypeError(f"{name} is {value.dtype}, not torch.float32")
            wanted = self.layout.shape_of(TABLE[name])
            if tuple(value.shape) != wanted:
                raise ValueError(f"{name} has shape {tuple(value.shape)}, not {wanted}")
            if value.requires_grad and name in WITHOUT_GRADIENT:
                raise ValueError(f"{name} has no gradient here, and requires one: detach it")
            if value.device != self.device:
                raise ValueError(f"{name} is on {value.device}, other attributes are on {self.device}")

    @staticmethod
    def of(
        scene: Scene, device: torch.device | str | None = None, *, requires_grad: bool = False
    ) -> SceneTensors:
        """Return copies of all attributes of ``scene`` on a device, by default the CPU.

        ``requires_grad``: whether the attributes that some shape has require gradients.
        """
        check_scene(scene)
        values = {name: torch.tensor(getattr(scene, name), device=device) for name in TABLE}
        if requires_grad:
            for attribute in attributes_of(scene):
                values[attribute.name].requires_grad_(attribute.name not in WITHOUT_GRADIENT)
        return SceneTensors(scene, values)

    @property
    def device(self) -> torch.device:
        """The tensors' device; the CPU if there are none."""
        return next(iter(self.values.values())).device if self.values else torch.device("cpu")

    def value(self, attribute: Attribute) -> torch.Tensor:
        """Return the tensor of ``attribute`` in float32, or a copy of the layout's array."""
        found = self.values.get(attribute.name)
        if found is None:
            return torch.tensor(getattr(self.layout, attribute.name), dtype=torch.float32)
        if found.dtype == torch.float64:
            _warn_of_float64()
        return found.float()

    def drawn(self) -> dict[str, torch.Tensor]:
        """Return the attributes that some shape has, by name, in float32."""
        return {attribute.name: self.value(attribute) for attribute in self._attributes}

    @functools.cached_property
    def _attributes(self) -> tuple[Attribute, ...]:
        return attributes_of(self.layout)

    def scene(self) -> Scene:
        """Return a scene of the current values, clamped to what a file can hold.

        Raises:
            ValueError: a value is not finite.
        """
        check_extremes(dict(zip(self.values, extremes(self.values.values()), strict=True)))
        arrays: dict[str, Any] = {
            name: np.clip(value.detach().cpu().numpy(), *limits(TABLE[name])).astype(np.float32)
            for name, value in self.values.items()
        }
        scene = replace(self.layout, **arrays)
        twin = scene.twin.copy()
        for i in np.flatnonzero(twin).tolist():  # twins whose points have come apart are two shapes
            twin[i] = np.array_equal(scene.points_of(i), scene.points_of(i - 1))
        return replace(scene, twin=twin)


@functools.cache
def _warn_of_float64() -> None:
    """Warn once."""
    warnings.warn(
        "warpsplat.torch renders in float32; gradients of float64 tensors are float64", stacklevel=2
    )


def extremes(values: Iterable[torch.Tensor]) -> list[tuple[float, float]]:
    """Return the least and the largest number of each tensor, 0 if it is empty, NaN if it has one; with one
    transfer from the device.
    """
    filled = (value.detach() if value.numel() else value.new_zeros(1) for value in values)
    each = [end for value in filled for end in value.aminmax()]
    on_host = all(end.is_cpu for end in each)
    ends = [end.item() for end in each] if on_host else torch.stack(each).tolist()
    return list(zip(ends[::2], ends[1::2], strict=True))


def check_extremes(found: Mapping[str, tuple[float, float]]) -> None:
    """Raise a ``ValueError`` if a number is not finite; ``found``: ``extremes`` by name."""
    wrong = [name for name, ends in found.items() if not all(map(math.isfinite, ends))]
    if wrong:
        raise ValueError(f"{', '.join(wrong)}: numbers that are not finite")


def limits(attribute: Attribute) -> tuple[float, float]:
    """Return the least and the largest value that a file can hold."""
    if attribute.name == "opacities":
        return 0.0, 1.0  # the table's bounds keep shapes, and their gradients, from vanishing in training
    if attribute.low[1] == Unit.ONE:
        return attribute.low[0], attribute.high[0]
    return (0.0 if attribute.name == "widths" else -np.inf), np.inf


def attributes_of(scene: Scene) -> tuple[Attribute, ...]:
    """Return the attributes that some shape of ``scene`` has, by its kind and paint; points always."""
    kinds, paints = (set(np.flatnonzero(np.bincount(row)).tolist()) for row in (scene.kind, scene.paint))
    return tuple(
        a for a in ATTRIBUTES if a.per == "point" or (kinds & set(a.kinds) and paints & set(a.paints))
    )
