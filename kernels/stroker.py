"""Centre lines of strokes -> polygons whose union is the stroke, with caps, joins and dashes (SVG 1.1, 11.4).

A thread walks a shape's centre line. It gives each piece of a segment, from dash end to dash end, a
quadrilateral, each join that quadrilaterals do not make by themselves a wedge between them, each end a cap.
All wind the same way, so that their winding-weighted areas add up to 1 and more where the stroke is, and the
coverage of a fill, clamped, is that of the union. Where polygons overlap within a pixel's edge it would count
twice; so neighbours meet on the line that halves their angle, on the inner side of the turn and, for mitres
and turns that are too small to see, on the outer one too, wherever the pieces are long enough for it. That is
the case where the line bends less than the width: only beyond do their ends overlap. Caps overlap too where a
gap between dashes is shorter than the width: pixels on the border of both are covered too much.
"""

import warp as wp

from warpsplat.kernels import constants
from warpsplat.kernels.corners import miter_ratio, segment_direction, turn_between
from warpsplat.kernels.coverage.stroke import half_width
from warpsplat.kernels.elementary import sine_and_cosine

wp.set_module_options(constants.MODULE_OPTIONS)

HALF_PI = wp.constant(1.5707963267948966)
PI = wp.constant(3.141592653589793)
ROOT_TWO = wp.constant(1.4142135623730951)
ARC_FLATNESS = wp.constant(0.02)  # [px] of chords from their arc
ARC_PIECES_MAX = wp.constant(256)
UNSEEN = wp.constant(0.04)  # [px] a mitre that reaches no further beyond its round join is taken for it
INSIDE = wp.constant(1.0e-6)  # from a segment's ends: where a dash begins or ends is never at one of them
WHOLE = wp.constant(0)  # joins, by what fills the gap: nothing,
BEVELLED = wp.constant(1)  # a triangle,
TIPPED = wp.constant(2)  # a mitre,
ROUNDED = wp.constant(3)  # an arc


@wp.func
def put_corner(
    at: wp.int32,
    write: wp.int32,
    before: wp.int32,
    after: wp.int32,
    place: wp.vec4,
    corner_segments: wp.array[wp.vec2i],
    corner_place: wp.array[wp.vec4],
) -> wp.int32:
    """Add a corner; ``corners`` says what its numbers mean. The number of the next."""
    if write != 0:
        corner_segments[at] = wp.vec2i(before, after)
        corner_place[at] = place
    return at + 1


@wp.func
def close_polygon(first: wp.int32, last: wp.int32, write: wp.int32, corner_next: wp.array[wp.int32]):
    """Link the corners [first, last) to a ring."""
    if write != 0:
        for k in range(first, last - 1):
            corner_next[k] = k + 1
        corner_next[last - 1] = first


@wp.func
def arc_pieces(angle: wp.float32, half: wp.float32) -> wp.int32:
    """Chords of an arc with the radius ``half``."""
    step = 2.0 * wp.sqrt(2.0 * ARC_FLATNESS / wp.max(half, ARC_FLATNESS))
    return wp.clamp(int(wp.ceil(wp.abs(angle) / step)), 1, ARC_PIECES_MAX)


@wp.func
def meet(turn: wp.float32, room: wp.float32, half: wp.float32, join: wp.int32, limit: wp.float32) -> wp.vec3i:
    """How two pieces meet: whether they share their corner on the -90 degrees' side, on the +90 degrees'
    side, and what fills the gap.

    ``room``: how far from the joint their inner corners may be.
    """
    ratio = miter_ratio(turn)
    half_turn = sine_and_cosine(0.5 * turn)
    fits = half * wp.abs(half_turn[0]) <= room * half_turn[1]
    tip = half * (ratio - 1.0) <= UNSEEN
    gap = BEVELLED
    if join == constants.MITER:
        tip = tip or ratio <= limit
        if tip:
            gap = TIPPED
    elif join == constants.ROUND:
        gap = ROUNDED
    if not fits:
        return wp.vec3i(0, 0, gap)
    if tip:
        return wp.vec3i(1, 1, WHOLE)
    if turn > 0.0:
        return wp.vec3i(0, 1, gap)
    return wp.vec3i(1, 0, gap)


@wp.func
def put_wedge(
    at: wp.int32,
    write: wp.int32,
    before: wp.int32,
    after: wp.int32,
    turn: wp.float32,
    half: wp.float32,
    gap: wp.int32,
    corner_segments: wp.array[wp.vec2i],
    corner_place: wp.array[wp.vec4],
    corner_next: wp.array[wp.int32],
) -> wp.int32:
    """Fill the gap on the outer side of a joint."""
    pieces = int(1)
    radius = float(1.0)
    if gap == ROUNDED:
        pieces = arc_pieces(turn, half)
    elif gap == TIPPED:
        pieces = 2
        radius = constants.MITERED
    side = HALF_PI
    if turn > 0.0:
        side = -HALF_PI
    n = put_corner(at, write, before, before, wp.vec4(1.0, 0.0, 0.0, 0.0), corner_segments, corner_place)
    for step in range(pieces + 1):
        k = wp.where(turn > 0.0, step, pieces - step)
        if k == 0:
            place = wp.vec4(1.0, 0.0, side, 1.0)
            n = put_corner(n, write, before, before, place, corner_segments, corner_place)
        elif k == pieces:
            place = wp.vec4(0.0, 0.0, side, 1.0)
            n = put_corner(n, write, after, after, place, corner_segments, corner_place)
        else:
            place = wp.vec4(1.0, float(k) / float(pieces), side, radius)
            n = put_corner(n, write, before, after, place, corner_segments, corner_place)
    close_polygon(at, n, write, corner_next)
    return n


@wp.func
def put_side(
    at: wp.int32,
    write: wp.int32,
    segment: wp.int32,
    along: wp.float32,
    angle: wp.float32,
    shared: wp.int32,
    before: wp.int32,
    after: wp.int32,
    corner_segments: wp.array[wp.vec2i],
    corner_place: wp.array[wp.vec4],
) -> wp.int32:
    """Add a corner of a quadrilateral, shared with the neighbour or not."""
    if shared != 0:
        place = wp.vec4(1.0, 0.5, angle, constants.MITERED)
        return put_corner(at, write, before, after, place, corner_segments, corner_place)
    place = wp.vec4(along, 0.0, angle, 1.0)
    return put_corner(at, write, segment, segment, place, corner_segments, corner_place)


@wp.func
def put_piece(
    at: wp.int32,
    write: wp.int32,
    before: wp.int32,
    segment: wp.int32,
    after: wp.int32,
    start: wp.float32,
    stop: wp.float32,
    shared: wp.vec4i,
    corner_segments: wp.array[wp.vec2i],
    corner_place: wp.array[wp.vec4],
    corner_next: wp.array[wp.int32],
) -> wp.int32:
    """Add the quadrilateral of a piece of ``segment``; ``shared``: both sides of its start, both of its stop.

    Where only one corner of an end is shared, the end has a corner on the centre line as well.
    """
    n = put_side(
        at, write, segment, start, -HALF_PI, shared[0], before, segment, corner_segments, corner_place
    )
    n = put_side(n, write, segment, stop, -HALF_PI, shared[2], segment, after, corner_segments, corner_place)
    if shared[2] != shared[3]:
        n = put_corner(n, write, segment, segment, wp.vec4(1.0, 0.0, 0.0, 0.0), corner_segments, corner_place)
    n = put_side(n, write, segment, stop, HALF_PI, shared[3], segment, after, corner_segments, corner_place)
    n = put_side(n, write, segment, start, HALF_PI, shared[1], before, segment, corner_segments, corner_place)
    if shared[0] != shared[1]:
        n = put_corner(n, write, before, before, wp.vec4(1.0, 0.0, 0.0, 0.0), corner_segments, corner_place)
    close_polygon(at, n, write, corner_next)
    return n


@wp.func
def put_cap(
    at: wp.int32,
    write: wp.int32,
    segment: wp.int32,
    along: wp.float32,
    facing: wp.float32,
    half: wp.float32,
    cap: wp.int32,
    corner_segments: wp.array[wp.vec2i],
    corner_place: wp.array[wp.vec4],
    corner_next: wp.array[wp.int32],
) -> wp.int32:
    """Add a cap; ``facing``: angle from the segment's direction to where it points."""
    if cap == constants.BUTT:
        return at
    pieces = int(3)
    if cap == constants.ROUND:
        pieces = arc_pieces(PI, half)
    n = at
    for k in range(pieces + 1):
        angle = -HALF_PI + PI * float(k) / float(pieces)
        radius = float(1.0)
        if cap != constants.ROUND and (k == 1 or k == 2):  # noqa: PLR1714
            angle = 0.5 * HALF_PI * float(2 * k - 3)
            radius = ROOT_TWO
        place = wp.vec4(along, 0.0, facing + angle, radius)
        n = put_corner(n, write, segment, segment, place, corner_segments, corner_place)
    close_polygon(at, n, write, corner_next)
    return n


@wp.func
def put_dot(
    at: wp.int32,
    write: wp.int32,
    segment: wp.int32,
    along: wp.float32,
    half: wp.float32,
    cap: wp.int32,
    corner_segments: wp.array[wp.vec2i],
    corner_place: wp.array[wp.vec4],
    corner_next: wp.array[wp.int32],
) -> wp.int32:
    """Add what a contour or a dash without length shows: its caps, along the x axis, as viewers have it."""
    if cap == constants.BUTT:
        return at
    pieces = int(4)
    radius = ROOT_TWO
    if cap == constants.ROUND:
        pieces = wp.max(arc_pieces(2.0 * PI, half), 4)
        radius = 1.0
    n = at
    for k in range(pieces):
        place = wp.vec4(along, 0.0, 0.5 * HALF_PI + 2.0 * PI * float(k) / float(pieces), radius)
        n = put_corner(n, write, segment, constants.NONE, place, corner_segments, corner_place)
    close_polygon(at, n, write, corner_next)
    return n


@wp.func
def dash_stretch(
    dashes: wp.array[wp.float32], first: wp.int32, last: wp.int32, scale: wp.float32
) -> wp.float32:
    """Pixels a unit of a pattern; 0 for one without length, which is solid.

    A pattern that is too short to be seen is repeated as one dash and gap in each of its places: its mean is
    the same, and the number of dashes is bounded.
    """
    period = float(0.0)
    for k in range(first + 1, last):
        period += scale * dashes[k]
    if period <= 0.0:
        return 0.0
    return scale * wp.max(wp.ceil(constants.DASH_PERIOD_MIN / period), 1.0)


@wp.func
def dash_at(
    dashes: wp.array[wp.float32],
    first: wp.int32,
    last: wp.int32,
    stretch: wp.float32,
    position: wp.float32,
) -> wp.vec2:
    """Number of the dash (even) or gap (odd) at ``position`` px of a contour, and how far its end is [px]."""
    period = float(0.0)
    for k in range(first + 1, last):
        period += stretch * dashes[k]
    rest = stretch * dashes[first] + position
    rest -= period * wp.floor(rest / period)
    index = int(0)
    entry = stretch * dashes[first + 1]
    # One without length is where it is: it is not passed before the stroke begins.
    while first + 2 + index < last and (rest > entry or (rest == entry and entry > 0.0)):
        rest -= entry
        index += 1
        entry = stretch * dashes[first + 1 + index]
    return wp.vec2(float(index), wp.max(entry - rest, 0.0))


@wp.func
def reach_out(
    write: wp.int32, first: wp.int32, second: wp.int32, reach: wp.float32, extent: wp.array[wp.vec2]
):
    """Let the boxes around two vertices contain a mitre."""
    if write != 0:
        extent[first] = wp.max(extent[first], wp.vec2(reach, reach))
        extent[second] = wp.max(extent[second], wp.vec2(reach, reach))


@wp.func
def walk_contour(
    at: wp.int32,
    write: wp.int32,
    base: wp.int32,
    closed: wp.int32,
    bezier_start: wp.int32,
    bezier_stop: wp.int32,
    bezier_vertex: wp.array[wp.int32],
    bezier_pieces: wp.array[wp.int32],
    vertex: wp.array[wp.vec2],
    vertex_next: wp.array[wp.int32],
    half: wp.float32,
    cap: wp.int32,
    join: wp.int32,
    limit: wp.float32,
    dashes: wp.array[wp.float32],
    dash_start: wp.int32,
    dash_stop: wp.int32,
    stretch: wp.float32,
    corner_segments: wp.array[wp.vec2i],
    corner_place: wp.array[wp.vec4],
    corner_next: wp.array[wp.int32],
    extent: wp.array[wp.vec2],
) -> wp.int32:
    """Add the polygons of a contour, whose vertices start at ``base``; the number of the next corner.

    ``stretch``: 0 for solid ones. A dash that goes on over the start of a closed contour is one dash, drawn
    at the end; one that is all there is of it has two ends, as viewers have it.
    """
    n = int(at)
    length = float(0.0)
    # The last piece that was made and not yet added: its neighbour comes first.
    seg = int(constants.NONE)
    before = int(constants.NONE)
    start = float(0.0)
    stop = float(1.0)
    room = float(0.0)
    t = wp.vec2(0.0, 0.0)
    sides = wp.vec2i(0, 0)
    for bezier in range(bezier_start, bezier_stop):
        for k in range(bezier_pieces[bezier]):
            i = base + bezier_vertex[bezier] + k
            own = wp.length(vertex[vertex_next[i]] - vertex[i])
            if own >= constants.SEGMENT_MIN:
                length += own
                seg = i
                room = own
    if seg == constants.NONE:
        if stretch == 0.0:
            n = put_dot(
                n,
                write,
                base + bezier_vertex[bezier_start],
                0.0,
                half,
                cap,
                corner_segments,
                corner_place,
                corner_next,
            )
        return n
    ring = closed != 0 and stretch == 0.0
    t = segment_direction(vertex, vertex_next, seg)
    first_seg = int(constants.NONE)
    first_room = float(0.0)
    laps = int(1)
    index = int(0)
    left = float(2.0 * length + 1.0)
    passing = int(0)
    if not ring:
        seg = constants.NONE
    if stretch != 0.0:
        begin = dash_at(dashes, dash_start, dash_stop, stretch, 0.0)
        index = int(begin[0])
        left = begin[1]
        end = dash_at(dashes, dash_start, dash_stop, stretch, length)
        if closed != 0 and index % 2 == 0 and left < length and int(end[0]) % 2 == 0:
            laps = 2
            passing = 1
    again = index
    again_left = left
    fresh = int(1)
    corner = int(1)
    done = int(0)
    for lap in range(laps):
        if lap == 1:
            index = again
            left = again_left
        for bezier in range(bezier_start, bezier_stop):
            for k in range(bezier_pieces[bezier]):
                if k == 0:
                    corner = 1
                i = base + bezier_vertex[bezier] + k
                own = wp.length(vertex[vertex_next[i]] - vertex[i])
                gone = float(0.0)
                more = wp.where(own >= constants.SEGMENT_MIN and done == 0, 1, 0)
                direction_here = segment_direction(vertex, vertex_next, i)
                while more != 0:
                    ends = left <= own - gone
                    step = wp.min(left, own - gone)
                    drawn = index % 2 == 0 and passing == 0
                    from_here = float(0.0)
                    if seg == constants.NONE and fresh == 0:
                        from_here = wp.clamp(gone / own, INSIDE, 1.0 - INSIDE)
                    if drawn and step == 0.0 and seg == constants.NONE:
                        n = put_dot(
                            n, write, i, from_here, half, cap, corner_segments, corner_place, corner_next
                        )
                    elif drawn:
                        to_here = float(1.0)
                        if ends:
                            to_here = wp.clamp((gone + step) / own, INSIDE, 1.0 - INSIDE)
                        new_sides = wp.vec2i(0, 0)
                        if seg != constants.NONE:
                            turn = turn_between(t, direction_here)
                            style = wp.where(corner != 0, join, constants.ROUND)
                            met = meet(turn, 0.5 * wp.min(room, step), half, style, limit)
                            new_sides = wp.vec2i(met[0], met[1])
                            if first_seg != constants.NONE or not ring:
                                shared = wp.vec4i(sides[0], sides[1], met[0], met[1])
                                n = put_piece(
                                    n,
                                    write,
                                    before,
                                    seg,
                                    i,
                                    start,
                                    stop,
                                    shared,
                                    corner_segments,
                                    corner_place,
                                    corner_next,
                                )
                            if met[2] != WHOLE:
                                n = put_wedge(
                                    n,
                                    write,
                                    seg,
                                    i,
                                    turn,
                                    half,
                                    met[2],
                                    corner_segments,
                                    corner_place,
                                    corner_next,
                                )
                            if style == constants.MITER:
                                reach = half * miter_ratio(turn)
                                if reach <= half * limit:
                                    reach_out(write, vertex_next[seg], i, reach + 1.0, extent)
                        else:
                            n = put_cap(
                                n,
                                write,
                                i,
                                from_here,
                                PI,
                                half,
                                cap,
                                corner_segments,
                                corner_place,
                                corner_next,
                            )
                        if first_seg == constants.NONE:
                            first_seg = i
                            first_room = own
                        before = seg
                        seg = i
                        start = from_here
                        stop = to_here
                        room = step
                        t = direction_here
                        sides = new_sides
                        corner = 0
                        if ends:
                            shared = wp.vec4i(sides[0], sides[1], 0, 0)
                            n = put_piece(
                                n,
                                write,
                                before,
                                seg,
                                constants.NONE,
                                start,
                                stop,
                                shared,
                                corner_segments,
                                corner_place,
                                corner_next,
                            )
                            n = put_cap(
                                n,
                                write,
                                seg,
                                stop,
                                0.0,
                                half,
                                cap,
                                corner_segments,
                                corner_place,
                                corner_next,
                            )
                            seg = constants.NONE
                    fresh = 0
                    gone += step
                    left -= step
                    if ends:
                        passing = 0
                        if lap == 1 or n - at > constants.CORNERS_MAX:
                            done = 1
                        index += 1
                        if dash_start + 1 + index >= dash_stop:
                            index = 0
                        left = stretch * dashes[dash_start + 1 + index]
                    more = wp.where(ends and done == 0 and gone < own, 1, 0)
    if seg == constants.NONE:
        return n
    if ring:
        turn = turn_between(t, segment_direction(vertex, vertex_next, first_seg))
        met = meet(turn, 0.5 * wp.min(room, first_room), half, join, limit)
        shared = wp.vec4i(sides[0], sides[1], met[0], met[1])
        return put_piece(
            n, write, before, seg, first_seg, start, stop, shared, corner_segments, corner_place, corner_next
        )
    shared = wp.vec4i(sides[0], sides[1], 0, 0)
    n = put_piece(
        n, write, before, seg, constants.NONE, start, stop, shared, corner_segments, corner_place, corner_next
    )
    return put_cap(n, write, seg, 1.0, 0.0, half, cap, corner_segments, corner_place, corner_next)


@wp.kernel
def walk_strokes(
    # In:
    offset: wp.int32,
    write: wp.int32,  # 0: count only
    part: wp.array[wp.int32],  # [shape_count]
    widths: wp.array[wp.float32],  # [shape_count] canvas units
    scale: wp.float32,
    cap: wp.array[wp.int32],  # [shape_count]
    join: wp.array[wp.int32],  # [shape_count]
    miter_limits: wp.array[wp.float32],  # [shape_count]
    dash: wp.array[wp.int32],  # [shape_count] row of the patterns, or NONE
    dash_first: wp.array[wp.int32],  # [patterns + 1] first number of each
    dashes: wp.array[wp.float32],  # [numbers] canvas units: where it begins, dash, gap, dash, gap ...
    bezier_first: wp.array[wp.int32],  # [shape_count + 1]
    bezier_contour: wp.array[wp.int32],  # [bezier_count]
    contour_bezier: wp.array[wp.int32],  # [contour_count + 1]
    contour_closed: wp.array[wp.int32],  # [contour_count]
    bezier_vertex: wp.array[wp.int32],  # [bezier_count]
    bezier_pieces: wp.array[wp.int32],  # [bezier_count]
    vertex_first: wp.array[wp.int32],  # [shape_count]
    vertex_last: wp.array[wp.int32],  # [shape_count]
    vertex: wp.array[wp.vec2],  # [vertex_capacity] px; of the centre lines
    vertex_next: wp.array[wp.int32],  # [vertex_capacity]
    corner_first: wp.array[wp.int32],  # [shape_count]
    corner_last: wp.array[wp.int32],  # [shape_count]
    # Out:
    corner_count: wp.array[wp.int32],  # [shape_count] when counting
    corner_segments: wp.array[wp.vec2i],  # [vertex_capacity] this and what follows when writing
    corner_place: wp.array[wp.vec4],  # [vertex_capacity]
    corner_next: wp.array[wp.int32],  # [vertex_capacity] where the edge that starts here ends
    extent: wp.array[wp.vec2],  # [vertex_capacity] px; how far the stroke may reach beyond the vertex
):
    """One thread a shape: numbers of the corners of its polygons, or the corners."""
    shape = offset + wp.tid()
    if write == 0:
        corner_count[shape] = 0
    if part[shape] != constants.STYLED or vertex_last[shape] == vertex_first[shape]:
        return
    first = int(0)
    half = half_width(widths[shape], scale)
    if write != 0:
        first = corner_first[shape]
        if corner_last[shape] == first:
            return
        reach = half * wp.where(cap[shape] == constants.SQUARE, ROOT_TWO, 1.0) + 1.0
        for i in range(vertex_first[shape], vertex_last[shape]):
            extent[i] = wp.vec2(reach, reach)
    dash_start = int(0)
    dash_stop = int(0)
    stretch = float(0.0)
    if dash[shape] != constants.NONE:
        dash_start = dash_first[dash[shape]]
        dash_stop = dash_first[dash[shape] + 1]
        stretch = dash_stretch(dashes, dash_start, dash_stop, scale)
    n = int(first)
    bezier = bezier_first[shape]
    while bezier < bezier_first[shape + 1] and n - first <= constants.CORNERS_MAX:
        contour = bezier_contour[bezier]
        n = walk_contour(
            n,
            write,
            vertex_first[shape],
            contour_closed[contour],
            bezier,
            contour_bezier[contour + 1],
            bezier_vertex,
            bezier_pieces,
            vertex,
            vertex_next,
            half,
            cap[shape],
            join[shape],
            miter_limits[shape],
            dashes,
            dash_start,
            dash_stop,
            stretch,
            corner_segments,
            corner_place,
            corner_next,
            extent,
        )
        bezier = contour_bezier[contour + 1]
    if write == 0:
        corner_count[shape] = n
