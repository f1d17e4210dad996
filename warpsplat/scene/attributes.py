"""The tables of what an optimiser may change of shapes (``ATTRIBUTES``), and of what it may not (``TRAITS``).

A scene's arrays, the device's arrays with their gradients and moments, Adam, surgery, ``take`` and ``append``
all read them: a new attribute is a row here, a field of ``Scene``, and the code that gives it a meaning.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum, IntEnum
from typing import Literal

import numpy as np

from warpsplat.kernels import constants


class Kind(IntEnum):
    """Fill or stroke."""

    FILL = constants.FILL
    """Painted inside its contours; open ones are closed by a straight line."""
    STROKE = constants.STROKE
    """Painted along its contours."""


class Basis(IntEnum):
    """The meaning of an outline's control points."""

    CUBIC = constants.CUBIC
    """A chain of cubic Béziers: points 0, 3, 6 ... lie on the outline, the others are handles."""
    SPLINE = constants.SPLINE
    """A uniform quadratic B-spline: each point is the control point of one quadratic Bézier, which begins and
    ends midway to the neighbouring points. An open one begins and ends at its first and last point."""
    POLYGON = 2
    """This and those below are forms (``warpsplat.forms``), whose control points are computed: vertices."""
    CIRCLE = 3
    ELLIPSE = 4
    RECTANGLE = 5

    @property
    def is_form(self) -> bool:
        """Return whether points are the values of a form, rather than control points."""
        return self > Basis.SPLINE


class Rule(IntEnum):
    """Which points are inside a fill (SVG 1.1, 11.3)."""

    NONZERO = constants.NONZERO
    EVENODD = constants.EVENODD


class Cap(IntEnum):
    """The ends of open strokes and dashes (SVG 1.1, 11.4)."""

    ROUND = constants.ROUND
    BUTT = constants.BUTT
    SQUARE = constants.SQUARE


class Join(IntEnum):
    """The corners of strokes (SVG 1.1, 11.4)."""

    ROUND = constants.ROUND
    MITER = constants.MITER
    BEVEL = constants.BEVEL


class Paint(IntEnum):
    """The colouring of a shape (SVG 1.1, 13)."""

    FLAT = constants.FLAT
    """``colors``."""
    LINEAR = constants.LINEAR
    """Stops along the first axis of the shape's frame."""
    RADIAL = constants.RADIAL
    """Stops from the frame's focus to its unit circle."""
    PICTURE = constants.PICTURE
    """The pixels of the shape's row of ``Scene.pictures``."""


class Spread(IntEnum):
    """The continuation of a gradient beyond its ends."""

    PAD = constants.PAD
    REFLECT = constants.REFLECT
    REPEAT = constants.REPEAT


class Joint(IntEnum):
    """Kind of a control point on a drawing's outline."""

    FREE = 0
    """A handle, or a point without conditions."""
    CORNER = 1
    """On the outline, which may turn there."""
    SMOOTH = 2
    """On the outline, which has no corner there: both handles lie on one line through it."""
    LINE_HANDLE = 3
    """At a third of a straight line."""


class Unit(Enum):
    """Units of numbers in the table."""

    ONE = "1"
    PIXEL = "px"
    """Pixel of the finest training size."""
    CANVAS = "canvas"
    """The canvas's longer side."""


@dataclass(frozen=True)
class Attribute:
    """An attribute that may be optimised."""

    name: str
    """Name of the field of ``Scene``."""
    per: Literal["point", "shape", "stop"]
    """The unit of rows: control points, shapes, or stops of gradients."""
    size: int
    """Numbers in a row."""
    rate: float
    """Adam's learning rate at the start."""
    rate_unit: Unit = Unit.ONE
    low: tuple[float, Unit] = (0.0, Unit.ONE)
    """Least value."""
    high: tuple[float, Unit] = (1.0, Unit.ONE)
    """Largest value."""
    kinds: tuple[Kind, ...] = (Kind.FILL, Kind.STROKE)
    """The shapes that have it; for others it is 0 and not updated."""
    paints: tuple[Paint, ...] = (Paint.FLAT, Paint.LINEAR, Paint.RADIAL)
    """The same by paint."""


@dataclass(frozen=True)
class Trait:
    """A number of each shape that is not optimised."""

    name: str
    """Name of the field of ``Scene``."""
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
"""Bounds of opacities. The upper one rounds to opaque in the file and keeps 1 - alpha away from 0."""

GRADIENTS = (Paint.LINEAR, Paint.RADIAL)

ATTRIBUTES = (
    Attribute("points", "point", 2, 3.0, Unit.PIXEL, (-1.0, Unit.CANVAS), (2.0, Unit.CANVAS)),
    Attribute("colors", "shape", 3, 0.02),
    Attribute(
        "opacities", "shape", 1, 0.04, low=(OPACITY_RANGE[0], Unit.ONE), high=(OPACITY_RANGE[1], Unit.ONE)
    ),
    Attribute(
        "frames", "shape", 6, 1.0, Unit.PIXEL, (-9.0, Unit.CANVAS), (9.0, Unit.CANVAS), paints=GRADIENTS
    ),
    Attribute("focus", "shape", 3, 0.0, low=(-1.0, Unit.ONE), paints=(Paint.RADIAL,)),
    Attribute("stop_offsets", "stop", 1, 0.01, paints=GRADIENTS),
    Attribute("stop_colors", "stop", 3, 0.02, paints=GRADIENTS),
    Attribute("stop_opacities", "stop", 1, 0.02, paints=GRADIENTS),
    Attribute("fades", "shape", 3, 0.04, low=(-1.0, Unit.ONE), kinds=(Kind.STROKE,)),
    Attribute("widths", "shape", 1, 0.3, Unit.PIXEL, (1.0, Unit.PIXEL), (1.0, Unit.CANVAS), (Kind.STROKE,)),
)
