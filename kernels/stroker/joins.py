"""Joins of strokes: which corners neighbouring pieces share, and wedges that fill the gaps between them."""

import warp as wp

from warpsplat.kernels import constants
from warpsplat.kernels.corners import miter_ratio
from warpsplat.kernels.elementary import sine_and_cosine
from warpsplat.kernels.stroker.polygons import (
    HALF_PI,
    Polygons,
    arc_pieces,
    put_corner,
)

wp.set_module_options(constants.MODULE_OPTIONS)

INVISIBLE = wp.constant(0.04)  # [px] a mitre that extends no further beyond its round join is drawn instead
NO_GAP = wp.constant(0)  # what fills the gap: nothing,
BEVEL = wp.constant(1)  # a triangle,
MITER = wp.constant(2)  # a mitre,
ARC = wp.constant(3)  # an arc


@wp.func
def plan_join(
    turn: wp.float32, shortest: wp.float32, join: wp.int32, half: wp.float32, miter_limit: wp.float32
) -> wp.vec3i:
    """Return whether two pieces share their corner at -90 degrees, that at 90, and what fills the gap.

    ``turn``: angle between them; ``shortest``: length of the shorter one [px], of which half may go to either
    joint.
    """
    ratio = miter_ratio(turn)
    half_turn = sine_and_cosine(0.5 * turn)
    fits = half * wp.abs(half_turn[0]) <= 0.5 * shortest * half_turn[1]
    mitered = half * (ratio - 1.0) <= INVISIBLE
    gap = BEVEL
    if join == constants.MITER:
        mitered = mitered or ratio <= miter_limit
        if mitered:
            gap = MITER
    elif join == constants.ROUND:
        gap = ARC
    if not fits:
        return wp.vec3i(0, 0, gap)
    if mitered:
        return wp.vec3i(1, 1, NO_GAP)
    if turn > 0.0:
        return wp.vec3i(0, 1, gap)
    return wp.vec3i(1, 0, gap)


@wp.func
def put_wedge(
    at: wp.int32,
    before: wp.int32,
    after: wp.int32,
    turn: wp.float32,
    half: wp.float32,
    gap: wp.int32,
    out: Polygons,
) -> wp.int32:
    """Fill the gap on the outer side of a joint."""
    pieces = int(1)
    radius = float(1.0)
    if gap == ARC:
        pieces = arc_pieces(turn, half)
    elif gap == MITER:
        pieces = 2
        radius = constants.MITERED
    if out.write == 0:
        return at + pieces + 2
    side = HALF_PI
    if turn > 0.0:
        side = -HALF_PI
    n = put_corner(at, before, before, wp.vec4(1.0, 0.0, 0.0, 0.0), out)
    for step in range(pieces + 1):
        k = wp.where(turn > 0.0, step, pieces - step)
        if k == 0:
            n = put_corner(n, before, before, wp.vec4(1.0, 0.0, side, 1.0), out)
        elif k == pieces:
            n = put_corner(n, after, after, wp.vec4(0.0, 0.0, side, 1.0), out)
        else:
            n = put_corner(n, before, after, wp.vec4(1.0, float(k) / float(pieces), side, radius), out)
    out.next[n - 1] = at
    return n
