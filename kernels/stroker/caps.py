"""Caps of strokes, and what contours and dashes without length show."""

import warp as wp

from warpsplat.kernels import constants
from warpsplat.kernels.stroker.polygons import (
    HALF_PI,
    PI,
    ROOT_TWO,
    Polygons,
    Style,
    arc_pieces,
    put_corner,
)

wp.set_module_options(constants.MODULE_OPTIONS)


@wp.func
def put_cap(
    at: wp.int32, segment: wp.int32, along: wp.float32, facing: wp.float32, style: Style, out: Polygons
) -> wp.int32:
    """Add a cap; ``facing``: angle from the segment's direction to where it points."""
    if style.cap == constants.BUTT:
        return at
    pieces = int(3)
    if style.cap == constants.ROUND:
        pieces = arc_pieces(PI, style.half)
    if out.write == 0:
        return at + pieces + 1
    n = at
    for k in range(pieces + 1):
        angle = -HALF_PI + PI * float(k) / float(pieces)
        radius = float(1.0)
        if style.cap != constants.ROUND and (k == 1 or k == 2):  # noqa: PLR1714
            angle = 0.5 * HALF_PI * float(2 * k - 3)
            radius = ROOT_TWO
        n = put_corner(n, segment, segment, wp.vec4(along, 0.0, facing + angle, radius), out)
    out.next[n - 1] = at
    return n


@wp.func
def put_dot(at: wp.int32, segment: wp.int32, along: wp.float32, style: Style, out: Polygons) -> wp.int32:
    """Add what a contour or a dash without length shows: its caps, along the x axis, as in viewers."""
    if style.cap == constants.BUTT:
        return at
    pieces = int(4)
    radius = ROOT_TWO
    if style.cap == constants.ROUND:
        pieces = wp.max(arc_pieces(2.0 * PI, style.half), 4)
        radius = 1.0
    if out.write == 0:
        return at + pieces
    n = at
    for k in range(pieces):
        angle = 0.5 * HALF_PI + 2.0 * PI * float(k) / float(pieces)
        n = put_corner(n, segment, constants.NONE, wp.vec4(along, 0.0, angle, radius), out)
    out.next[n - 1] = at
    return n
