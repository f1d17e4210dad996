"""Shapes -> polylines, and the adjoint.

A cubic split into n equal steps of t leaves its curve by at most max |B''| / (8 n^2), and |B''| is at most 6
times the larger second difference of its control points (Sederberg, Computer Aided Geometric Design, 10.6).
The n is taken as a constant by the adjoint.
"""

import warp as wp

from warpsplat.kernels import constants
from warpsplat.kernels.bezier import cubic_end, cubic_weights

wp.set_module_options(constants.MODULE_OPTIONS)

FILL = wp.constant(constants.FILL)
REACH_MAX = wp.constant(constants.REACH_MAX)
FLATNESS = wp.constant(constants.FLATNESS)
FLATNESS_STROKE = wp.constant(constants.FLATNESS_STROKE)
PIECES_MIN = wp.constant(constants.PIECES_MIN)
PIECES_MAX = wp.constant(constants.PIECES_MAX)


@wp.kernel
def plan_outline(
    # In:
    offset: wp.int32,
    points: wp.array[wp.vec2],  # [point_count] canvas units
    kind: wp.array[wp.int32],  # [shape_count] FILL or STROKE
    point_first: wp.array[wp.int32],  # [shape_count + 1] first control point
    cubic_first: wp.array[wp.int32],  # [shape_count + 1] first cubic
    scale: wp.float32,  # render pixels per canvas unit
    slack: wp.float32,  # over FLATNESS
    # Out:
    cubic_vertex: wp.array[wp.int32],  # [cubic_count] first vertex of each cubic, counted in its shape
    cubic_pieces: wp.array[wp.int32],  # [cubic_count] straight pieces
    vertex_count: wp.array[wp.int32],  # [shape_count] a stroke has one more than pieces
):
    """Pieces of each cubic, one thread a shape: the polyline is slack x FLATNESS px off the curve at most."""
    shape = offset + wp.tid()
    flatness = FLATNESS
    if kind[shape] != FILL:
        flatness = FLATNESS_STROKE
    flatness *= slack
    vertices = int(0)
    for cubic in range(cubic_first[shape], cubic_first[shape + 1]):
        start = point_first[shape] + 3 * (cubic - cubic_first[shape])
        p0 = points[start]
        p1 = points[start + 1]
        p2 = points[start + 2]
        p3 = points[cubic_end(start, point_first, shape)]
        worst = wp.max(wp.length(p0 - 2.0 * p1 + p2), wp.length(p1 - 2.0 * p2 + p3))
        wanted = wp.ceil(wp.sqrt(0.75 * scale * worst / flatness))
        pieces = wp.clamp(int(wp.min(wanted, 1.0e6)), PIECES_MIN, PIECES_MAX)
        cubic_vertex[cubic] = vertices
        cubic_pieces[cubic] = pieces
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


@wp.kernel
def outline_forward(
    # In:
    offset: wp.int32,
    points: wp.array[wp.vec2],  # [point_count] canvas units
    widths: wp.array[wp.float32],  # [shape_count] canvas units; of fills not read
    kind: wp.array[wp.int32],  # [shape_count]
    point_first: wp.array[wp.int32],  # [shape_count + 1]
    cubic_first: wp.array[wp.int32],  # [shape_count + 1]
    cubic_shape: wp.array[wp.int32],  # [cubic_count]
    scale: wp.float32,
    vertex_first: wp.array[wp.int32],  # [shape_count]
    vertex_last: wp.array[wp.int32],  # [shape_count]
    cubic_vertex: wp.array[wp.int32],  # [cubic_count]
    cubic_pieces: wp.array[wp.int32],  # [cubic_count]
    # Out:
    vertex_shape: wp.array[wp.int32],  # [vertex_capacity] those beyond the last shape's are left as they are
    vertex: wp.array[wp.vec2],  # [vertex_capacity] px
    extent: wp.array[wp.vec2],  # [vertex_capacity] px; how far the shape may reach beyond the vertex
):
    """B(k / n), one thread a cubic."""
    cubic = offset + wp.tid()
    shape = cubic_shape[cubic]
    if vertex_last[shape] == vertex_first[shape]:
        return
    start = point_first[shape] + 3 * (cubic - cubic_first[shape])
    p0 = scale * points[start]
    p1 = scale * points[start + 1]
    p2 = scale * points[start + 2]
    p3 = scale * points[cubic_end(start, point_first, shape)]
    base = vertex_first[shape] + cubic_vertex[cubic]
    pieces = cubic_pieces[cubic]
    count = pieces
    reach = float(0.0)
    if kind[shape] != FILL:
        reach = wp.min(0.5 * scale * widths[shape], REACH_MAX) + 1.0
        if cubic + 1 == cubic_first[shape + 1]:
            count += 1
    for k in range(count):
        weights = cubic_weights(float(k) / float(pieces))
        vertex_shape[base + k] = shape
        position = weights[0] * p0 + weights[1] * p1 + weights[2] * p2 + weights[3] * p3
        vertex[base + k] = wp.vec2(within_reach(position[0]), within_reach(position[1]))
        extent[base + k] = wp.vec2(reach, reach)


@wp.kernel
def outline_backward(
    # In:
    offset: wp.int32,
    kind: wp.array[wp.int32],  # [shape_count]
    point_first: wp.array[wp.int32],  # [shape_count + 1]
    point_shape: wp.array[wp.int32],  # [point_count]
    cubic_first: wp.array[wp.int32],  # [shape_count + 1]
    scale: wp.float32,
    vertex_first: wp.array[wp.int32],  # [shape_count]
    vertex_last: wp.array[wp.int32],  # [shape_count]
    cubic_vertex: wp.array[wp.int32],  # [cubic_count]
    cubic_pieces: wp.array[wp.int32],  # [cubic_count]
    start_grad: wp.array[
        wp.vec2
    ],  # [vertex_capacity] of the first vertex of the edge that starts at a vertex
    end_grad: wp.array[wp.vec2],  # [vertex_capacity] of the second vertex of that edge
    # Out:
    points_grad: wp.array[wp.vec2],  # [point_count] written
):
    """A gather, one thread a control point: Bernstein weights times the gradients of its cubics' vertices."""
    point = offset + wp.tid()
    shape = point_shape[point]
    total = wp.vec2(0.0, 0.0)
    if vertex_last[shape] > vertex_first[shape]:
        index = point - point_first[shape]
        cubics = cubic_first[shape + 1] - cubic_first[shape]
        for side in range(2):
            # The cubic in which the point is number 0 to 2, and the one before it, which it may end.
            local = (index + 3 * cubics) / 3 - cubics - side
            j = index - 3 * local
            if kind[shape] == FILL:
                local = (local + cubics) % cubics
            if local >= 0 and local < cubics and j <= 3:
                cubic = cubic_first[shape] + local
                base = vertex_first[shape] + cubic_vertex[cubic]
                pieces = cubic_pieces[cubic]
                # An edge belongs to the cubic in which it lies; its two ends are weighed there.
                before = cubic_weights(0.0)[j]
                for k in range(pieces):
                    after = cubic_weights(float(k + 1) / float(pieces))[j]
                    total += before * start_grad[base + k] + after * end_grad[base + k]
                    before = after
    points_grad[point] = scale * total
