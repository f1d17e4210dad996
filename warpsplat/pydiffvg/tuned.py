"""Parts of a document that are optimised."""

from __future__ import annotations

import math
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

OPTIMIZERS = {"Adam": torch.optim.Adam, "SGD": torch.optim.SGD, "ASGD": torch.optim.ASGD}


def optimizer_of(settings: dict[str, Any], groups: list[dict[str, Any]]) -> torch.optim.Optimizer:
    """The optimiser that settings name.

    Raises:
        UsageError: there is none of that name.
    """
    name = settings["optimizer"]
    if name not in OPTIMIZERS:
        raise UsageError(f"optimizer {shown(name)} is none of {', '.join(OPTIMIZERS)}")
    return OPTIMIZERS[name](groups)


@dataclass(frozen=True)
class Tuned:
    """An optimiser and the range that its tensors stay in."""

    optimizer: torch.optim.Optimizer
    bounds: tuple[float, float]
    sorts: bool = False
    """Whether what it optimises are offsets of stops: ascending from 0 to 1."""

    @torch.no_grad()
    def step(self) -> None:
        """One step."""
        self.optimizer.step()
        for group in self.optimizer.param_groups:
            for value in group["params"]:
                if math.isfinite(self.bounds[0]):
                    value.clamp_(*self.bounds)
                if self.sorts:
                    value.copy_(value.sort().values)
                    value[0], value[-1] = 0.0, 1.0


class TunedGradient:
    """A gradient in a shape's own units."""

    def __init__(self, paint: Gradient, settings: dict[str, Any], device: torch.device) -> None:
        """Of a paint that has been read; ``settings``: see ``SvgOptimizationSettings``."""
        self._own = own = gradient_of(paint, 1.0)
        chosen = settings["gradients"]
        self.tuned: list[Tuned] = []
        self._colors, self._alphas = own.stop_colors[:, :3].to(device), own.stop_colors[:, 3].to(device)
        own.offsets = own.offsets.to(device)
        place = ("begin", "end") if isinstance(own, LinearGradient) else ("center", "radius")
        for name in place:
            setattr(own, name, getattr(own, name).to(device))
        free = (-math.inf, math.inf)
        for what, rate, tensors, bounds in (
            ("stops", "stop_lr", [own.offsets], (0.0, 1.0)),
            ("color", "color_lr", [self._colors], (1e-4, 1.0)),
            ("alpha", "alpha_lr", [self._alphas], (1e-4, 1.0)),
            ("location", "location_lr", [getattr(own, name) for name in place], free),
        ):
            if chosen[f"optimize_{what}"]:
                for tensor in tensors:
                    tensor.requires_grad_()
                groups = [{"params": tensors, "lr": chosen[rate]}]
                self.tuned.append(Tuned(optimizer_of(settings, groups), bounds, what == "stops"))

    def color(self, opacity: Tensor, matrix: Tensor) -> LinearGradient | RadialGradient:
        """As a group's paint: on the canvas, where the shape's units lie by ``matrix``."""
        own = self._own
        stops = torch.cat([self._colors, (opacity * self._alphas)[:, None]], dim=1)

        def moved(point: Tensor) -> Tensor:
            return matrix[:2, :2] @ point + matrix[:2, 2]

        if isinstance(own, LinearGradient):
            return LinearGradient(moved(own.begin), moved(own.end), own.offsets, stops)
        size = matrix[:2, :2].square().sum(dim=1).sqrt()  # right without a turn, or for a circle
        return RadialGradient(moved(own.center), own.radius * size, own.offsets, stops)

    def element(self, identity: str) -> ElementTree.Element:
        """As an element of a document."""
        eye = torch.eye(3)
        return gradient_element(identity, self.color(torch.ones(1), eye.to(self._colors)), eye.numpy())
