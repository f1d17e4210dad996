"""Paints. Gradients are in canvas units, whatever the transform of the group that they paint."""

from __future__ import annotations

from dataclasses import dataclass, field

import torch

Tensor = torch.Tensor


@dataclass(eq=False)
class LinearGradient:
    """Colours along a line; before and after it those of the first and the last stop."""

    begin: Tensor = field(default_factory=lambda: torch.zeros(2))
    """[canvas units], shape (2,)."""
    end: Tensor = field(default_factory=lambda: torch.zeros(2))
    """[canvas units], shape (2,)."""
    offsets: Tensor = field(default_factory=lambda: torch.zeros(1))
    """Stops in [0, 1], ascending, shape (stop,)."""
    stop_colors: Tensor = field(default_factory=lambda: torch.zeros(1, 4))
    """sRGB and opacity in [0, 1], shape (stop, 4)."""


@dataclass(eq=False)
class RadialGradient:
    """Colours from a centre outwards; beyond the ellipse that of the last stop."""

    center: Tensor = field(default_factory=lambda: torch.zeros(2))
    """[canvas units], shape (2,)."""
    radius: Tensor = field(default_factory=lambda: torch.zeros(2))
    """Along x and y [canvas units], shape (2,)."""
    offsets: Tensor = field(default_factory=lambda: torch.zeros(1))
    """Stops in [0, 1], ascending, shape (stop,)."""
    stop_colors: Tensor = field(default_factory=lambda: torch.zeros(1, 4))
    """sRGB and opacity in [0, 1], shape (stop, 4)."""


Color = Tensor | LinearGradient | RadialGradient | None
"""Fill or stroke of a group: sRGB and opacity, shape (4,); a gradient; or nothing."""
