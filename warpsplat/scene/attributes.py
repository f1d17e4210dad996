"""The table of what a shape has and an optimiser may change.

A scene's arrays, the device's arrays with their gradients and moments, Adam, surgery, ``take`` and ``append``
all read this table: a further attribute is a row here, a field of ``Scene``, and what gives it a meaning.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum, IntEnum
from typing import Literal

from warpsplat.kernels import constants


class Kind(IntEnum):
    """What a path is painted with."""

    FILL = constants.FILL
    """A closed ring of Béziers, painted inside."""
    STROKE = constants.STROKE
    """A chain of Béziers, painted along its course, with round caps and joins."""


class Basis(IntEnum):
    """What the control points of an outline are."""

    CUBIC = constants.CUBIC
    """A chain of cubic Béziers: points 0, 3, 6 ... lie on the outline, the others are handles."""
    SPLINE = constants.SPLINE
    """A uniform quadratic B-spline: each point is the control point of one quadratic Bézier, which begins and
    ends midway to the neighbouring points. A stroke begins and ends at its first and last point."""


class Unit(Enum):
    """What a number of the table is counted in."""

    ONE = "1"
    PIXEL = "px"
    """Of the finest training size."""
    CANVAS = "canvas"
    """The canvas's longer side."""


@dataclass(frozen=True)
class Attribute:
    """A row of the table."""

    name: str
    """Of the field of ``Scene``."""
    per: Literal["point", "shape"]
    """What has a row of it: each control point, or each shape."""
    size: int
    """Numbers in a row."""
    rate: float
    """Adam's learning rate at the start."""
    rate_unit: Unit
    low: tuple[float, Unit]
    """Least value."""
    high: tuple[float, Unit]
    """Largest value."""
    kinds: tuple[Kind, ...] = (Kind.FILL, Kind.STROKE)
    """The shapes that have it; of others it is 0 and not updated."""


OPACITY_RANGE = (0.02, 0.9985)
"""Bounds of an opacity. The upper one rounds to opaque in the file and keeps 1 - alpha away from 0."""

ATTRIBUTES = (
    Attribute("points", "point", 2, 3.0, Unit.PIXEL, (-1.0, Unit.CANVAS), (2.0, Unit.CANVAS)),
    Attribute("colors", "shape", 3, 0.02, Unit.ONE, (0.0, Unit.ONE), (1.0, Unit.ONE)),
    Attribute(
        "opacities", "shape", 1, 0.04, Unit.ONE, (OPACITY_RANGE[0], Unit.ONE), (OPACITY_RANGE[1], Unit.ONE)
    ),
    Attribute("fades", "shape", 3, 0.04, Unit.ONE, (-1.0, Unit.ONE), (1.0, Unit.ONE), (Kind.STROKE,)),
    Attribute("widths", "shape", 1, 0.3, Unit.PIXEL, (1.0, Unit.PIXEL), (1.0, Unit.CANVAS), (Kind.STROKE,)),
)
