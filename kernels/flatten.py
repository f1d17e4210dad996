"""Curves -> polylines, and the adjoint.

A cubic split into n equal steps of t leaves its curve by at most max |B''| / (8 n^2), and |B''| is at most 6
times the larger second difference of its control points (Sederberg, Computer Aided Geometric Design, 10.6).
The n is taken as a constant by the adjoint.
"""

import warp as wp

from warpsplat.kernels import constants
from warpsplat.kernels.bezier import cubic_weights

wp.set_module_options(constants.MODULE_OPTIONS)

REACH_MAX = wp.constant(constants.REACH_MAX)
FLATNESS = wp.constant(constants.FLATNESS)
FLATNESS_STROKE = wp.constant(constants.FLATNESS_STROKE)
PIECES_MIN = wp.constant(constants.PIECES_MIN)
PIECES_MAX = wp.constant(constants.PIECES_MAX)


@wp.kernel
def plan_flatten(
    # In:
    first: wp.int32,
    points: wp.array2d[wp.vec2],  # [curve_count, point_count] canvas units
    closed: wp.int32,
    opacity_count: wp.int32,
    scale: wp.float32,  # render pixels per canvas unit
    # Out:
    cubic_first: wp.array2d[wp.int32],  # [part_count, cubics + 1] first vertex of each cubic in its part
    part_vertices: wp.array[wp.int32],  # [part_count] vertices; an open part has one more than pieces
):
    """Pieces of each cubic, so that the polyline is FLATNESS px from the curve at most."""
    part = first + wp.tid()
    curve = part / opacity_count
    point_count = points.shape[1]
    cubics = point_count / 3 / opacity_count
    flatness = FLATNESS
    if closed == 0:
        flatness = FLATNESS_STROKE
    vertices = int(0)
    for cubic in range(cubics):
        start = 3 * ((part % opacity_count) * cubics + cubic)
        p0 = points[curve, start]
        p1 = points[curve, start + 1]
        p2 = points[curve, start + 2]
        p3 = points[curve, (start + 3) % point_count]
        worst = wp.max(wp.length(p0 - 2.0 * p1 + p2), wp.length(p1 - 2.0 * p2 + p3))
        pieces = wp.ceil(wp.sqrt(0.75 * scale * worst / flatness))
        cubic_first[part, cubic] = vertices
        vertices += wp.clamp(int(wp.min(pieces, 1.0e6)), PIECES_MIN, PIECES_MAX)
    cubic_first[part, cubics] = vertices
    part_vertices[part] = vertices + 1 - closed


@wp.func
def within_reach(x: wp.float32) -> wp.float32:
    """A coordinate that kernels may turn into an int: a file may hold any number."""
    if not wp.isfinite(x):
        return 0.0
    return wp.clamp(x, -REACH_MAX, REACH_MAX)


@wp.kernel
def flatten_forward(
    # In:
    first: wp.int32,
    points: wp.array2d[wp.vec2],  # [curve_count, point_count] canvas units
    widths: wp.array[wp.float32],  # [curve_count] canvas units; 0 for fills
    closed: wp.int32,
    opacity_count: wp.int32,
    scale: wp.float32,
    part_first: wp.array[wp.int32],  # [part_count]
    part_last: wp.array[wp.int32],  # [part_count]
    cubic_first: wp.array2d[wp.int32],  # [part_count, cubics + 1]
    # Out:
    vertex_part: wp.array[wp.int32],  # [capacity] those beyond the last part's are left as they are
    vertex: wp.array[wp.vec2],  # [capacity] px
    extent: wp.array[wp.vec2],  # [capacity] px; how far the shape may reach beyond the vertex
):
    """B(k / n) of a cubic, one thread a part and cubic."""
    i, cubic = wp.tid()
    part = first + i
    if part_last[part] == part_first[part]:
        return
    curve = part / opacity_count
    cubics = cubic_first.shape[1] - 1
    start = 3 * ((part % opacity_count) * cubics + cubic)
    p0 = scale * points[curve, start]
    p1 = scale * points[curve, start + 1]
    p2 = scale * points[curve, start + 2]
    p3 = scale * points[curve, (start + 3) % points.shape[1]]
    reach = float(0.0)
    if closed == 0:
        reach = wp.min(0.5 * scale * widths[curve], REACH_MAX) + 1.0
    base = part_first[part] + cubic_first[part, cubic]
    pieces = cubic_first[part, cubic + 1] - cubic_first[part, cubic]
    count = pieces
    if closed == 0 and cubic == cubics - 1:
        count += 1
    for k in range(count):
        weights = cubic_weights(float(k) / float(pieces))
        vertex_part[base + k] = part
        position = weights[0] * p0 + weights[1] * p1 + weights[2] * p2 + weights[3] * p3
        vertex[base + k] = wp.vec2(within_reach(position[0]), within_reach(position[1]))
        extent[base + k] = wp.vec2(reach, reach)


@wp.kernel
def flatten_backward(
    # In:
    first: wp.int32,
    closed: wp.int32,
    opacity_count: wp.int32,
    scale: wp.float32,
    part_first: wp.array[wp.int32],  # [part_count]
    part_last: wp.array[wp.int32],  # [part_count]
    cubic_first: wp.array2d[wp.int32],  # [part_count, cubics + 1]
    start_grad: wp.array[wp.vec2],  # [capacity] of the first vertex of the edge that starts at a vertex
    end_grad: wp.array[wp.vec2],  # [capacity] of the second vertex of that edge
    # Out:
    points_grad: wp.array2d[wp.vec2],  # [curve_count, point_count] written
):
    """A gather, one thread a control point: Bernstein weights times the gradients of its cubics' vertices."""
    i, point = wp.tid()
    curve = first + i
    cubics = cubic_first.shape[1] - 1
    total = wp.vec2(0.0, 0.0)
    for opacity in range(opacity_count):
        part = curve * opacity_count + opacity
        if part_last[part] > part_first[part]:
            index = point - 3 * opacity * cubics
            for side in range(2):
                # The cubic in which the point is number 0 to 2, and the one before it, which it may end.
                cubic = (index + 3 * cubics) / 3 - cubics - side
                j = index - 3 * cubic
                if closed == 1:
                    cubic = (cubic + cubics) % cubics
                if cubic >= 0 and cubic < cubics and j <= 3:
                    base = part_first[part] + cubic_first[part, cubic]
                    pieces = cubic_first[part, cubic + 1] - cubic_first[part, cubic]
                    # An edge belongs to the cubic in which it lies; its two ends are weighed there.
                    before = cubic_weights(0.0)[j]
                    for k in range(pieces):
                        after = cubic_weights(float(k + 1) / float(pieces))[j]
                        total += before * start_grad[base + k] + after * end_grad[base + k]
                        before = after
    points_grad[curve, point] = scale * total
