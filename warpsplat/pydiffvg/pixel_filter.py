"""The pixel filter."""

from __future__ import annotations

from dataclasses import dataclass, field

import torch

from warpsplat.errors import UsageError
from warpsplat.pydiffvg.diffvg import FilterType


@dataclass(eq=False)
class PixelFilter:
    """Weights of the image around a pixel; only the box of the pixel's own area is supported."""

    type: FilterType = FilterType.box
    radius: torch.Tensor = field(default_factory=lambda: torch.tensor(0.5))
    """[px], shape ()."""

    def check(self) -> None:
        """Raise a ``UsageError`` if the filter is not supported."""
        radius = float(self.radius)
        if self.type != FilterType.box or radius != 0.5:
            name = getattr(self.type, "name", self.type)
            raise UsageError(
                f"pixel filter {name} of radius {radius:g} is not supported, only box of radius 0.5"
            )
