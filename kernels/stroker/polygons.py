"""The polygons that strokes are drawn as: their corners, and the quadrilaterals of straight pieces."""

import math

import warp as wp

from warpsplat.kernels import constants

wp.set_module_options(constants.MODULE_OPTIONS)

PI = wp.constant(math.pi)
HALF_PI = wp.constant(0.5 * math.pi)
ROOT_TWO = wp.constant(math.sqrt(2.0))
ARC_FLATNESS = wp.constant(0.02)  # [px] of chords from their arc
ARC_PIECES_MAX = wp.constant(256)


@wp.struct
class Polygons:
    """Arrays that corners are written to; see ``corners`` for what their numbers mean."""

    write: wp.int32  # 0: they are only counted
    segments: wp.array[wp.vec2i]  # [vertex_capacity]
    place: wp.array[wp.vec4]  # [vertex_capacity] along, share, angle, radius
    next: wp.array[wp.int32]  # [vertex_capacity] where the edge that starts here ends


@wp.struct
class Style:
    """Width, caps, joins and dashes of a stroke."""

    half: wp.float32  # of its width [px]; only known where the stroke is drawn
    cap: wp.int32
    join: wp.int32
    miter_limit: wp.float32
    dash: wp.int32  # row of the patterns, or NONE


@wp.func
def put_corner(at: wp.int32, before: wp.int32, after: wp.int32, place: wp.vec4, out: Polygons) -> wp.int32:
    """Write a corner, linked to the next; return the number of that."""
    out.segments[at] = wp.vec2i(before, after)
    out.place[at] = place
    out.next[at] = at + 1
    return at + 1


@wp.func
def arc_pieces(angle: wp.float32, half: wp.float32) -> wp.int32:
    """Return the number of chords of an arc with the radius ``half``."""
    step = 2.0 * wp.sqrt(2.0 * ARC_FLATNESS / wp.max(half, ARC_FLATNESS))
    return wp.clamp(int(wp.ceil(wp.abs(angle) / step)), 1, ARC_PIECES_MAX)


@wp.func
def put_side(
    at: wp.int32,
    segment: wp.int32,
    along: wp.float32,
    angle: wp.float32,
    shared: wp.int32,
    joint: wp.vec2i,
    out: Polygons,
) -> wp.int32:
    """Add a corner of a quadrilateral, which the two segments at a ``joint`` may share."""
    if shared != 0:
        return put_corner(at, joint[0], joint[1], wp.vec4(1.0, 0.5, angle, constants.MITERED), out)
    return put_corner(at, segment, segment, wp.vec4(along, 0.0, angle, 1.0), out)


@wp.func
def put_quadrilateral(
    at: wp.int32,
    before: wp.int32,
    segment: wp.int32,
    after: wp.int32,
    ends: wp.vec2,
    shared_start: wp.vec2i,
    shared_stop: wp.vec2i,
    out: Polygons,
) -> wp.int32:
    """Add the quadrilateral of a piece of ``segment``, between the shares ``ends`` of it.

    ``shared_start``, ``shared_stop``: whether its corners at -90 and at 90 degrees are shared with the
    neighbours ``before`` and ``after``. An end with only one such corner has one on the centre line as well.
    """
    if out.write == 0:
        return at + 4 + wp.abs(shared_start[0] - shared_start[1]) + wp.abs(shared_stop[0] - shared_stop[1])
    start_joint = wp.vec2i(before, segment)
    stop_joint = wp.vec2i(segment, after)
    centre = wp.vec4(1.0, 0.0, 0.0, 0.0)
    n = put_side(at, segment, ends[0], -HALF_PI, shared_start[0], start_joint, out)
    n = put_side(n, segment, ends[1], -HALF_PI, shared_stop[0], stop_joint, out)
    if shared_stop[0] != shared_stop[1]:
        n = put_corner(n, segment, segment, centre, out)
    n = put_side(n, segment, ends[1], HALF_PI, shared_stop[1], stop_joint, out)
    n = put_side(n, segment, ends[0], HALF_PI, shared_start[1], start_joint, out)
    if shared_start[0] != shared_start[1]:
        n = put_corner(n, before, before, centre, out)
    out.next[n - 1] = at
    return n
