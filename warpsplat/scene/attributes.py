"""The table of what a shape has and an optimiser may change.

What a shape is and stays has a table of its own (``TRAITS``).

A scene's arrays, the device's arrays with their gradients and moments, Adam, surgery, ``take`` and ``append``
all read this table: a further attribute is a row here, a field of ``Scene``, and what gives it a meaning.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum, IntEnum
from typing import Literal

import numpy as np

from warpsplat.kernels import constants


class Kind(IntEnum):
    """What a path is painted with."""

    FILL = constants.FILL
    """Painted inside its contours; one that is open is closed by a straight line."""
    STROKE = constants.STROKE
    """Painted along its contours."""


class Basis(IntEnum):
    """What the control points of an outline are."""

    CUBIC = constants.CUBIC
    """A chain of cubic Béziers: points 0, 3, 6 ... lie on the outline, the others are handles."""
    SPLINE = constants.SPLINE
    """A uniform quadratic B-spline: each point is the control point of one quadratic Bézier, which begins and
    ends midway to the neighbouring points. A stroke begins and ends at its first and last point."""


class Rule(IntEnum):
    """What is inside of a fill (SVG 1.1, 11.3)."""

    NONZERO = constants.NONZERO
    EVENODD = constants.EVENODD


class Cap(IntEnum):
    """How an open contour of a stroke, or a dash, ends (SVG 1.1, 11.4)."""

    ROUND = constants.ROUND
    BUTT = constants.BUTT
    SQUARE = constants.SQUARE


class Join(IntEnum):
    """How the pieces of a stroke meet in a corner (SVG 1.1, 11.4)."""

    ROUND = constants.ROUND
    MITER = constants.MITER
    BEVEL = constants.BEVEL


class Paint(IntEnum):
    """What a shape is coloured with (SVG 1.1, 13)."""

    FLAT = constants.FLAT
    """``colors``."""
    LINEAR = constants.LINEAR
    """Stops along the first axis of the shape's frame."""
    RADIAL = constants.RADIAL
    """Stops from the frame's focus to its unit circle."""
    PICTURE = constants.PICTURE
    """What a viewer draws of the shape's row of ``Scene.pictures``."""


class Spread(IntEnum):
    """How a gradient goes on beyond its ends."""

    PAD = constants.PAD
    REFLECT = constants.REFLECT
    REPEAT = constants.REPEAT


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
    per: Literal["point", "shape", "stop"]
    """What has a row of it: each control point, each shape, or each stop of a gradient."""
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
    paints: tuple[Paint, ...] = (Paint.FLAT, Paint.LINEAR, Paint.RADIAL)
    """The same by paint."""


@dataclass(frozen=True)
class Trait:
    """A row of the table of what a shape is, which no optimiser changes: a number of each shape."""

    name: str
    """Of the field of ``Scene``."""
    default: float
    dtype: type[np.generic] = np.int32


NO_DASHES = -1
"""``Scene.dash`` of a solid stroke."""

NO_PICTURE = -1
"""``Scene.picture`` of a shape with another paint."""

TRAITS = (
    Trait("rule", Rule.NONZERO),
    Trait("cap", Cap.ROUND),
    Trait("join", Join.ROUND),
    Trait("miter_limits", 4.0, np.float32),
    Trait("dash", NO_DASHES),
    Trait("twin", 0),
    Trait("layer", 0),
    Trait("paint", Paint.FLAT),
    Trait("spread", Spread.PAD),
    Trait("picture", NO_PICTURE),
)

OPACITY_RANGE = (0.02, 0.9985)
"""Bounds of an opacity. The upper one rounds to opaque in the file and keeps 1 - alpha away from 0."""

GRADIENTS = (Paint.LINEAR, Paint.RADIAL)

ATTRIBUTES = (
    Attribute("points", "point", 2, 3.0, Unit.PIXEL, (-1.0, Unit.CANVAS), (2.0, Unit.CANVAS)),
    Attribute("colors", "shape", 3, 0.02, Unit.ONE, (0.0, Unit.ONE), (1.0, Unit.ONE)),
    Attribute(
        "opacities", "shape", 1, 0.04, Unit.ONE, (OPACITY_RANGE[0], Unit.ONE), (OPACITY_RANGE[1], Unit.ONE)
    ),
    Attribute(
        "frames", "shape", 6, 1.0, Unit.PIXEL, (-9.0, Unit.CANVAS), (9.0, Unit.CANVAS), paints=GRADIENTS
    ),
    Attribute("focus", "shape", 3, 0.0, Unit.ONE, (-1.0, Unit.ONE), (1.0, Unit.ONE), paints=(Paint.RADIAL,)),
    Attribute("stop_offsets", "stop", 1, 0.01, Unit.ONE, (0.0, Unit.ONE), (1.0, Unit.ONE), paints=GRADIENTS),
    Attribute("stop_colors", "stop", 3, 0.02, Unit.ONE, (0.0, Unit.ONE), (1.0, Unit.ONE), paints=GRADIENTS),
    Attribute(
        "stop_opacities", "stop", 1, 0.02, Unit.ONE, (0.0, Unit.ONE), (1.0, Unit.ONE), paints=GRADIENTS
    ),
    Attribute("fades", "shape", 3, 0.04, Unit.ONE, (-1.0, Unit.ONE), (1.0, Unit.ONE), (Kind.STROKE,)),
    Attribute("widths", "shape", 1, 0.3, Unit.PIXEL, (1.0, Unit.PIXEL), (1.0, Unit.CANVAS), (Kind.STROKE,)),
)
