"""Shapes -> polylines, and the adjoint.

Béziers are drawn as cubics, whatever the basis. A cubic is split into n equal steps of t; its vertices lie
beside it so that the polyline is on either side of the curve in turn (``bezier.fair_weights``) and leaves it
by at most max |B''| / (12 n^2), where |B''| is at most 6 times the larger second difference of its control
points (Sederberg, Computer Aided Geometric Design, 10.6). Where two Béziers meet, the vertex is half-way
between what either asks for; a chain's ends lie on the curve. The n is taken as a constant by the adjoint.

Caps and joins stand at right angles to the first and last pieces, whose direction is off the curve's by half
of what it turns within them: the wider a stroke that has such ends, the more pieces.
"""

import warp as wp

from warpsplat.kernels import constants
from warpsplat.kernels.bezier import (
    Contour,
    bezier_points,
    control_points,
    cubic_weights,
    fair_weights,
    point_weight,
)

wp.set_module_options(constants.MODULE_OPTIONS)


@wp.func
def turn_rate(leg: wp.vec2, middle: wp.vec2) -> wp.float32:
    """Return the rate at which a cubic's direction turns with t at an end, |B' x B''| / |B'|^2, from two legs
    of its control polygon, the one at the end first.
    """
    return 2.0 * wp.abs(leg[0] * middle[1] - leg[1] * middle[0]) / wp.max(wp.dot(leg, leg), 1.0e-12)


@wp.kernel
def plan_outline(
    # In:
    offset: wp.int32,
    points: wp.array[wp.vec2],  # [point_count] canvas units
    widths: wp.array[wp.float32],  # [shape_count] canvas units; not read for fills
    kind: wp.array[wp.int32],  # [shape_count] FILL or STROKE
    part: wp.array[wp.int32],  # [shape_count] for STYLED ones the directions at the ends matter
    basis: wp.array[wp.int32],  # [shape_count] CUBIC or SPLINE
    bezier_first: wp.array[wp.int32],  # [shape_count + 1] first Bézier of each shape
    bezier_contour: wp.array[wp.int32],  # [bezier_count]
    contours: wp.array[Contour],  # [contour_count]
    scale: wp.float32,  # render pixels per canvas unit
    slack: wp.float32,  # over FLATNESS
    # Out:
    bezier_range: wp.array[wp.vec2i],  # [bezier_count] its straight pieces, counted in its shape's vertices
    vertex_count: wp.array[wp.int32],  # [shape_count] an open contour has one more than pieces
):
    """Choose the number of pieces of each Bézier: the polyline is at most slack x FLATNESS px off it. One
    thread a shape.
    """
    shape = offset + wp.tid()
    flatness = constants.FLATNESS
    if kind[shape] != constants.FILL:
        flatness = constants.FLATNESS_STROKE
    flatness *= slack
    least = constants.PIECES_MIN
    if basis[shape] != constants.CUBIC:
        least = constants.PIECES_MIN_SPLINE
    vertices = int(0)
    for bezier in range(bezier_first[shape], bezier_first[shape + 1]):
        contour = contours[bezier_contour[bezier]]
        local = bezier - contour.bezier
        p = bezier_points(points, contour, local)
        worst = wp.max(wp.length(p[0] - 2.0 * p[1] + p[2]), wp.length(p[1] - 2.0 * p[2] + p[3]))
        wanted = wp.ceil(wp.sqrt(0.5 * scale * worst / flatness))
        is_last = local + 1 == contour.beziers
        # Splines are smooth but for the ends of open ones.
        if part[shape] == constants.STYLED and (
            basis[shape] == constants.CUBIC or ((local == 0 or is_last) and contour.closed == 0)
        ):
            slant = wp.max(turn_rate(p[1] - p[0], p[2] - p[1]), turn_rate(p[3] - p[2], p[2] - p[1]))
            wanted = wp.max(wanted, 0.25 * scale * widths[shape] * slant / (constants.SLANT * slack))
        pieces = wp.clamp(int(wp.min(wp.ceil(wanted), 1.0e6)), least, constants.PIECES_MAX)
        bezier_range[bezier] = wp.vec2i(vertices, vertices + pieces)
        vertices += pieces
        if is_last and contour.closed == 0:
            vertices += 1
    vertex_count[shape] = vertices


@wp.func
def within_reach(x: wp.float32) -> wp.float32:
    """Clamp a coordinate, which in a file may be any number, to what kernels may convert to an int."""
    if not wp.isfinite(x):
        return 0.0
    return wp.clamp(x, -constants.REACH_MAX, constants.REACH_MAX)


@wp.func
def weighted(p: control_points, w: wp.vec4) -> wp.vec2:
    """Return the weighted sum of a cubic's control points."""
    return w[0] * p[0] + w[1] * p[1] + w[2] * p[2] + w[3] * p[3]


@wp.kernel
def outline_forward(
    # In:
    offset: wp.int32,
    points: wp.array[wp.vec2],  # [point_count] canvas units
    widths: wp.array[wp.float32],  # [shape_count] canvas units; not read for fills
    kind: wp.array[wp.int32],  # [shape_count]
    bezier_contour: wp.array[wp.int32],  # [bezier_count]
    contours: wp.array[Contour],  # [contour_count]
    scale: wp.float32,
    vertex_range: wp.array[wp.vec2i],  # [shape_count]
    bezier_range: wp.array[wp.vec2i],  # [bezier_count]
    # Out:
    vertex_shape: wp.array[wp.int32],  # [vertex_capacity] those beyond the last shape's are left as they are
    vertex_next: wp.array[wp.int32],  # [vertex_capacity] where the edge that starts here ends; NONE: no edge
    vertex: wp.array[wp.vec2],  # [vertex_capacity] px
    extent: wp.array[wp.vec2],  # [vertex_capacity] px; how far the shape may reach beyond the vertex
):
    """Write the vertices at t = k / n of a Bézier; its end is the start of the next, but for the last of an
    open contour. One thread a Bézier.
    """
    bezier = offset + wp.tid()
    contour = contours[bezier_contour[bezier]]
    shape = contour.shape
    vertices = vertex_range[shape]
    if vertices[1] == vertices[0]:
        return
    closed = contour.closed != 0
    local = bezier - contour.bezier
    is_last = local + 1 == contour.beziers
    p = scale * bezier_points(points, contour, local)
    own = bezier_range[bezier]
    base = vertices[0] + own[0]
    pieces = own[1] - own[0]
    count = pieces
    if is_last and not closed:
        count += 1
    reach = float(constants.TILE_MARGIN)
    if kind[shape] != constants.FILL:
        reach = wp.min(0.5 * scale * widths[shape], constants.REACH_MAX) + 1.0
    for k in range(count):
        t = float(k) / float(pieces)
        position = weighted(p, fair_weights(t, pieces))
        if not closed and (k == pieces or (k == 0 and local == 0)):
            position = weighted(p, cubic_weights(t))
        elif k == 0:
            before = local - 1
            if local == 0:
                before = contour.beziers - 1
            q = scale * bezier_points(points, contour, before)
            other = bezier_range[contour.bezier + before]
            position = 0.5 * (position + weighted(q, fair_weights(1.0, other[1] - other[0])))
        vertex_shape[base + k] = shape
        vertex_next[base + k] = base + k + 1
        vertex[base + k] = wp.vec2(within_reach(position[0]), within_reach(position[1]))
        extent[base + k] = wp.vec2(reach, reach)
    if is_last:
        start = vertices[0] + bezier_range[contour.bezier][0]
        if not closed and kind[shape] != constants.FILL:
            start = constants.NONE
        vertex_next[base + count - 1] = start


@wp.kernel
def outline_backward(
    # In:
    offset: wp.int32,
    point_contour: wp.array[wp.int32],  # [point_count]
    contours: wp.array[Contour],  # [contour_count]
    scale: wp.float32,
    vertex_range: wp.array[wp.vec2i],  # [shape_count]
    bezier_range: wp.array[wp.vec2i],  # [bezier_count]
    start_grad: wp.array[wp.vec2],  # [vertex_capacity] of the first end of the edge that starts at a vertex
    end_grad: wp.array[wp.vec2],  # [vertex_capacity] of the second end of that edge; 0 where there is none
    # Out:
    points_grad: wp.array[wp.vec2],  # [point_count] written
):
    """A gather, one thread a control point: its weights in its Béziers x the gradients of their vertices."""
    point = offset + wp.tid()
    contour = contours[point_contour[point]]
    total = wp.vec2(0.0, 0.0)
    vertices = vertex_range[contour.shape]
    if vertices[1] > vertices[0]:
        closed = contour.closed
        beziers = contour.beziers
        index = point - contour.first
        first = vertices[0] + bezier_range[contour.bezier][0]
        # The vertex before the first, by way of the edge that closes the contour.
        last = vertices[0] + bezier_range[contour.bezier + beziers - 1][1] - closed
        # The last Bézier that the point belongs to, which number it has there, and how those change for the
        # Béziers before: the point may end a cubic, and belongs to three quadratics.
        latest = index / 3
        j = index % 3
        step = int(3)
        if contour.basis != constants.CUBIC:
            latest = index + closed
            j = int(0)
            step = 1
        while j <= 3 and (step == 3 or j <= 2):
            local = latest
            if closed != 0:
                local = (latest + beziers) % beziers
            if local >= 0 and local < beziers:
                own = bezier_range[contour.bezier + local]
                pieces = own[1] - own[0]
                for k in range(pieces + 1):
                    v = vertices[0] + own[0] + k
                    if v > last:
                        v = first
                    before = v - 1
                    if v == first:
                        before = last
                    t = float(k) / float(pieces)
                    w = fair_weights(t, pieces)
                    share = float(1.0)
                    if k == 0 or k == pieces:  # noqa: PLR1714  # a kernel knows no sets
                        share = 0.5
                        if closed == 0 and (v == first or v == last):  # noqa: PLR1714, SIM109
                            w = cubic_weights(t)
                            share = 1.0
                    weight = share * point_weight(contour, local, j, w)
                    total += weight * (start_grad[v] + end_grad[before])
            latest -= 1
            j += step
    points_grad[point] = scale * total
