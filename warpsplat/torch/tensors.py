"""A scene whose attributes are tensors."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import torch

from warpsplat.scene import ATTRIBUTES, Attribute, Paint, Scene, Unit

TABLE = {attribute.name: attribute for attribute in ATTRIBUTES}

WITHOUT_GRADIENT = ("focus",)
"""Attributes that are drawn and that nothing is known about the gradient of."""


@dataclass(frozen=True)
class SceneTensors:
    """Shapes whose attributes are tensors, on one device."""

    layout: Scene
    """What stays: canvas, kinds, contours, bases, styles, paints; and the attributes that have no tensor."""
    values: Mapping[str, torch.Tensor]
    """By names of ``ATTRIBUTES``: float32, in the shapes and units of the fields of ``Scene``."""

    def __post_init__(self) -> None:
        """Check that the tensors are the layout's.

        Raises:
            ValueError: a name is not in the table, a shape is not the layout's, or devices differ.
            TypeError: no tensor, or not of float32.
        """
        for name, value in self.values.items():
            if name not in TABLE:
                raise ValueError(f"no attribute {name!r}; there are {', '.join(TABLE)}")
            if not isinstance(value, torch.Tensor):
                raise TypeError(f"{name} is a {type(value).__name__}, not a torch.Tensor")
            if value.dtype != torch.float32:
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
        """Copies of all attributes of ``scene``.

        Args:
            scene: at which values to begin.
            device: default: the CPU.
            requires_grad: whether gradients are wanted, of all attributes that have one.
        """
        values = {name: torch.tensor(getattr(scene, name), device=device) for name in TABLE}
        if requires_grad:
            for name, value in values.items():
                value.requires_grad_(name not in WITHOUT_GRADIENT)
        return SceneTensors(scene, values)

    @property
    def device(self) -> torch.device:
        """Where the tensors lie; without any, the CPU."""
        return next((value.device for value in self.values.values()), torch.device("cpu"))

    def value(self, attribute: Attribute) -> torch.Tensor:
        """The tensor of ``attribute``; a copy of the layout's array where it has none."""
        found = self.values.get(attribute.name)
        if found is None:
            return torch.tensor(getattr(self.layout, attribute.name), dtype=torch.float32)
        return found

    def scene(self) -> Scene:
        """The current values, each within what a file can hold.

        Raises:
            ValueError: a value is not finite.
        """
        arrays: dict[str, Any] = {}
        for name, value in self.values.items():
            array = value.detach().cpu().numpy()
            if not np.isfinite(array).all():
                raise ValueError(f"{name} holds numbers that are not finite")
            arrays[name] = np.clip(array, *limits(TABLE[name])).astype(np.float32)
        return untied(replace(self.layout, **arrays))


def untied(scene: Scene) -> Scene:
    """The scene with only those twins whose points are still those of the shape before them."""
    twin = scene.twin.copy()
    for i in np.flatnonzero(twin).tolist():
        twin[i] = np.array_equal(scene.points_of(i), scene.points_of(i - 1))
    return replace(scene, twin=twin)


def limits(attribute: Attribute) -> tuple[float, float]:
    """Least and largest value that a file can say."""
    if attribute.name == "opacities":
        return 0.0, 1.0  # those of the table keep shapes from vanishing, and their gradients
    if attribute.low[1] == Unit.ONE:
        return attribute.low[0], attribute.high[0]
    return (0.0 if attribute.name == "widths" else -np.inf), np.inf


def has(scene: Scene, attribute: Attribute) -> bool:
    """Whether some shape of ``scene`` has ``attribute``, by its kind and paint."""
    of_kind = np.isin(scene.kind, attribute.kinds)
    return bool((of_kind & np.isin(scene.paint, [Paint(paint) for paint in attribute.paints])).any())
