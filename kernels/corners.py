"""Polygons of strokes: where their corners lie, and the adjoint.

A corner hangs on a segment of the centre line: it lies beside the point ``along`` of it (0: its start, 1: its
end; in between a dash begins or ends there), half the width x ``radius`` away, in a direction that is turned
from the segment's by ``angle`` and by ``share`` of the turn to a second segment. The tip of a mitre has the
radius that the two offset lines meet at.

Adjoint: what moves a corner moves its point, turns one of the two segments, or changes half the width. A
segment from a to b turns by (b - a) x (db - da) / |b - a|^2. A dash's end keeps its distance from the
contour's start along the line, so it moves back along its segment by as much as what lies before it grows.
"""

import warp as wp

from warpsplat.kernels import constants
from warpsplat.kernels.bezier import Contour
from warpsplat.kernels.coverage.stroke import half_width
from warpsplat.kernels.elementary import angle_of, sine_and_cosine
from warpsplat.kernels.outline import within_reach
from warpsplat.kernels.ranges import find_range

wp.set_module_options(constants.MODULE_OPTIONS)

TINY = wp.constant(1.0e-12)


@wp.func
def segment_direction(
    vertex: wp.array[wp.vec2], vertex_next: wp.array[wp.int32], segment: wp.int32
) -> wp.vec2:
    """Return a unit vector along a segment of the centre line; NONE has that of the x axis."""
    if segment == constants.NONE:
        return wp.vec2(1.0, 0.0)
    d = vertex[vertex_next[segment]] - vertex[segment]
    return d / wp.max(wp.length(d), TINY)


@wp.func
def turn_between(before: wp.vec2, after: wp.vec2) -> wp.float32:
    """Return the angle from one unit vector to another, positive from x to y."""
    return angle_of(wp.dot(before, after), before[0] * after[1] - before[1] * after[0])


@wp.func
def miter_ratio(turn: wp.float32) -> wp.float32:
    """Return the length of a mitre over the width (SVG 1.1, 11.4)."""
    return 1.0 / wp.max(sine_and_cosine(0.5 * turn)[1], 1.0e-6)


@wp.func
def corner_centre(
    vertex: wp.array[wp.vec2], vertex_next: wp.array[wp.int32], segment: wp.int32, along: wp.float32
) -> wp.vec2:
    """Return the point of the centre line that a corner hangs on; at 0 and 1 exactly the segment's ends."""
    end = segment
    if along != 0.0:
        end = vertex_next[segment]
    return (1.0 - along) * vertex[segment] + along * vertex[end]


@wp.kernel
def place_corners(
    # In:
    offset: wp.int32,
    widths: wp.array[wp.float32],  # [shape_count] canvas units
    scale: wp.float32,
    vertex: wp.array[wp.vec2],  # [vertex_capacity] px; of the centre lines
    vertex_next: wp.array[wp.int32],  # [vertex_capacity]
    corner_range: wp.array[wp.vec2i],  # [shape_count]
    corner_ends: wp.array[wp.int32],  # [shape_count] inclusive prefix sum of their numbers
    corner_segments: wp.array[wp.vec2i],  # [vertex_capacity] what it hangs on, and the second or the same
    corner_place: wp.array[wp.vec4],  # [vertex_capacity] along, share, angle, radius
    # Out:
    corner_shape: wp.array[wp.int32],  # [vertex_capacity]
    corner: wp.array[wp.vec2],  # [vertex_capacity] px
):
    """Compute the positions of corners. One thread a corner; those beyond the last stay as they are."""
    i = offset + wp.tid()
    shapes = corner_ends.shape[0]
    shape = find_range(corner_ends, shapes, i)
    if shape >= shapes:
        return
    if i >= corner_range[shape][1]:
        return
    before = corner_segments[i][0]
    after = corner_segments[i][1]
    place = corner_place[i]
    t = wp.vec2(1.0, 0.0)
    rotation = place[2]
    radius = place[3]
    if after != constants.NONE:
        t = segment_direction(vertex, vertex_next, before)
        if after != before:
            turn = turn_between(t, segment_direction(vertex, vertex_next, after))
            rotation += place[1] * turn
            if radius == constants.MITERED:
                radius = miter_ratio(turn)
    direction = sine_and_cosine(rotation)
    x = direction[1]
    y = direction[0]
    side = (radius * half_width(widths[shape], scale)) * wp.vec2(x * t[0] - y * t[1], y * t[0] + x * t[1])
    at = corner_centre(vertex, vertex_next, before, place[0]) + side
    corner_shape[i] = shape
    corner[i] = wp.vec2(within_reach(at[0]), within_reach(at[1]))


@wp.func
def add_corner_grad(
    i: wp.int32,
    g: wp.vec2,
    vertex: wp.array[wp.vec2],
    vertex_next: wp.array[wp.int32],
    corner: wp.array[wp.vec2],
    corner_segments: wp.array[wp.vec2i],
    corner_place: wp.array[wp.vec4],
    start_grad: wp.array[wp.vec2],
    end_grad: wp.array[wp.vec2],
    segment_grad: wp.array[wp.vec3],
) -> wp.float32:
    """Hand a corner's gradient on to its segments; return that of half the width, times it."""
    before = corner_segments[i][0]
    after = corner_segments[i][1]
    place = corner_place[i]
    along = place[0]
    start_grad[before] = start_grad[before] + (1.0 - along) * g
    if along != 0.0:
        end_grad[before] = end_grad[before] + along * g
        if along != 1.0:
            d = vertex[vertex_next[before]] - vertex[before]
            slide = wp.dot(g, d) / wp.max(wp.length(d), constants.SEGMENT_MIN)
            # Of the angle, of the length, and of what lies before.
            segment_grad[before] = segment_grad[before] - wp.vec3(0.0, slide * along, slide)
    if place[3] == 0.0:
        return 0.0
    side = corner[i] - corner_centre(vertex, vertex_next, before, along)
    outwards = wp.dot(side, g)
    if after != constants.NONE:
        across = side[0] * g[1] - side[1] * g[0]
        second = place[1] * across
        first = across - second
        if place[3] == constants.MITERED:
            t = segment_direction(vertex, vertex_next, before)
            turn = turn_between(t, segment_direction(vertex, vertex_next, after))
            half_turn = sine_and_cosine(0.5 * turn)
            growth = 0.5 * outwards * half_turn[0] / half_turn[1]
            second += growth
            first -= growth
        segment_grad[before] = segment_grad[before] + wp.vec3(first, 0.0, 0.0)
        if after != before:
            segment_grad[after] = segment_grad[after] + wp.vec3(second, 0.0, 0.0)
        else:
            segment_grad[before] = segment_grad[before] + wp.vec3(second, 0.0, 0.0)
    return outwards


@wp.func
def add_segment_grads(
    first: wp.int32,
    last: wp.int32,
    vertex: wp.array[wp.vec2],
    vertex_next: wp.array[wp.int32],
    segment_grad: wp.array[wp.vec3],
    start_grad: wp.array[wp.vec2],
    end_grad: wp.array[wp.vec2],
):
    """Pass gradients of turns and lengths of a contour's segments, vertices [first, last), on to their
    ends.
    """
    behind = float(0.0)
    for k in range(last - first):
        i = last - 1 - k
        if vertex_next[i] != constants.NONE:
            grad = segment_grad[i]
            d = vertex[vertex_next[i]] - vertex[i]
            length = wp.length(d)
            # A shorter one has no direction and counts for no length.
            if length >= constants.SEGMENT_MIN:
                t = d / length
                g = (grad[1] + behind) * t + (grad[0] / length) * wp.vec2(-t[1], t[0])
                start_grad[i] = start_grad[i] - g
                end_grad[i] = end_grad[i] + g
                behind += grad[2]


@wp.kernel
def corners_backward(
    # In:
    offset: wp.int32,
    part: wp.array[wp.int32],  # [shape_count]
    widths: wp.array[wp.float32],  # [shape_count] canvas units
    scale: wp.float32,
    bezier_first: wp.array[wp.int32],  # [shape_count + 1]
    bezier_contour: wp.array[wp.int32],  # [bezier_count]
    contours: wp.array[Contour],  # [contour_count]
    bezier_range: wp.array[wp.vec2i],  # [bezier_count]
    vertex_range: wp.array[wp.vec2i],  # [shape_count]
    vertex: wp.array[wp.vec2],  # [vertex_capacity] px; of the centre lines
    vertex_next: wp.array[wp.int32],  # [vertex_capacity]
    corner_range: wp.array[wp.vec2i],  # [shape_count]
    corner_next: wp.array[wp.int32],  # [vertex_capacity]
    corner: wp.array[wp.vec2],  # [vertex_capacity] px
    corner_segments: wp.array[wp.vec2i],  # [vertex_capacity]
    corner_place: wp.array[wp.vec4],  # [vertex_capacity]
    corner_start_grad: wp.array[wp.vec2],  # [vertex_capacity] of the first end of the edge that starts here
    corner_end_grad: wp.array[wp.vec2],  # [vertex_capacity] of its second end
    # Out:
    segment_grad: wp.array[wp.vec3],  # [vertex_capacity] of turns, of lengths, of the length before; scratch
    start_grad: wp.array[wp.vec2],  # [vertex_capacity] of the first end of the segment that starts here
    end_grad: wp.array[wp.vec2],  # [vertex_capacity] of its second end
    widths_grad: wp.array[wp.float32],  # [shape_count] written
):
    """Pass gradients of the polygons' edges on to centre lines and the width. One thread a shape."""
    shape = offset + wp.tid()
    if part[shape] != constants.STYLED:
        return
    vertices = vertex_range[shape]
    for i in range(vertices[0], vertices[1]):
        start_grad[i] = wp.vec2(0.0, 0.0)
        end_grad[i] = wp.vec2(0.0, 0.0)
        segment_grad[i] = wp.vec3(0.0, 0.0, 0.0)
    outwards = float(0.0)
    corners = corner_range[shape]
    for i in range(corners[0], corners[1]):
        at = int(i)
        g = corner_start_grad[i]
        for _ in range(2):
            outwards += add_corner_grad(
                at,
                g,
                vertex,
                vertex_next,
                corner,
                corner_segments,
                corner_place,
                start_grad,
                end_grad,
                segment_grad,
            )
            at = corner_next[i]
            g = corner_end_grad[i]
    widths_grad[shape] = 0.5 * scale * outwards / wp.max(half_width(widths[shape], scale), TINY)
    if vertices[1] > vertices[0]:
        last = vertices[1]
        bezier = bezier_first[shape + 1]
        while bezier > bezier_first[shape]:
            bezier = contours[bezier_contour[bezier - 1]].bezier
            first = vertices[0] + bezier_range[bezier][0]
            add_segment_grads(first, last, vertex, vertex_next, segment_grad, start_grad, end_grad)
            last = first
