"""Transforms and gradients that are optimised, and their optimisers."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any
from xml.etree import ElementTree

import torch

from warpsplat.errors import UsageError, shown
from warpsplat.pydiffvg.color import LinearGradient, RadialGradient
from warpsplat.pydiffvg.parse_svg import gradient_of
from warpsplat.pydiffvg.save_svg import gradient_element
from warpsplat.svg.gradients import Gradient

Tensor = torch.Tensor
Bounds = tuple[float, float]

OPTIMIZERS = {"Adam": torch.optim.Adam, "SGD": torch.optim.SGD, "ASGD": torch.optim.ASGD}

COLORS = (1e-4, 1.0)
"""Bounds of colours and opacities."""


@dataclass(frozen=True)
class BoundedOptimizer:
    """An optimiser, and what its tensors must satisfy after each step."""

    optimizer: torch.optim.Optimizer
    bounds: Bounds | None
    """Least and largest value."""
    is_sorted: bool = False
    """Whether the values ascend from 0 to 1, as offsets of stops do."""

    @torch.no_grad()
    def step(self) -> None:
        """Take a step."""
        self.optimizer.step()
        for group in self.optimizer.param_groups:
            for value in group["params"]:
                if self.bounds is not None:
                    value.clamp_(*self.bounds)
                if self.is_sorted:
                    value.copy_(value.sort().values)
                    value[0], value[-1] = 0.0, 1.0


def optimized(
    settings: dict[str, Any],
    tensors: Sequence[Tensor],
    rate: float,
    bounds: Bounds | None = None,
    is_sorted: bool = False,
) -> BoundedOptimizer:
    """Return the optimiser that ``settings`` name for tensors, which will have gradients."""
    name = settings["optimizer"]
    if name not in OPTIMIZERS:
        raise UsageError(f"optimizer {shown(name)} is none of {', '.join(OPTIMIZERS)}")
    optimizer = OPTIMIZERS[name]([tensor.requires_grad_() for tensor in tensors], lr=rate)
    return BoundedOptimizer(optimizer, bounds, is_sorted)


MODES = ("move", "rigid", "similarity", "affine")


class OptimizableTransform(torch.nn.Module):
    """A transform, optimised as ``fixed @ rotation @ scale @ shear @ translation``.

    A mode optimises some of the four; a transform that it cannot represent stays in front as ``fixed``.
    """

    fixed: Tensor
    """Shape (3, 3)."""
    mirror: Tensor
    """Signs of the scales, shape (2,)."""

    def __init__(self, matrix: Tensor, settings: dict[str, Any]) -> None:
        """Start at ``matrix``, shape (3, 3)."""
        super().__init__()
        mode = settings["transform_mode"]
        if mode not in MODES:
            raise UsageError(f"transform_mode {shown(mode)} is none of {', '.join(MODES)}")
        rotation, scale, shear, translation = decompose(matrix.double())
        mirrored = scale[0] * scale[1] < 0
        tolerance = 1e-3  # difference of scales or shear up to which a mode can represent a transform
        uniform = abs(abs(scale[0]) - abs(scale[1])) < tolerance and abs(shear) < tolerance
        fits = {
            "move": uniform and abs(abs(scale[0]) - 1) < tolerance and not mirrored,
            "rigid": uniform and not mirrored,
            "similarity": uniform,
            "affine": True,
        }[mode]
        self.register_buffer("fixed", torch.eye(3) if fits else matrix.clone())
        if not fits:
            rotation, scale, shear, translation, mirrored = 0.0, (1.0, 1.0), 0.0, (0.0, 0.0), False
        self.register_buffer("mirror", torch.tensor([1.0, -1.0 if mirrored and mode != "affine" else 1.0]))

        def parameter(value: Any) -> torch.nn.Parameter:
            return torch.nn.Parameter(torch.tensor(value, dtype=torch.float32), requires_grad=False)

        self.rotation, self.shear, self.translation = map(parameter, (rotation, shear, translation))
        self.scale = parameter(scale if mode == "affine" else scale[:1])

    def optimizers(self, settings: dict[str, Any]) -> list[BoundedOptimizer]:
        """Return the optimisers of what the mode changes; ``settings``: see ``SvgOptimizationSettings``."""
        own = settings["transforms"]
        if not own["optimize_transforms"]:
            return []
        count = {"move": 1, "affine": 3}.get(own["transform_mode"], 2)
        tensors, rate = [self.rotation, self.scale, self.shear][:count], own["transform_lr"]
        return [
            optimized(settings, tensors, rate),
            optimized(settings, [self.translation], rate * own["translation_mult"]),
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


class OptimizableGradient:
    """A gradient in the units of the shape that it paints."""

    def __init__(self, paint: Gradient, settings: dict[str, Any], device: torch.device) -> None:
        """Start at ``paint``; ``settings``: see ``SvgOptimizationSettings``."""
        self._own = own = gradient_of(paint, 1.0)
        for name, value in vars(own).items():
            setattr(own, name, value.to(device))
        self._colors, self._alphas = own.stop_colors[:, :3], own.stop_colors[:, 3]
        location = [own.begin, own.end] if isinstance(own, LinearGradient) else [own.center, own.radius]
        chosen = settings["gradients"]
        self.optimizers: list[BoundedOptimizer] = []
        for what, rate, tensors, bounds in (
            ("stops", "stop_lr", [own.offsets], (0.0, 1.0)),
            ("color", "color_lr", [self._colors], COLORS),
            ("alpha", "alpha_lr", [self._alphas], COLORS),
            ("location", "location_lr", location, None),
        ):
            if chosen[f"optimize_{what}"]:
                self.optimizers.append(optimized(settings, tensors, chosen[rate], bounds, what == "stops"))

    def color(self, opacity: Tensor, matrix: Tensor) -> LinearGradient | RadialGradient:
        """Return the gradient on the canvas, with its stops' opacities multiplied by ``opacity``.

        ``matrix``: from the shape's units to the canvas, shape (3, 3).
        """
        own = self._own
        stops = torch.cat([self._colors, (opacity * self._alphas)[:, None]], dim=1)

        def moved(point: Tensor) -> Tensor:
            return matrix[:2, :2] @ point + matrix[:2, 2]

        if isinstance(own, LinearGradient):
            return LinearGradient(moved(own.begin), moved(own.end), own.offsets, stops)
        scale = matrix[:2, :2].square().sum(dim=1).sqrt()  # exact without a rotation, or for a circle
        return RadialGradient(moved(own.center), own.radius * scale, own.offsets, stops)

    def element(self, identity: str) -> ElementTree.Element:
        """Return the gradient as an element of a document."""
        eye = torch.eye(3)
        color = self.color(torch.ones_like(self._alphas[:1]), eye.to(self._colors))
        return gradient_element(identity, color, eye.numpy())
