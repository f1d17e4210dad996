"""Shapes -> polylines, and the adjoint.

Béziers are drawn as cubics, whatever the basis. A cubic is split into n equal steps of t; its vertices lie
beside it so that the polyline is on either side of the curve in turn (``bezier.fair_weights``) and leaves it
by at most max |B''| / (12 n^2), where |B''| is at most 6 times the larger second difference of its control
points (Sederberg, Computer Aided Geometric Design, 10.6). Where two Béziers meet, the vertex is half-way
between what either asks for; a chain's ends lie on the curve. The n is taken as a constant by the adjoint.
"""

import warp as wp

from warpsplat.kernels import constants
from warpsplat.kernels.bezier import bezier_points, control_points, cubic_weights, fair_weights, point_weight

wp.set_module_options(constants.MODULE_OPTIONS)

FILL = wp.constant(constants.FILL)
REACH_MAX = wp.constant(constants.REACH_MAX)
FLATNESS = wp.constant(constants.FLATNESS)
FLATNESS_STROKE = wp.constant(constants.FLATNESS_STROKE)
CUBIC = wp.constant(constants.CUBIC)
PIECES_MIN_SPLINE = wp.constant(constants.PIECES_MIN_SPLINE)
PIECES_MIN = wp.constant(constants.PIECES_MIN)
PIECES_MAX = wp.constant(constants.PIECES_MAX)


@wp.kernel
def plan_outline(
    # In:
    offset: wp.int32,
    points: wp.array[wp.vec2],  # [point_count] canvas units
    kind: wp.array[wp.int32],  # [shape_count] FILL or STROKE
    basis: wp.array[wp.int32],  # [shape_count] CUBIC or SPLINE
    point_first: wp.array[wp.int32],  # [shape_count + 1] first control point
    bezier_first: wp.array[wp.int32],  # [shape_count + 1] first Bézier
    scale: wp.float32,  # render pixels per canvas unit
    slack: wp.float32,  # over FLATNESS
    # Out:
    bezier_vertex: wp.array[wp.int32],  # [bezier_count] first vertex of each Bézier, counted in its shape
    bezier_pieces: wp.array[wp.int32],  # [bezier_count] straight pieces
    vertex_count: wp.array[wp.int32],  # [shape_count] a stroke has one more than pieces
):
    """Pieces of each Bézier, one thread a shape: the polyline is slack x FLATNESS px off it at most."""
    shape = offset + wp.tid()
    flatness = FLATNESS
    if kind[shape] != FILL:
        flatness = FLATNESS_STROKE
    flatness *= slack
    least = PIECES_MIN
    if basis[shape] != CUBIC:
        least = PIECES_MIN_SPLINE
    first = point_first[shape]
    count = point_first[shape + 1] - first
    vertices = int(0)
    for bezier in range(bezier_first[shape], bezier_first[shape + 1]):
        p = bezier_points(points, kind[shape], basis[shape], first, count, bezier - bezier_first[shape])
        worst = wp.max(wp.length(p[0] - 2.0 * p[1] + p[2]), wp.length(p[1] - 2.0 * p[2] + p[3]))
        wanted = wp.ceil(wp.sqrt(0.5 * scale * worst / flatness))
        pieces = wp.clamp(int(wp.min(wanted, 1.0e6)), least, PIECES_MAX)
        bezier_vertex[bezier] = vertices
        bezier_pieces[bezier] = pieces
        vertices += pieces
    if kind[shape] != FILL:
        vertices += 1
    vertex_count[shape] = vertices


@wp.func
def within_reach(x: wp.float32) -> wp.float32:
    """A coordinate that kernels may turn into an int: a file may hold any number."""
    if not wp.isfinite(x):
        return 0.0
    return wp.clamp(x, -REACH_MAX, REACH_MAX)


@wp.func
def weighted(p: control_points, w: wp.vec4) -> wp.vec2:
    """Sum of a cubic's control points by weight."""
    return w[0] * p[0] + w[1] * p[1] + w[2] * p[2] + w[3] * p[3]


@wp.kernel
def outline_forward(
    # In:
    offset: wp.int32,
    points: wp.array[wp.vec2],  # [point_count] canvas units
    widths: wp.array[wp.float32],  # [shape_count] canvas units; of fills not read
    kind: wp.array[wp.int32],  # [shape_count]
    basis: wp.array[wp.int32],  # [shape_count]
    point_first: wp.array[wp.int32],  # [shape_count + 1]
    bezier_first: wp.array[wp.int32],  # [shape_count + 1]
    bezier_shape: wp.array[wp.int32],  # [bezier_count]
    scale: wp.float32,
    vertex_first: wp.array[wp.int32],  # [shape_count]
    vertex_last: wp.array[wp.int32],  # [shape_count]
    bezier_vertex: wp.array[wp.int32],  # [bezier_count]
    bezier_pieces: wp.array[wp.int32],  # [bezier_count]
    # Out:
    vertex_shape: wp.array[wp.int32],  # [vertex_capacity] those beyond the last shape's are left as they are
    vertex: wp.array[wp.vec2],  # [vertex_capacity] px
    extent: wp.array[wp.vec2],  # [vertex_capacity] px; how far the shape may reach beyond the vertex
):
    """One thread a Bézier: the vertices at k / n of it, its end being the next one's, but for the last's."""
    bezier = offset + wp.tid()
    shape = bezier_shape[bezier]
    if vertex_last[shape] == vertex_first[shape]:
        return
    first = point_first[shape]
    point_count = point_first[shape + 1] - first
    local = bezier - bezier_first[shape]
    p = scale * bezier_points(points, kind[shape], basis[shape], first, point_count, local)
    base = vertex_first[shape] + bezier_vertex[bezier]
    pieces = bezier_pieces[bezier]
    count = pieces
    reach = float(0.0)
    if kind[shape] != FILL:
        reach = wp.min(0.5 * scale * widths[shape], REACH_MAX) + 1.0
        if bezier + 1 == bezier_first[shape + 1]:
            count += 1
    for k in range(count):
        t = float(k) / float(pieces)
        position = weighted(p, fair_weights(t, pieces))
        if kind[shape] != FILL and (k == pieces or (k == 0 and local == 0)):
            position = weighted(p, cubic_weights(t))
        elif k == 0:
            before = bezier - 1
            if local == 0:
                before = bezier_first[shape + 1] - 1
            q = scale * bezier_points(
                points, kind[shape], basis[shape], first, point_count, before - bezier_first[shape]
            )
            position = 0.5 * (position + weighted(q, fair_weights(1.0, bezier_pieces[before])))
        vertex_shape[base + k] = shape
        vertex[base + k] = wp.vec2(within_reach(position[0]), within_reach(position[1]))
        extent[base + k] = wp.vec2(reach, reach)


@wp.kernel
def outline_backward(
    # In:
    offset: wp.int32,
    kind: wp.array[wp.int32],  # [shape_count]
    basis: wp.array[wp.int32],  # [shape_count]
    point_first: wp.array[wp.int32],  # [shape_count + 1]
    point_shape: wp.array[wp.int32],  # [point_count]
    bezier_first: wp.array[wp.int32],  # [shape_count + 1]
    scale: wp.float32,
    vertex_first: wp.array[wp.int32],  # [shape_count]
    vertex_last: wp.array[wp.int32],  # [shape_count]
    bezier_vertex: wp.array[wp.int32],  # [bezier_count]
    bezier_pieces: wp.array[wp.int32],  # [bezier_count]
    start_grad: wp.array[
        wp.vec2
    ],  # [vertex_capacity] of the first vertex of the edge that starts at a vertex
    end_grad: wp.array[wp.vec2],  # [vertex_capacity] of the second vertex of that edge
    # Out:
    points_grad: wp.array[wp.vec2],  # [point_count] written
):
    """A gather, one thread a control point: its weights in its Béziers x the gradients of their vertices."""
    point = offset + wp.tid()
    shape = point_shape[point]
    total = wp.vec2(0.0, 0.0)
    if vertex_last[shape] > vertex_first[shape]:
        ring = kind[shape] == FILL
        first = point_first[shape]
        index = point - first
        count = point_first[shape + 1] - first
        beziers = bezier_first[shape + 1] - bezier_first[shape]
        # The last Bézier that the point belongs to, which number it has there, and how those change for the
        # Béziers before: the point may end a cubic, and belongs to three quadratics.
        latest = index / 3
        j = index % 3
        step = int(3)
        if basis[shape] != CUBIC:
            latest = index
            j = int(0)
            step = 1
            if ring:
                latest = index + 1
        while j <= 3 and (step == 3 or j <= 2):
            local = latest
            if ring:
                local = (latest + beziers) % beziers
            if local >= 0 and local < beziers:
                bezier = bezier_first[shape] + local
                base = vertex_first[shape] + bezier_vertex[bezier]
                pieces = bezier_pieces[bezier]
                last = base + pieces
                if ring and last == vertex_last[shape]:
                    last = vertex_first[shape]
                if ring or local > 0:
                    previous = base - 1
                    if local == 0:
                        previous = vertex_last[shape] - 1
                    w = fair_weights(0.0, pieces)
                    total += (0.5 * point_weight(kind[shape], basis[shape], count, local, j, w)) * (
                        start_grad[base] + end_grad[previous]
                    )
                else:
                    w = cubic_weights(0.0)
                    total += point_weight(kind[shape], basis[shape], count, local, j, w) * start_grad[base]
                for k in range(1, pieces):
                    w = fair_weights(float(k) / float(pieces), pieces)
                    total += point_weight(kind[shape], basis[shape], count, local, j, w) * (
                        start_grad[base + k] + end_grad[base + k - 1]
                    )
                end = end_grad[base + pieces - 1]
                if ring or local + 1 < beziers:
                    w = fair_weights(1.0, pieces)
                    total += (0.5 * point_weight(kind[shape], basis[shape], count, local, j, w)) * (
                        start_grad[last] + end
                    )
                else:
                    w = cubic_weights(1.0)
                    total += point_weight(kind[shape], basis[shape], count, local, j, w) * end
            latest -= 1
            j += step
    points_grad[point] = scale * total
