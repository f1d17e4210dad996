"""Gradients. They lie in canvas units, whatever the transform of the group that they paint."""

from __future__ import annotations

from dataclasses import dataclass, field

import torch

Tensor = torch.Tensor


def _point() -> Tensor:
    return torch.zeros(2)


def _offset() -> Tensor:
    return torch.zeros(1)


def _transparent() -> Tensor:
    return torch.zeros(1, 4)


@dataclass(eq=False)
class LinearGradient:
    """Colours along a line; beyond its ends those of the first and last stop."""

    begin: Tensor = field(default_factory=_point)
    """[canvas units], shape (2,)."""
    end: Tensor = field(default_factory=_point)
    """[canvas units], shape (2,)."""
    offsets: Tensor = field(default_factory=_offset)
    """Of the stops, ascending in [0, 1], shape (stop,)."""
    stop_colors: Tensor = field(default_factory=_transparent)
    """sRGB and opacity in [0, 1], shape (stop, 4)."""


@dataclass(eq=False)
class RadialGradient:
    """Colours from a centre outwards; beyond the ellipse that of the last stop."""

    center: Tensor = field(default_factory=_point)
    """[canvas units], shape (2,)."""
    radius: Tensor = field(default_factory=_point)
    """Along x and y [canvas units], shape (2,)."""
    offsets: Tensor = field(default_factory=_offset)
    """Of the stops, ascending in [0, 1], shape (stop,)."""
    stop_colors: Tensor = field(default_factory=_transparent)
    """sRGB and opacity in [0, 1], shape (stop, 4)."""


Color = Tensor | LinearGradient | RadialGradient | None
"""Of a group's fill or stroke: shape (4,), sRGB and opacity; or a gradient; or nothing."""
