"""Fills -> grid positions, and the adjoint.

A closed outline is a strip between its two chains: row ``r`` lies at the fraction ``u_r`` of the way from
chain 0 to chain 1 (paper eq. 4). Both chains have as many cubics.
"""

import warp as wp

from warpsplat.kernels import constants
from warpsplat.kernels.bezier import cross, cubic_weights
from warpsplat.paper import constants as paper
from warpsplat.paper.kernels.strips import Place, ShapeGrid, make_grid_forward

wp.set_module_options(constants.MODULE_OPTIONS)


@wp.func
def ring_index(chain: wp.int32, i: wp.int32, point_count: wp.int32) -> wp.int32:
    """Return the index of control point ``i`` of a chain in the outline's ring, and the reverse: chain 0 runs
    forwards from point 0, chain 1 backwards; both end in the middle of the ring.
    """
    if chain == 0:
        return i
    return (point_count - i) % point_count


@wp.func
def segment_at(t: wp.float32, segment_count: wp.int32) -> wp.int32:
    """Return the segment that holds parameter ``t`` in [0, segment_count] of a chain."""
    return wp.clamp(int(wp.floor(t)), 0, segment_count - 1)


@wp.func
def chain_cubics(point_first: wp.array[wp.int32], shape: wp.int32) -> wp.int32:
    """Cubics in each of the two chains of a closed outline."""
    return (point_first[shape + 1] - point_first[shape]) / 6


@wp.func
def chain_point(
    points: wp.array[wp.vec2], start: wp.int32, chain: wp.int32, t: wp.float32, cubics: wp.int32
) -> wp.vec2:
    """Point at ``t`` in [0, cubics] of a chain of the outline from ``start``, canvas units (paper eq. 1)."""
    segment = segment_at(t, cubics)
    weights = cubic_weights(t - float(segment))
    position = wp.vec2(0.0, 0.0)
    for j in range(4):
        position += weights[j] * points[start + ring_index(chain, 3 * segment + j, 6 * cubics)]
    return position


@wp.func
def measure_strip(points: wp.array[wp.vec2], start: wp.int32, cubics: wp.int32, scale: wp.float32) -> wp.vec3:
    """Return the length of the longer chain of an outline, the mean width of the strip between its chains,
    and twice its signed area.
    """
    count = paper.PLAN_SAMPLES * cubics
    a0 = scale * points[start]
    b0 = a0
    length_a = float(0.0)
    length_b = float(0.0)
    width = float(0.0)
    doubled_area = float(0.0)
    for i in range(1, count + 1):
        t = float(i) / float(paper.PLAN_SAMPLES)
        a1 = scale * chain_point(points, start, 0, t, cubics)
        b1 = scale * chain_point(points, start, 1, t, cubics)
        length_a += wp.length(a1 - a0)
        length_b += wp.length(b1 - b0)
        width += wp.length(a1 - b1)
        doubled_area += cross(a0, a1) - cross(b0, b1)
        a0 = a1
        b0 = b1
    return wp.vec3(wp.max(length_a, length_b), width / float(count), doubled_area)


@wp.func
def fill_position(points: wp.array[wp.vec2], p: Place, grid: ShapeGrid) -> wp.vec2:
    """X(r, k) = (1 - u_r) B0(t_k) + u_r B1(t_k) (paper eq. 4 and 5), t_k at the middle of its cell."""
    cubics = p.count / 6
    t = (float(p.station) + 0.5) * float(cubics) / float(grid.stations)
    a = chain_point(points, p.start, 0, t, cubics)
    b = chain_point(points, p.start, 1, t, cubics)
    return (1.0 - p.u) * a + p.u * b


fill_grid_forward = make_grid_forward("fill_grid_forward", constants.FILL, fill_position)


@wp.kernel
def fill_stations_backward(
    # In:
    offset: wp.int32,
    kind: wp.array[wp.int32],  # [shape_count]
    scale: wp.float32,
    gaussian_shape: wp.array[wp.int32],  # [gaussian_capacity] -1: unused
    gaussian_range: wp.array[wp.vec2i],  # [shape_count]
    shape_grid: wp.array[ShapeGrid],  # [shape_count]
    gaussian_across: wp.array[wp.float32],  # [gaussian_capacity]
    position_grad: wp.array[wp.vec2],  # [gaussian_capacity] of the grid positions
    # Out:
    station_grad: wp.array[wp.vec2],  # [gaussian_capacity] rows 0 and 1 of a shape: of the chains' points
):
    """Sum over a station's rows: dL/dB0(t_k) into row 0, dL/dB1(t_k) into row 1 (there are two at least)."""
    i = offset + wp.tid()
    shape = gaussian_shape[i]
    if shape < 0:
        return
    if kind[shape] != constants.FILL:
        return
    stations = shape_grid[shape].stations
    if i - gaussian_range[shape][0] >= stations:
        return
    a_grad = wp.vec2(0.0, 0.0)
    b_grad = wp.vec2(0.0, 0.0)
    for row in range(shape_grid[shape].rows):
        j = i + row * stations
        u = gaussian_across[j]
        a_grad += (1.0 - u) * position_grad[j]
        b_grad += u * position_grad[j]
    station_grad[i] = scale * a_grad
    station_grad[i + stations] = scale * b_grad


@wp.kernel
def fill_points_backward(
    # In:
    offset: wp.int32,
    kind: wp.array[wp.int32],  # [shape_count]
    point_first: wp.array[wp.int32],  # [shape_count + 1]
    point_shape: wp.array[wp.int32],  # [point_count]
    gaussian_range: wp.array[wp.vec2i],  # [shape_count]
    shape_grid: wp.array[ShapeGrid],  # [shape_count]
    station_grad: wp.array[wp.vec2],  # [gaussian_capacity]
    # Out:
    points_grad: wp.array[wp.vec2],  # [point_count] written
):
    """A gather, one thread a control point: the sum over stations of Bernstein weight x station gradient."""
    i = offset + wp.tid()
    shape = point_shape[i]
    if kind[shape] != constants.FILL:
        return
    cubics = chain_cubics(point_first, shape)
    point_count = 6 * cubics
    point = i - point_first[shape]
    total = wp.vec2(0.0, 0.0)
    gaussians = gaussian_range[shape]
    if gaussians[1] > gaussians[0]:
        stations = shape_grid[shape].stations
        for chain in range(2):
            index = ring_index(chain, point, point_count)
            if index <= 3 * cubics:
                for station in range(stations):
                    t = (float(station) + 0.5) * float(cubics) / float(stations)
                    segment = segment_at(t, cubics)
                    if index >= 3 * segment and index <= 3 * segment + 3:
                        weight = cubic_weights(t - float(segment))[index - 3 * segment]
                        total += weight * station_grad[gaussians[0] + chain * stations + station]
    points_grad[i] = total
