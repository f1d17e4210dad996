"""Strokes -> grid positions, and the adjoint.

Each segment of a stroke is a strip between its two offset lines at half the stroke width, with half discs at
both ends: together they cover what an SVG stroke with round caps and round joins covers, cusps included.
The stations of a segment are a run, without neighbours in the other runs.
"""

import warp as wp

from warpsplat.kernels import constants
from warpsplat.kernels.bezier import cubic_weights
from warpsplat.kernels.elementary import sine_and_cosine
from warpsplat.paper import constants as paper
from warpsplat.paper.kernels.strips import Place, ShapeGrid, make_grid_forward

wp.set_module_options(constants.MODULE_OPTIONS)

HALF_PI = wp.constant(1.5707963267948966)


@wp.func
def cubic_tangent_weights(t: wp.float32) -> wp.vec4:
    """Return the derivatives of ``cubic_weights`` by ``t``; they sum to 0."""
    s = 1.0 - t
    return wp.vec4(-3.0 * s * s, 3.0 * s * s - 6.0 * s * t, 6.0 * s * t - 3.0 * t * t, 3.0 * t * t)


@wp.func
def cap_plan(rows: wp.int32) -> wp.int32:
    """Stations in each round cap: the rows of one half of the strip, turned by a right angle."""
    return wp.max(1, rows / 2)


@wp.func
def longest_segment(
    points: wp.array[wp.vec2], start: wp.int32, segments: wp.int32, scale: wp.float32
) -> wp.float32:
    """Return the length of the longest cubic of a stroke."""
    longest = float(0.0)
    for segment in range(segments):
        before = scale * points[start + 3 * segment]
        length = float(0.0)
        for i in range(1, paper.PLAN_SAMPLES + 1):
            weights = cubic_weights(float(i) / float(paper.PLAN_SAMPLES))
            here = wp.vec2(0.0, 0.0)
            for j in range(4):
                here += scale * weights[j] * points[start + 3 * segment + j]
            length += wp.length(here - before)
            before = here
        longest = wp.max(longest, length)
    return longest


@wp.func
def run_place(station: wp.int32, run: wp.int32, rows: wp.int32, width: wp.float32) -> wp.vec3:
    """(t, along, across) of a station of the ``run`` ones of a segment: in a cap ``t`` is 0 or 1 and
    ``along`` the distance beyond that end in half widths; ``across`` shrinks with the cap's circle.
    """
    caps = cap_plan(rows)
    # A cap's last Gaussians stay as far inside the circle as the outermost rows inside the sides.
    radius = wp.max(1.0 - 2.0 * paper.ROW_INSET / wp.max(width, constants.EPSILON), 0.5)
    if station < caps:
        angle = HALF_PI * (float(caps - station) - 0.25) / float(caps)
        direction = sine_and_cosine(angle)
        return wp.vec3(0.0, -radius * direction[0], direction[1])
    if station >= run - caps:
        angle = HALF_PI * (float(station - (run - caps) + 1) - 0.25) / float(caps)
        direction = sine_and_cosine(angle)
        return wp.vec3(1.0, radius * direction[0], direction[1])
    body = run - 2 * caps
    return wp.vec3((float(station - caps) + 0.5) / float(body), 0.0, 1.0)


@wp.func
def unit_tangent(tangent: wp.vec2) -> wp.vec2:
    """``tangent`` / its length; (1, 0) where it has none."""
    length = wp.length(tangent)
    if length < constants.EPSILON:
        return wp.vec2(1.0, 0.0)
    return tangent / length


@wp.func
def weighted_point(points: wp.array[wp.vec2], point: wp.int32, weights: wp.vec4) -> wp.vec2:
    """Weighted sum of the four control points from ``point`` on, canvas units."""
    total = wp.vec2(0.0, 0.0)
    for j in range(4):
        total += weights[j] * points[point + j]
    return total


@wp.func
def stroke_position(points: wp.array[wp.vec2], p: Place, grid: ShapeGrid) -> wp.vec2:
    """X(r, k) = B(t_k) + width / 2 (along_k e_k + across_k (2 u_r - 1) n_k), e the unit tangent, n = e
    turned by a right angle. A tangent of length 0 (coinciding control points) counts as (1, 0).
    """
    run = grid.stations / grid.runs
    place = run_place(p.station % run, run, grid.rows, p.scale * p.width)
    point = p.start + 3 * (p.station / run)
    e = unit_tangent(weighted_point(points, point, cubic_tangent_weights(place[0])))
    away = place[1] * e + place[2] * (2.0 * p.u - 1.0) * wp.vec2(-e[1], e[0])
    return weighted_point(points, point, cubic_weights(place[0])) + 0.5 * p.width * away


stroke_grid_forward = make_grid_forward("stroke_grid_forward", constants.STROKE, stroke_position)


@wp.kernel
def stroke_stations_backward(
    # In:
    offset: wp.int32,
    points: wp.array[wp.vec2],  # [point_count] canvas units
    widths: wp.array[wp.float32],  # [shape_count]
    kind: wp.array[wp.int32],  # [shape_count]
    point_first: wp.array[wp.int32],  # [shape_count + 1]
    scale: wp.float32,
    gaussian_shape: wp.array[wp.int32],  # [gaussian_capacity] -1: unused
    gaussian_range: wp.array[wp.vec2i],  # [shape_count]
    shape_grid: wp.array[ShapeGrid],  # [shape_count]
    gaussian_across: wp.array[wp.float32],  # [gaussian_capacity]
    position_grad: wp.array[wp.vec2],  # [gaussian_capacity]
    # Out:
    station_grad: wp.array[wp.vec2],  # [gaussian_capacity] row 0: of B(t_k), row 1: of B'(t_k)
    station_width_grad: wp.array[wp.float32],  # [gaussian_capacity] row 0: of the width
):
    """With g the gradient of X: dB = sum g; de = w/2 (along g + across v (g_y, -g_x)); through e = d / |d|,
    dd = (de - e (e . de)) / |d|; dwidth = sum g . offset / 2.
    """
    i = offset + wp.tid()
    shape = gaussian_shape[i]
    if shape < 0:
        return
    if kind[shape] != constants.STROKE:
        return
    grid = shape_grid[shape]
    station = i - gaussian_range[shape][0]
    if station >= grid.stations:
        return
    run = grid.stations / grid.runs
    place = run_place(station % run, run, grid.rows, scale * widths[shape])
    point = point_first[shape] + 3 * (station / run)
    tangent = weighted_point(points, point, cubic_tangent_weights(place[0]))
    e = unit_tangent(tangent)
    centre_grad = wp.vec2(0.0, 0.0)
    e_grad = wp.vec2(0.0, 0.0)
    width_grad = float(0.0)
    for row in range(grid.rows):
        j = i + row * grid.stations
        g = scale * position_grad[j]
        v = place[2] * (2.0 * gaussian_across[j] - 1.0)
        centre_grad += g
        e_grad += place[1] * g + v * wp.vec2(g[1], -g[0])
        width_grad += wp.dot(g, place[1] * e + v * wp.vec2(-e[1], e[0]))
    e_grad *= 0.5 * widths[shape]
    tangent_grad = wp.vec2(0.0, 0.0)
    length = wp.length(tangent)
    if length >= constants.EPSILON:
        tangent_grad = (e_grad - wp.dot(e, e_grad) * e) / length
    station_grad[i] = centre_grad
    station_grad[i + grid.stations] = tangent_grad
    station_width_grad[i] = 0.5 * width_grad


@wp.kernel
def stroke_points_backward(
    # In:
    offset: wp.int32,
    widths: wp.array[wp.float32],  # [shape_count]
    kind: wp.array[wp.int32],  # [shape_count]
    point_first: wp.array[wp.int32],  # [shape_count + 1]
    point_shape: wp.array[wp.int32],  # [point_count]
    scale: wp.float32,
    gaussian_range: wp.array[wp.vec2i],  # [shape_count]
    shape_grid: wp.array[ShapeGrid],  # [shape_count]
    station_grad: wp.array[wp.vec2],  # [gaussian_capacity]
    station_width_grad: wp.array[wp.float32],  # [gaussian_capacity]
    # Out:
    points_grad: wp.array[wp.vec2],  # [point_count] written
    widths_grad: wp.array[wp.float32],  # [shape_count] written
):
    """A gather, one thread a control point; the thread of point 0 sums the width's gradient too."""
    i = offset + wp.tid()
    shape = point_shape[i]
    if kind[shape] != constants.STROKE:
        return
    point = i - point_first[shape]
    gaussians = gaussian_range[shape]
    start = gaussians[0]
    total = wp.vec2(0.0, 0.0)
    width_total = float(0.0)
    if gaussians[1] > start:
        grid = shape_grid[shape]
        run = grid.stations / grid.runs
        for station in range(grid.stations):
            j = point - 3 * (station / run)
            if j >= 0 and j <= 3:
                place = run_place(station % run, run, grid.rows, scale * widths[shape])
                total += cubic_weights(place[0])[j] * station_grad[start + station]
                total += cubic_tangent_weights(place[0])[j] * station_grad[start + grid.stations + station]
            if point == 0:
                width_total += station_width_grad[start + station]
    points_grad[i] = total
    if point == 0:
        widths_grad[shape] = width_total
