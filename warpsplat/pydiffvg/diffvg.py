"""Enumerations that scripts import from DiffVG's compiled module, ``import diffvg``."""

from __future__ import annotations

from enum import IntEnum


class FilterType(IntEnum):
    """Kinds of pixel filters."""

    box = 0
    tent = 1
    parabolic = 2
    hann = 3


class ShapeType(IntEnum):
    """Kinds of shapes."""

    circle = 0
    ellipse = 1
    path = 2
    rect = 3


class ColorType(IntEnum):
    """Kinds of paints."""

    constant = 0
    linear_gradient = 1
    radial_gradient = 2
