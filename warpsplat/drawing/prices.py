"""Bytes that parts of a drawing take in its file, and what a byte is worth: every change is judged by these.

What a thing takes is counted in numbers of path data, since letters are mostly shared by several pieces.
"""

from __future__ import annotations

from warpsplat.fit.rounding import byte_worth
from warpsplat.svg.primitives import Primitive
from warpsplat.svg.sizes import GRADIENT, PATH

LEAST_ERROR = 3e-5
"""Mean squared error below which differences do not count: 45 dB. A drawing can reach much less, by nodes
that nobody would miss."""

NUMBER = 3.4
"""Bytes of a number of path data with the sign or the space before it, the mean of 20 logos."""

CUBIC, LINE, LEVEL = 6 * NUMBER, 2 * NUMBER, NUMBER
"""Bytes of a cubic, a line, and a level line."""

HANDLES, MOVE = CUBIC - LINE, LINE
"""Bytes of the handles of a cubic, and the beginning of a contour."""

REGION = PATH + MOVE + 4 * CUBIC
SHADED = REGION + GRADIENT
"""Bytes of a path with a contour of four cubics, in a colour and in a gradient."""

TAG = len('path d=""')


def of_primitive(made: Primitive) -> float:
    """Return the bytes of a basic shape in whole numbers, but for those that each path has, at the least.

    Alone it is an element, beside others a part of a path.
    """
    if not made.radii[0]:
        return MOVE + 3 * LEVEL  # the last line is not written
    return min(len(made.element()) - TAG, len(made.data(None)[0]))


def worth(error: float, size: float, *, price: float = 1.0, negligible: float = LEAST_ERROR) -> float:
    """Return the error that a byte is worth of a drawing with an ``error`` and a ``size`` in bytes.

    Args:
        error: Mean squared, sRGB in [0, 1].
        size: Of the file.
        price: Of a byte, over its usual one.
        negligible: Error below which differences do not count.
    """
    return price * byte_worth(max(error, negligible), size)
