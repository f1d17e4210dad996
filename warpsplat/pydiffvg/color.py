"""Gradients. They lie in canvas units, whatever the transform of the group that they paint."""

from __future__ import annotations

from dataclasses import dataclass, field

import torch

Tensor = torch.Tensor


def _zeros(*shape: int) -> Tensor:
    return field(default_factory=lambda: torch.zeros(shape))  # type: ignore[no-any-return]


@dataclass(eq=False)
class LinearGradient:
    """Colours along a line; beyond its ends those of the first and last stop."""

    begin: Tensor = _zeros(2)
    """[canvas units], shape (2,)."""
    end: Tensor = _zeros(2)
    """[canvas units], shape (2,)."""
    offsets: Tensor = _zeros(1)
    """Of the stops, ascending in [0, 1], shape (stop,)."""
    stop_colors: Tensor = _zeros(1, 4)
    """sRGB and opacity in [0, 1], shape (stop, 4)."""


@dataclass(eq=False)
class RadialGradient:
    """Colours from a centre outwards; beyond the ellipse that of the last stop."""

    center: Tensor = _zeros(2)
    """[canvas units], shape (2,)."""
    radius: Tensor = _zeros(2)
    """Along x and y [canvas units], shape (2,)."""
    offsets: Tensor = _zeros(1)
    """Of the stops, ascending in [0, 1], shape (stop,)."""
    stop_colors: Tensor = _zeros(1, 4)
    """sRGB and opacity in [0, 1], shape (stop, 4)."""


Color = Tensor | LinearGradient | RadialGradient | None
"""Of a group's fill or stroke: shape (4,), sRGB and opacity; or a gradient; or nothing."""
