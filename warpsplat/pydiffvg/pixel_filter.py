"""The pixel filter."""

from __future__ import annotations

from dataclasses import dataclass, field

import torch

from warpsplat.errors import UsageError
from warpsplat.pydiffvg.diffvg import FilterType


@dataclass(eq=False)
class PixelFilter:
    """What a pixel weighs the picture with: the box of its own area, radius 0.5, is the one there is."""

    type: FilterType = FilterType.box
    radius: torch.Tensor = field(default_factory=lambda: torch.tensor(0.5))
    """[px], shape ()."""

    def check(self) -> None:
        """Whether pictures can be rendered so.

        Raises:
            UsageError: they cannot.
        """
        radius = float(self.radius)
        if self.type != FilterType.box or radius != 0.5:
            name = getattr(self.type, "name", self.type)
            raise UsageError(f"pixel filter {name} of radius {radius:g} is not there, only box of radius 0.5")
