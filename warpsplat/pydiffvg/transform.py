"""A transform that is optimised as a rotation, scales, a shear and a translation."""

from __future__ import annotations

import math
from typing import Any

import torch

from warpsplat.errors import UsageError, shown

Tensor = torch.Tensor

MODES = ("move", "rigid", "similarity", "affine")
TOLERANCE = 1e-3
"""Difference of scales or shear up to which a mode can represent a transform."""


class OptimizableTransform(torch.nn.Module):
    """``fixed @ rotation @ scale @ shear @ translation``.

    A mode optimises some of the four; a transform that it cannot represent stays in front as ``fixed``.
    """

    fixed: Tensor
    """Shape (3, 3)."""
    mirror: Tensor
    """Signs of the scales, shape (2,)."""

    def __init__(self, matrix: Tensor, settings: dict[str, Any]) -> None:
        """Start at ``matrix``, shape (3, 3).

        Raises:
            UsageError: an unknown mode.
        """
        super().__init__()
        mode = settings["transform_mode"]
        if mode not in MODES:
            raise UsageError(f"transform_mode {shown(mode)} is none of {', '.join(MODES)}")
        self.is_optimized = bool(settings["optimize_transforms"])
        self._rates = settings["transform_lr"], settings["transform_lr"] * settings["translation_mult"]
        rotation, scale, shear, translation = decompose(matrix.double())
        mirrored = scale[0] * scale[1] < 0
        uniform = abs(abs(scale[0]) - abs(scale[1])) < TOLERANCE and abs(shear) < TOLERANCE
        fits = {
            "move": uniform and abs(abs(scale[0]) - 1) < TOLERANCE and not mirrored,
            "rigid": uniform and not mirrored,
            "similarity": uniform,
            "affine": True,
        }[mode]
        self.register_buffer("fixed", torch.eye(3) if fits else matrix.clone())
        if not fits:
            rotation, scale, shear, translation, mirrored = 0.0, (1.0, 1.0), 0.0, (0.0, 0.0), False
        self.register_buffer("mirror", torch.tensor([1.0, -1.0 if mirrored and mode != "affine" else 1.0]))

        def parameter(value: Any, optimized: bool = True) -> torch.nn.Parameter:
            values = torch.tensor(value, dtype=torch.float32)
            return torch.nn.Parameter(values, requires_grad=optimized and self.is_optimized)

        self.rotation = parameter(rotation)
        self.scale = parameter(scale if mode == "affine" else scale[:1], mode != "move")
        self.shear = parameter(shear, mode == "affine")
        self.translation = parameter(translation)

    def parameter_groups(self) -> list[dict[str, Any]]:
        """Return the parameter groups of an optimiser."""
        others = [p for p in (self.rotation, self.scale, self.shear) if p.requires_grad]
        return [
            {"params": others, "lr": self._rates[0]},
            {"params": [self.translation], "lr": self._rates[1]},
        ]

    def forward(self) -> Tensor:
        """Return the transform, shape (3, 3)."""
        cos, sin = self.rotation.cos(), self.rotation.sin()
        zero, one = torch.zeros_like(cos), torch.ones_like(cos)
        rotation = torch.stack([torch.stack([cos, -sin]), torch.stack([sin, cos])])
        scale = self.scale.expand(2) * self.mirror
        shear = torch.stack([torch.stack([one, self.shear]), torch.stack([zero, one])])
        linear = (rotation * scale) @ shear
        affine = torch.cat([linear, (linear @ self.translation)[:, None]], dim=1)
        return self.fixed @ torch.cat([affine, torch.stack([zero, zero, one])[None]])

    def text(self) -> str:
        """Return the value of a ``transform`` attribute."""
        values = self()[:2].T.flatten().tolist()
        return f"matrix({' '.join(f'{value:.7g}' for value in values)})"


def decompose(matrix: Tensor) -> tuple[float, tuple[float, float], float, tuple[float, float]]:
    """Return the rotation, scales, shear and translation whose product is ``matrix``, shape (3, 3)."""
    (a, c), (b, d) = matrix[:2, :2].tolist()
    rotation, first = math.atan2(b, a), math.hypot(a, b)
    shear = (a * c + b * d) / (first * first)
    translation = torch.linalg.solve(matrix[:2, :2], matrix[:2, 2]).tolist()
    return rotation, (first, (a * d - b * c) / first), shear, (translation[0], translation[1])
