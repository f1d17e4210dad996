"""Curves -> polylines, and the adjoint.

A cubic split into n equal steps of t leaves its curve by at most max |B''| / (8 n^2), and |B''| is at most 6
times the larger second difference of its control points (Sederberg, Computer Aided Geometric Design, 10.6).
All cubics of a curve get the n of its worst one. The n is taken as a constant by the adjoint.
"""

import warp as wp

from warpsplat.kernels import constants
from warpsplat.kernels.bezier import cubic_weights, find_range

wp.set_module_options(constants.MODULE_OPTIONS)

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
    part_pieces: wp.array[wp.int32],  # [part_count] straight pieces a cubic
    part_vertices: wp.array[wp.int32],  # [part_count] vertices; an open part has one more than pieces
):
    """Pieces from the second differences, so that the polyline is FLATNESS px from the curve at most."""
    part = first + wp.tid()
    curve = part / opacity_count
    point_count = points.shape[1]
    cubics = point_count / 3 / opacity_count
    base = (part % opacity_count) * cubics
    worst = float(0.0)
    for cubic in range(base, base + cubics):
        p1 = points[curve, 3 * cubic + 1]
        p2 = points[curve, 3 * cubic + 2]
        p3 = points[curve, (3 * cubic + 3) % point_count]
        worst = wp.max(worst, wp.length(points[curve, 3 * cubic] - 2.0 * p1 + p2))
        worst = wp.max(worst, wp.length(p1 - 2.0 * p2 + p3))
    flatness = FLATNESS
    if closed == 0:
        flatness = FLATNESS_STROKE
    pieces = wp.ceil(wp.sqrt(0.75 * scale * worst / flatness))
    count = wp.clamp(int(wp.min(pieces, 1.0e6)), PIECES_MIN, PIECES_MAX)
    part_pieces[part] = count
    part_vertices[part] = cubics * count + 1 - closed


@wp.kernel
def flatten_forward(
    # In:
    first: wp.int32,
    points: wp.array2d[wp.vec2],  # [curve_count, point_count] canvas units
    widths: wp.array[wp.float32],  # [curve_count] canvas units; 0 for fills
    closed: wp.int32,
    opacity_count: wp.int32,
    scale: wp.float32,
    part_ends: wp.array[wp.int32],  # [part_count]
    part_first: wp.array[wp.int32],  # [part_count]
    part_last: wp.array[wp.int32],  # [part_count]
    part_pieces: wp.array[wp.int32],  # [part_count]
    # Out:
    vertex_part: wp.array[wp.int32],  # [capacity] -1: unused
    vertex: wp.array[wp.vec2],  # [capacity] px
    extent: wp.array[wp.vec2],  # [capacity] px; how far the shape may reach beyond the vertex
):
    """B(k / n) of each cubic of a part, in order."""
    i = first + wp.tid()
    part = find_range(part_ends, part_ends.shape[0], i)
    vertex_part[i] = -1
    if part >= part_ends.shape[0]:
        return
    if i >= part_last[part]:
        return
    curve = part / opacity_count
    point_count = points.shape[1]
    cubics = point_count / 3 / opacity_count
    pieces = part_pieces[part]
    local = i - part_first[part]
    cubic = wp.min(local / pieces, cubics - 1)
    t = float(local - cubic * pieces) / float(pieces)
    weights = cubic_weights(t)
    position = wp.vec2(0.0, 0.0)
    start = 3 * ((part % opacity_count) * cubics + cubic)
    for j in range(4):
        position += weights[j] * points[curve, (start + j) % point_count]
    vertex_part[i] = part
    vertex[i] = scale * position
    reach = float(0.0)
    if closed == 0:
        reach = 0.5 * scale * widths[curve] + 1.0
    extent[i] = wp.vec2(reach, reach)


@wp.kernel
def flatten_backward(
    # In:
    first: wp.int32,
    closed: wp.int32,
    opacity_count: wp.int32,
    scale: wp.float32,
    part_first: wp.array[wp.int32],  # [part_count]
    part_last: wp.array[wp.int32],  # [part_count]
    part_pieces: wp.array[wp.int32],  # [part_count]
    start_grad: wp.array[wp.vec2],  # [capacity] of the first vertex of the edge that starts at a vertex
    end_grad: wp.array[wp.vec2],  # [capacity] of the second vertex of that edge
    # Out:
    points_grad: wp.array2d[wp.vec2],  # [curve_count, point_count] written
):
    """A gather, one thread a control point: Bernstein weights times the gradients of its cubics' vertices."""
    i, point = wp.tid()
    curve = first + i
    point_count = points_grad.shape[1]
    cubics = point_count / 3 / opacity_count
    total = wp.vec2(0.0, 0.0)
    for opacity in range(opacity_count):
        part = curve * opacity_count + opacity
        start = part_first[part]
        count = part_last[part] - start
        if count > 0:
            pieces = part_pieces[part]
            index = point - 3 * opacity * cubics
            for side in range(2):
                # The cubic in which the point is number 0 to 2, and the one before it, which it may end.
                cubic = (index + 3 * cubics) / 3 - cubics - side
                j = index - 3 * cubic
                if closed == 1:
                    cubic = (cubic + cubics) % cubics
                if cubic >= 0 and cubic < cubics and j <= 3:
                    for k in range(pieces + 1):
                        # An edge belongs to the cubic in which it lies; its two ends are weighed there.
                        t = float(k) / float(pieces)
                        weight = cubic_weights(t)[j]
                        local = cubic * pieces + k
                        if k < pieces:
                            total += weight * start_grad[start + local]
                        if k > 0:
                            total += weight * end_grad[start + local - 1]
    points_grad[curve, point] = scale * total
