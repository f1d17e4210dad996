"""Optimisers of parts of an SVG document."""

from __future__ import annotations

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


def make_optimizer(
    settings: dict[str, Any], groups: list[dict[str, Any]], bounds: Bounds | None, is_sorted: bool = False
) -> BoundedOptimizer:
    """Return the optimiser that ``settings`` name for parameter groups.

    Raises:
        UsageError: an unknown optimiser.
    """
    name = settings["optimizer"]
    if name not in OPTIMIZERS:
        raise UsageError(f"optimizer {shown(name)} is none of {', '.join(OPTIMIZERS)}")
    return BoundedOptimizer(OPTIMIZERS[name](groups), bounds, is_sorted)


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
                groups = [{"params": [tensor.requires_grad_() for tensor in tensors], "lr": chosen[rate]}]
                self.optimizers.append(make_optimizer(settings, groups, bounds, what == "stops"))

    def color(self, opacity: Tensor, matrix: Tensor) -> LinearGradient | RadialGradient:
        """Return the gradient on the canvas.

        Args:
            opacity: factor of the stops' opacities, shape (1,).
            matrix: from the shape's units to the canvas, shape (3, 3).
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
        return gradient_element(identity, self.color(torch.ones(1), eye.to(self._colors)), eye.numpy())
