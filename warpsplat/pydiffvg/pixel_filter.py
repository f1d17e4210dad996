"""Pixel filters: an image of smaller pixels -> weighted means around each pixel."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import torch

from warpsplat.errors import UsageError
from warpsplat.pydiffvg.diffvg import FilterType

Tensor = torch.Tensor


@dataclass(eq=False)
class PixelFilter:
    """Weights of the image around a pixel, a product of those along x and y."""

    type: FilterType = FilterType.box
    radius: Tensor = field(default_factory=lambda: torch.tensor(0.5))
    """Distance at which the weights end [px], shape ()."""

    def parts(self) -> int | None:
        """Return how many times finer the image is rendered, along x and y; None: a pixel is its own area.

        Raises:
            UsageError: an unknown filter, or a radius that is not positive.
        """
        radius = float(self.radius.detach())
        if self.type not in list(FilterType) or not 0 < radius < math.inf:
            name = getattr(self.type, "name", self.type)
            raise UsageError(f"there is no pixel filter {name} of radius {radius:g}")
        own_area = self.type == FilterType.box and radius == 0.5
        # Parts that an image is rendered in. The weight of a part is exact, the image even within it.
        parts_per_radius = 4
        parts_max = 8  # most parts of a pixel, along x and y
        return None if own_area else min(parts_max, math.ceil(parts_per_radius / radius))

    def apply(self, image: Tensor, parts: int) -> Tensor:
        """Return the weighted means of an image in ``parts`` times finer pixels, shape (y, x, channel).

        At the image's border weights are those of what is inside, as in DiffVG. The radius has a gradient.
        """
        rows, columns = (self._weights(side // parts, parts, image.device) for side in image.shape[:2])
        return columns @ (rows @ image.flatten(1)).view(len(rows), *image.shape[1:])

    def _weights(self, count: int, parts: int, device: torch.device) -> Tensor:
        """Return the weights of parts along one axis for each of ``count`` pixels, shape (pixel, part)."""
        radius = self.radius.to(device, torch.float32).reshape(())
        borders = torch.arange(count * parts + 1, dtype=torch.float32, device=device) / parts
        centres = torch.arange(count, dtype=torch.float32, device=device) + 0.5
        u = ((borders - centres[:, None]) / radius).clamp(-1, 1)
        weights = self._integral(u).diff(dim=1)
        return weights / weights.sum(dim=1, keepdim=True)

    def _integral(self, u: Tensor) -> Tensor:
        """Return the integral of the weights from 0 to ``u`` radii, but for a factor."""
        if self.type == FilterType.tent:
            return u - u * u.abs() / 2
        if self.type == FilterType.parabolic:
            return u - u**3 / 3
        if self.type == FilterType.hann:
            return u + (math.pi * u).sin() / math.pi
        return u
