"""The walk along a stroke's centre line, from which its polygons are drawn."""

import warp as wp

from warpsplat.kernels import constants
from warpsplat.kernels.bezier import Contour
from warpsplat.kernels.corners import miter_ratio, segment_direction, turn_between
from warpsplat.kernels.coverage.stroke import half_width
from warpsplat.kernels.stroker.caps import put_cap, put_dot
from warpsplat.kernels.stroker.dashes import Pattern, dash_at, pattern_of
from warpsplat.kernels.stroker.joins import NO_GAP, plan_join, put_wedge
from warpsplat.kernels.stroker.polygons import PI, ROOT_TWO, Polygons, Style, put_quadrilateral

wp.set_module_options(constants.MODULE_OPTIONS)

INSIDE = wp.constant(1.0e-6)  # from a segment's ends: where a dash begins or ends is never at one of them


@wp.struct
class Line:
    """Centre lines as polylines."""

    vertex: wp.array[wp.vec2]  # [vertex_capacity] px
    next: wp.array[wp.int32]  # [vertex_capacity] where the segment that starts here ends
    extent: wp.array[wp.vec2]  # [vertex_capacity] px; how far the stroke may reach beyond the vertex


@wp.struct
class Walk:
    """State of a walk along a contour.

    A piece is drawn when its neighbour is known; until then it is pending. Within branches only its fields
    are assigned: for a struct assigned in a branch Warp copies all of it after the branch.
    """

    corner: wp.int32  # number of the next corner of the polygons
    corner_limit: wp.int32  # the contour is cut off behind it
    segment: wp.int32  # of the pending piece, or NONE
    before: wp.int32  # the segment of the piece before it, or NONE
    ends: wp.vec2  # of the pending piece, as shares of its segment
    length: wp.float32  # of the pending piece [px]
    direction: wp.vec2  # of the pending piece
    shared: wp.vec2i  # whether its first corners are shared with the piece before it
    ring: wp.int32  # 1: closed and solid
    first_segment: wp.int32  # of the first piece, or NONE
    first_length: wp.float32  # [px]
    untouched: wp.int32  # 1 until a first step is made
    between_beziers: wp.int32  # 1 where the next joint is one of two Béziers: others are always round
    dash: wp.int32  # index of the dash (even) or gap (odd)
    dash_left: wp.float32  # what is left of it [px]
    postponed: wp.int32  # 1 while in a dash that goes on over the contour's start, drawn at the end
    done: wp.int32  # 1 when that dash is drawn, or there are too many corners


@wp.func
def draw_pending(w: Walk, after: wp.int32, shared_stop: wp.vec2i, out: Polygons) -> wp.int32:
    """Draw the pending piece; return the number of the next corner."""
    return put_quadrilateral(w.corner, w.before, w.segment, after, w.ends, w.shared, shared_stop, out)


@wp.func
def finish_stroke(w: Walk, style: Style, out: Polygons) -> wp.int32:
    """Draw the pending piece as the last one, and a cap; return the number of the next corner."""
    n = draw_pending(w, constants.NONE, wp.vec2i(0, 0), out)
    return put_cap(n, w.segment, w.ends[1], 0.0, style, out)


@wp.func
def join_piece(
    w: Walk,
    segment: wp.int32,
    direction: wp.vec2,
    length: wp.float32,
    line: Line,
    style: Style,
    out: Polygons,
) -> wp.vec3i:
    """Draw the pending piece and its join with one of ``segment``.

    Return the number of the next corner, and whether the latter piece shares its first corners.
    """
    turn = turn_between(w.direction, direction)
    join = wp.where(w.between_beziers != 0, style.join, constants.ROUND)
    plan = plan_join(turn, wp.min(w.length, length), join, style.half, style.miter_limit)
    n = w.corner
    if w.first_segment != constants.NONE or w.ring == 0:
        n = draw_pending(w, segment, wp.vec2i(plan[0], plan[1]), out)
    if plan[2] != NO_GAP:
        n = put_wedge(n, w.segment, segment, turn, style.half, plan[2], out)
    if join == constants.MITER and out.write != 0:
        reach = style.half * miter_ratio(turn)
        if reach <= style.half * style.miter_limit:
            extent = wp.vec2(reach + 1.0, reach + 1.0)
            joint = line.next[w.segment]
            line.extent[joint] = wp.max(line.extent[joint], extent)
            line.extent[segment] = wp.max(line.extent[segment], extent)
    return wp.vec3i(n, plan[0], plan[1])


@wp.func
def walk_segment(
    w: Walk, segment: wp.int32, last_lap: wp.int32, line: Line, style: Style, pattern: Pattern, out: Polygons
) -> Walk:
    """Walk along a segment, from one dash or gap to the next."""
    way = line.vertex[line.next[segment]] - line.vertex[segment]
    length = wp.length(way)
    direction = way / wp.max(length, constants.SEGMENT_MIN)
    gone = float(0.0)
    more = wp.where(length >= constants.SEGMENT_MIN and w.done == 0, 1, 0)
    while more != 0:
        ends = w.dash_left <= length - gone
        step = wp.min(w.dash_left, length - gone)
        if w.dash % 2 == 0 and w.postponed == 0:
            start = float(0.0)
            if w.segment == constants.NONE and w.untouched == 0:
                start = wp.clamp(gone / length, INSIDE, 1.0 - INSIDE)
            if step == 0.0 and w.segment == constants.NONE:
                w.corner = put_dot(w.corner, segment, start, style, out)
            else:
                stop = float(1.0)
                if ends:
                    stop = wp.clamp((gone + step) / length, INSIDE, 1.0 - INSIDE)
                if w.segment != constants.NONE:
                    joined = join_piece(w, segment, direction, step, line, style, out)
                    w.corner = joined[0]
                    w.shared = wp.vec2i(joined[1], joined[2])
                else:
                    w.corner = put_cap(w.corner, segment, start, PI, style, out)
                    w.shared = wp.vec2i(0, 0)
                if w.first_segment == constants.NONE:
                    w.first_segment = segment
                    w.first_length = length
                w.before = w.segment
                w.segment = segment
                w.ends = wp.vec2(start, stop)
                w.length = step
                w.direction = direction
                w.between_beziers = 0
                if ends:
                    w.corner = finish_stroke(w, style, out)
                    w.segment = constants.NONE
        w.untouched = 0
        gone += step
        w.dash_left -= step
        if ends:
            w.postponed = 0
            if last_lap != 0 or w.corner > w.corner_limit:
                w.done = 1
            w.dash += 1
            if pattern.first + 1 + w.dash >= pattern.last:
                w.dash = 0
            w.dash_left = pattern.stretch * pattern.lengths[pattern.first + 1 + w.dash]
        more = wp.where(ends and w.done == 0 and gone < length, 1, 0)
    return w


@wp.func
def walk_contour(
    at: wp.int32,
    contour: Contour,
    base: wp.int32,
    bezier_range: wp.array[wp.vec2i],
    line: Line,
    style: Style,
    pattern: Pattern,
    out: Polygons,
) -> wp.int32:
    """Add the polygons of a contour; return the number of the next corner.

    ``base``: first vertex of the shape. A dash that goes on over the start of a closed contour is one dash,
    drawn at the end; one that is all of the contour has two ends, as in viewers.
    """
    first_bezier = contour.bezier
    last_bezier = contour.bezier + contour.beziers
    w = Walk()
    w.corner = at
    w.corner_limit = at + constants.CORNERS_MAX
    w.segment = constants.NONE
    w.before = constants.NONE
    w.first_segment = constants.NONE
    w.ends = wp.vec2(0.0, 1.0)
    w.untouched = 1
    total = float(0.0)
    for bezier in range(first_bezier, last_bezier):
        for k in range(bezier_range[bezier][0], bezier_range[bezier][1]):
            i = base + k
            length = wp.length(line.vertex[line.next[i]] - line.vertex[i])
            if length >= constants.SEGMENT_MIN:
                total += length
                w.segment = i
                w.length = length
    if w.segment == constants.NONE:
        if pattern.stretch == 0.0:
            return put_dot(at, base + bezier_range[first_bezier][0], 0.0, style, out)
        return at
    # A ring starts with its last segment pending: nothing but the join to the first is drawn of that.
    w.direction = segment_direction(line.vertex, line.next, w.segment)
    w.dash_left = 2.0 * total + 1.0
    laps = int(1)
    if contour.closed != 0 and pattern.stretch == 0.0:
        w.ring = 1
    else:
        w.segment = constants.NONE
    if pattern.stretch != 0.0:
        begin = dash_at(pattern, 0.0)
        w.dash = int(begin[0])
        w.dash_left = begin[1]
        if contour.closed != 0 and w.dash % 2 == 0 and w.dash_left < total:
            if int(dash_at(pattern, total)[0]) % 2 == 0:
                laps = 2
                w.postponed = 1
    first_dash = w.dash
    first_left = w.dash_left
    for lap in range(laps):
        if lap == 1:
            w.dash = first_dash
            w.dash_left = first_left
        for bezier in range(first_bezier, last_bezier):
            w.between_beziers = 1
            for k in range(bezier_range[bezier][0], bezier_range[bezier][1]):
                w = walk_segment(w, base + k, lap, line, style, pattern, out)
    if w.segment == constants.NONE:
        return w.corner
    if w.ring != 0:
        turn = turn_between(w.direction, segment_direction(line.vertex, line.next, w.first_segment))
        shortest = wp.min(w.length, w.first_length)
        plan = plan_join(turn, shortest, style.join, style.half, style.miter_limit)
        return draw_pending(w, w.first_segment, wp.vec2i(plan[0], plan[1]), out)
    return finish_stroke(w, style, out)


@wp.kernel
def walk_strokes(
    # In:
    offset: wp.int32,
    write: wp.int32,  # 0: count only
    part: wp.array[wp.int32],  # [shape_count]
    widths: wp.array[wp.float32],  # [shape_count] canvas units
    scale: wp.float32,
    styles: wp.array[Style],  # [shape_count]
    dash_first: wp.array[wp.int32],  # [patterns + 1] first number of each
    dashes: wp.array[wp.float32],  # [numbers] canvas units: where it begins, dash, gap, dash, gap ...
    bezier_first: wp.array[wp.int32],  # [shape_count + 1]
    bezier_contour: wp.array[wp.int32],  # [bezier_count]
    contours: wp.array[Contour],  # [contour_count]
    bezier_range: wp.array[wp.vec2i],  # [bezier_count]
    vertex_range: wp.array[wp.vec2i],  # [shape_count]
    vertex: wp.array[wp.vec2],  # [vertex_capacity] px; of the centre lines
    vertex_next: wp.array[wp.int32],  # [vertex_capacity]
    corner_range: wp.array[wp.vec2i],  # [shape_count]
    # Out:
    corner_count: wp.array[wp.int32],  # [shape_count] when counting
    corner_segments: wp.array[wp.vec2i],  # [vertex_capacity] this and what follows when writing
    corner_place: wp.array[wp.vec4],  # [vertex_capacity]
    corner_next: wp.array[wp.int32],  # [vertex_capacity] where the edge that starts here ends
    extent: wp.array[wp.vec2],  # [vertex_capacity] px; how far the stroke may reach beyond the vertex
):
    """Count the corners of a shape's polygons, or write them. One thread a shape."""
    shape = offset + wp.tid()
    if write == 0:
        corner_count[shape] = 0
    vertices = vertex_range[shape]
    if part[shape] != constants.STYLED or vertices[1] == vertices[0]:
        return
    style = styles[shape]
    style.half = half_width(widths[shape], scale)
    first = int(0)
    if write != 0:
        first = corner_range[shape][0]
        if corner_range[shape][1] == first:
            return
        reach = style.half * wp.where(style.cap == constants.SQUARE, ROOT_TWO, 1.0) + 1.0
        for i in range(vertices[0], vertices[1]):
            extent[i] = wp.vec2(reach, reach)
    out = Polygons()
    out.write = write
    out.segments = corner_segments
    out.place = corner_place
    out.next = corner_next
    line = Line()
    line.vertex = vertex
    line.next = vertex_next
    line.extent = extent
    pattern = pattern_of(style.dash, dash_first, dashes, scale)
    n = int(first)
    bezier = bezier_first[shape]
    while bezier < bezier_first[shape + 1] and n - first <= constants.CORNERS_MAX:
        contour = contours[bezier_contour[bezier]]
        n = walk_contour(n, contour, vertices[0], bezier_range, line, style, pattern, out)
        bezier += contour.beziers
    if write == 0:
        corner_count[shape] = n
