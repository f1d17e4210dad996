"""Curves -> grid positions, and the adjoint.

A closed curve is a strip between its two chains: row ``r`` lies at the fraction ``u_r`` of the way from
chain 0 to chain 1 (paper eq. 4). Each segment of an open curve is a strip too, between its two offset
lines at half the stroke width, with half discs at both ends: together they cover what an SVG stroke with
round caps and round joins covers, cusps included.

``u_r = Phi(z_r)`` for equally spaced ``z_r`` in [-reach, reach], Phi the normal cumulative distribution:
rows crowd towards the boundary. ``reach`` puts the outermost row ROW_INSET inside the path.
"""

import warp as wp

from warpsplat.kernels import constants
from warpsplat.kernels.bezier import (
    closed_index,
    cross,
    cubic_tangent_weights,
    cubic_weights,
    find_range,
    local_weight,
    segment_at,
)

wp.set_module_options(constants.MODULE_OPTIONS)

ROW_INSET = wp.constant(constants.ROW_INSET)
ROW_GROWTH = wp.constant(constants.ROW_GROWTH)
COLUMN_SPACING = wp.constant(constants.COLUMN_SPACING)
COLUMN_DENSITY = wp.constant(constants.COLUMN_DENSITY)
COLUMNS_MIN = wp.constant(constants.COLUMNS_MIN)
EPSILON = wp.constant(constants.EPSILON)
SQRT_HALF = wp.constant(0.7071067811865476)
HALF_PI = wp.constant(1.5707963267948966)
PLAN_SAMPLES = wp.constant(6)  # per segment, to measure length and width


@wp.func
def row_plan(width: wp.float32) -> wp.vec2:
    """(row count, reach) for a strip ``width`` [px] wide."""
    # The outermost row at a quarter of the strip at the most: two rows are the least.
    edge = wp.min(ROW_INSET / wp.max(width, EPSILON), 0.25)
    reach = wp.erfinv(1.0 - 2.0 * edge) / SQRT_HALF
    # Near the boundary du = phi(z) dz and u = Phi(z), so the relative step is the hazard rate of the
    # normal distribution times dz; z + 1 / (z + 1) is close to it over the range in use.
    step = ROW_GROWTH / (reach + 1.0 / (reach + 1.0))
    return wp.vec2(wp.max(2.0, wp.ceil(2.0 * reach / step) + 1.0), reach)


@wp.func
def row_position(row: wp.int32, rows: wp.int32, reach: wp.float32) -> wp.float32:
    """Fraction ``u`` in (0, 1) of the way across the strip."""
    z = reach * (2.0 * float(row) / float(rows - 1) - 1.0)
    return 0.5 + 0.5 * wp.erf(z * SQRT_HALF)


@wp.func
def column_plan(length: wp.float32) -> wp.int32:
    """Samples along a curve ``length`` [px] long."""
    count = wp.max(length / COLUMN_SPACING, COLUMN_DENSITY * wp.sqrt(length))
    return wp.max(COLUMNS_MIN, int(wp.ceil(wp.min(count, 1.0e6))))


@wp.func
def cap_plan(rows: wp.int32) -> wp.int32:
    """Columns in each round cap: the rows of one half of the strip, turned by a right angle."""
    return wp.max(1, rows / 2)


@wp.func
def chain_point(
    points: wp.array2d[wp.vec2], curve: wp.int32, chain: wp.int32, t: wp.float32, segment_count: wp.int32
) -> wp.vec2:
    """Point of a closed curve's chain at ``t`` in [0, segment_count], canvas units (paper eq. 1)."""
    segment = segment_at(t, segment_count)
    weights = cubic_weights(t - float(segment))
    position = wp.vec2(0.0, 0.0)
    for j in range(4):
        position += weights[j] * points[curve, closed_index(chain, 3 * segment + j, points.shape[1])]
    return position


@wp.kernel
def plan_closed(
    # In:
    first: wp.int32,
    points: wp.array2d[wp.vec2],  # [curve_count, point_count] canvas units
    scale: wp.float32,  # render pixels per canvas unit
    # Out:
    part_columns: wp.array[wp.int32],  # [part_count]
    part_rows: wp.array[wp.int32],  # [part_count]
    part_reach: wp.array[wp.float32],  # [part_count]
    part_gaussians: wp.array[wp.int32],  # [part_count] columns x rows
    part_sign: wp.array[wp.float32],  # [part_count] 1 or -1, the orientation of the outline
):
    """Grid size from the longer chain and the mean width of the strip."""
    part = first + wp.tid()
    segment_count = points.shape[1] / 6
    count = PLAN_SAMPLES * segment_count
    a0 = scale * points[part, 0]
    b0 = a0
    length_a = float(0.0)
    length_b = float(0.0)
    width = float(0.0)
    doubled_area = float(0.0)
    for i in range(1, count + 1):
        t = float(i) / float(PLAN_SAMPLES)
        a1 = scale * chain_point(points, part, 0, t, segment_count)
        b1 = scale * chain_point(points, part, 1, t, segment_count)
        length_a += wp.length(a1 - a0)
        length_b += wp.length(b1 - b0)
        width += wp.length(a1 - b1)
        doubled_area += cross(a0, a1) - cross(b0, b1)
        a0 = a1
        b0 = b1
    rows = row_plan(width / float(count))
    columns = column_plan(wp.max(length_a, length_b))
    part_columns[part] = columns
    part_rows[part] = int(rows[0])
    part_reach[part] = rows[1]
    part_gaussians[part] = columns * int(rows[0])
    part_sign[part] = wp.sign(doubled_area)


@wp.kernel
def plan_open(
    # In:
    first: wp.int32,
    points: wp.array2d[wp.vec2],  # [curve_count, 3 * segment_count + 1] canvas units
    widths: wp.array[wp.float32],  # [curve_count] canvas units
    opacity_count: wp.int32,
    scale: wp.float32,  # render pixels per canvas unit
    # Out:
    part_columns: wp.array[wp.int32],  # [part_count]
    part_rows: wp.array[wp.int32],  # [part_count]
    part_reach: wp.array[wp.float32],  # [part_count]
    part_gaussians: wp.array[wp.int32],  # [part_count] columns x rows
):
    """Grid size from the stroke's width and its longest segment; the columns include the caps."""
    part = first + wp.tid()
    curve = part / opacity_count
    segment_count = (points.shape[1] - 1) / (3 * opacity_count)
    base = (part % opacity_count) * segment_count
    longest = float(0.0)
    for segment in range(segment_count):
        before = scale * points[curve, 3 * (base + segment)]
        length = float(0.0)
        for i in range(1, PLAN_SAMPLES + 1):
            weights = cubic_weights(float(i) / float(PLAN_SAMPLES))
            here = wp.vec2(0.0, 0.0)
            for j in range(4):
                here += scale * weights[j] * points[curve, 3 * (base + segment) + j]
            length += wp.length(here - before)
            before = here
        longest = wp.max(longest, length)
    rows = row_plan(scale * widths[curve])
    columns = segment_count * (column_plan(longest) + 2 * cap_plan(int(rows[0])))
    part_columns[part] = columns
    part_rows[part] = int(rows[0])
    part_reach[part] = rows[1]
    part_gaussians[part] = columns * int(rows[0])


@wp.kernel
def clip_ranges(
    # In:
    first: wp.int32,
    counts: wp.array[wp.int32],  # [n] entries wanted
    ends: wp.array[wp.int32],  # [n] their inclusive prefix sum
    capacity: wp.int32,
    reverse: wp.int32,  # 1: entry i of the prefix sum belongs to range n - 1 - i
    # Out:
    range_first: wp.array[wp.int32],  # [n]
    range_last: wp.array[wp.int32],  # [n] one past the end; an empty range where the capacity is exceeded
    needed: wp.array[wp.int32],  # [1] the largest total ever asked for
):
    """Prefix sum -> ranges. What does not fit is left out whole and counted, never cut."""
    i = first + wp.tid()
    n = ends.shape[0]
    end = ends[i]
    start = end - counts[i]
    if end > capacity:
        end = start
    index = i
    if reverse == 1:
        index = n - 1 - i
    range_first[index] = start
    range_last[index] = end
    if i == n - 1:
        needed[0] = wp.max(needed[0], ends[i])


@wp.kernel
def points_closed_forward(
    # In:
    first: wp.int32,
    points: wp.array2d[wp.vec2],  # [curve_count, point_count] canvas units
    scale: wp.float32,
    part_ends: wp.array[wp.int32],  # [part_count]
    part_first: wp.array[wp.int32],  # [part_count]
    part_last: wp.array[wp.int32],  # [part_count]
    part_columns: wp.array[wp.int32],  # [part_count]
    part_rows: wp.array[wp.int32],  # [part_count]
    part_reach: wp.array[wp.float32],  # [part_count]
    # Out:
    gaussian_part: wp.array[wp.int32],  # [capacity] -1: unused
    gaussian_across: wp.array[wp.float32],  # [capacity] u of the row
    mean: wp.array[wp.vec2],  # [capacity] px
):
    """X(r, k) = (1 - u_r) B0(t_k) + u_r B1(t_k) (paper eq. 4 and 5), t_k at the middle of its cell."""
    i = first + wp.tid()
    part = find_range(part_ends, part_ends.shape[0], i)
    gaussian_part[i] = -1
    if part >= part_ends.shape[0]:
        return
    if i >= part_last[part]:
        return
    columns = part_columns[part]
    row = (i - part_first[part]) / columns
    column = (i - part_first[part]) % columns
    segment_count = points.shape[1] / 6
    t = (float(column) + 0.5) * float(segment_count) / float(columns)
    u = row_position(row, part_rows[part], part_reach[part])
    a = chain_point(points, part, 0, t, segment_count)
    b = chain_point(points, part, 1, t, segment_count)
    gaussian_part[i] = part
    gaussian_across[i] = u
    mean[i] = scale * ((1.0 - u) * a + u * b)


@wp.kernel
def columns_closed_backward(
    # In:
    first: wp.int32,
    scale: wp.float32,
    gaussian_part: wp.array[wp.int32],  # [capacity]
    gaussian_across: wp.array[wp.float32],  # [capacity]
    part_first: wp.array[wp.int32],  # [part_count]
    part_columns: wp.array[wp.int32],  # [part_count]
    part_rows: wp.array[wp.int32],  # [part_count]
    position_grad: wp.array[wp.vec2],  # [capacity] of the grid positions
    # Out:
    column_grad: wp.array[wp.vec2],  # [capacity] rows 0 and 1 of a part: of the chains' points
):
    """Sum over a column's rows: dL/dB0(t_k) into row 0, dL/dB1(t_k) into row 1 (there are two at least)."""
    i = first + wp.tid()
    part = gaussian_part[i]
    if part < 0:
        return
    columns = part_columns[part]
    if i - part_first[part] >= columns:
        return
    a_grad = wp.vec2(0.0, 0.0)
    b_grad = wp.vec2(0.0, 0.0)
    for row in range(part_rows[part]):
        j = i + row * columns
        u = gaussian_across[j]
        a_grad += (1.0 - u) * position_grad[j]
        b_grad += u * position_grad[j]
    column_grad[i] = scale * a_grad
    column_grad[i + columns] = scale * b_grad


@wp.kernel
def points_closed_backward(
    # In:
    first: wp.int32,
    part_first: wp.array[wp.int32],  # [part_count]
    part_last: wp.array[wp.int32],  # [part_count]
    part_columns: wp.array[wp.int32],  # [part_count]
    column_grad: wp.array[wp.vec2],  # [capacity]
    # Out:
    points_grad: wp.array2d[wp.vec2],  # [curve_count, point_count] written
):
    """A gather, one thread a control point: the sum over columns of Bernstein weight x column gradient."""
    i, point = wp.tid()
    part = first + i
    point_count = points_grad.shape[1]
    segment_count = point_count / 6
    total = wp.vec2(0.0, 0.0)
    if part_last[part] > part_first[part]:
        columns = part_columns[part]
        for chain in range(2):
            index = point
            if chain == 1:
                index = (point_count - point) % point_count
            if index <= 3 * segment_count:
                for column in range(columns):
                    t = (float(column) + 0.5) * float(segment_count) / float(columns)
                    segment = segment_at(t, segment_count)
                    if index >= 3 * segment and index <= 3 * segment + 3:
                        weight = local_weight(cubic_weights(t - float(segment)), segment, index)
                        total += weight * column_grad[part_first[part] + chain * columns + column]
    points_grad[part, point] = total


@wp.func
def open_column(column: wp.int32, columns: wp.int32, rows: wp.int32, width: wp.float32) -> wp.vec3:
    """(t, along, across) of column ``column`` of the ``columns`` of one segment: in a cap ``t`` is 0 or 1 and
    ``along`` the distance beyond that end in half widths; ``across`` shrinks with the cap's circle.
    """
    caps = cap_plan(rows)
    # A cap's last Gaussians stay as far inside the circle as the outermost rows inside the sides.
    radius = wp.max(1.0 - 2.0 * ROW_INSET / wp.max(width, EPSILON), 0.5)
    if column < caps:
        angle = HALF_PI * (float(caps - column) - 0.25) / float(caps)
        return wp.vec3(0.0, -radius * wp.sin(angle), wp.cos(angle))
    if column >= columns - caps:
        angle = HALF_PI * (float(column - (columns - caps) + 1) - 0.25) / float(caps)
        return wp.vec3(1.0, radius * wp.sin(angle), wp.cos(angle))
    body = columns - 2 * caps
    return wp.vec3((float(column - caps) + 0.5) / float(body), 0.0, 1.0)


@wp.func
def unit_tangent(tangent: wp.vec2) -> wp.vec2:
    """``tangent`` / its length; (1, 0) where it has none."""
    length = wp.length(tangent)
    if length < EPSILON:
        return wp.vec2(1.0, 0.0)
    return tangent / length


@wp.func
def weighted_point(
    points: wp.array2d[wp.vec2], curve: wp.int32, point: wp.int32, weights: wp.vec4
) -> wp.vec2:
    """Weighted sum of the four control points from ``point`` on, canvas units."""
    total = wp.vec2(0.0, 0.0)
    for j in range(4):
        total += weights[j] * points[curve, point + j]
    return total


@wp.kernel
def points_open_forward(
    # In:
    first: wp.int32,
    points: wp.array2d[wp.vec2],  # [curve_count, point_count] canvas units
    widths: wp.array[wp.float32],  # [curve_count] canvas units
    opacity_count: wp.int32,
    scale: wp.float32,
    part_ends: wp.array[wp.int32],  # [part_count]
    part_first: wp.array[wp.int32],  # [part_count]
    part_last: wp.array[wp.int32],  # [part_count]
    part_columns: wp.array[wp.int32],  # [part_count]
    part_rows: wp.array[wp.int32],  # [part_count]
    part_reach: wp.array[wp.float32],  # [part_count]
    # Out:
    gaussian_part: wp.array[wp.int32],  # [capacity] -1: unused
    gaussian_across: wp.array[wp.float32],  # [capacity] u of the row
    mean: wp.array[wp.vec2],  # [capacity] px
):
    """X(r, k) = B(t_k) + width / 2 (along_k e_k + across_k (2 u_r - 1) n_k), e the unit tangent, n = e
    turned by a right angle. A tangent of length 0 (coinciding control points) counts as (1, 0).
    """
    i = first + wp.tid()
    part = find_range(part_ends, part_ends.shape[0], i)
    gaussian_part[i] = -1
    if part >= part_ends.shape[0]:
        return
    if i >= part_last[part]:
        return
    columns = part_columns[part]
    rows = part_rows[part]
    row = (i - part_first[part]) / columns
    column = (i - part_first[part]) % columns
    curve = part / opacity_count
    segment_count = (points.shape[1] - 1) / (3 * opacity_count)
    base = (part % opacity_count) * segment_count
    run = columns / segment_count
    place = open_column(column % run, run, rows, scale * widths[curve])
    point = 3 * (base + column / run)
    centre = weighted_point(points, curve, point, cubic_weights(place[0]))
    e = unit_tangent(weighted_point(points, curve, point, cubic_tangent_weights(place[0])))
    u = row_position(row, rows, part_reach[part])
    offset = place[1] * e + place[2] * (2.0 * u - 1.0) * wp.vec2(-e[1], e[0])
    gaussian_part[i] = part
    gaussian_across[i] = u
    mean[i] = scale * (centre + 0.5 * widths[curve] * offset)


@wp.kernel
def columns_open_backward(
    # In:
    first: wp.int32,
    points: wp.array2d[wp.vec2],  # [curve_count, point_count] canvas units
    widths: wp.array[wp.float32],  # [curve_count]
    opacity_count: wp.int32,
    scale: wp.float32,
    gaussian_part: wp.array[wp.int32],  # [capacity]
    gaussian_across: wp.array[wp.float32],  # [capacity]
    part_first: wp.array[wp.int32],  # [part_count]
    part_columns: wp.array[wp.int32],  # [part_count]
    part_rows: wp.array[wp.int32],  # [part_count]
    position_grad: wp.array[wp.vec2],  # [capacity]
    # Out:
    column_grad: wp.array[wp.vec2],  # [capacity] row 0: of B(t_k), row 1: of B'(t_k)
    column_width_grad: wp.array[wp.float32],  # [capacity] row 0: of the width
):
    """With g the gradient of X: dB = sum g; de = w/2 (along g + across v (g_y, -g_x)); through e = d / |d|,
    dd = (de - e (e . de)) / |d|; dwidth = sum g . offset / 2.
    """
    i = first + wp.tid()
    part = gaussian_part[i]
    if part < 0:
        return
    columns = part_columns[part]
    rows = part_rows[part]
    column = i - part_first[part]
    if column >= columns:
        return
    curve = part / opacity_count
    segment_count = (points.shape[1] - 1) / (3 * opacity_count)
    base = (part % opacity_count) * segment_count
    run = columns / segment_count
    place = open_column(column % run, run, rows, scale * widths[curve])
    point = 3 * (base + column / run)
    tangent = weighted_point(points, curve, point, cubic_tangent_weights(place[0]))
    e = unit_tangent(tangent)
    centre_grad = wp.vec2(0.0, 0.0)
    e_grad = wp.vec2(0.0, 0.0)
    width_grad = float(0.0)
    for row in range(rows):
        j = i + row * columns
        g = scale * position_grad[j]
        v = place[2] * (2.0 * gaussian_across[j] - 1.0)
        centre_grad += g
        e_grad += place[1] * g + v * wp.vec2(g[1], -g[0])
        width_grad += wp.dot(g, place[1] * e + v * wp.vec2(-e[1], e[0]))
    e_grad *= 0.5 * widths[curve]
    tangent_grad = wp.vec2(0.0, 0.0)
    length = wp.length(tangent)
    if length >= EPSILON:
        tangent_grad = (e_grad - wp.dot(e, e_grad) * e) / length
    column_grad[i] = centre_grad
    column_grad[i + columns] = tangent_grad
    column_width_grad[i] = 0.5 * width_grad


@wp.kernel
def points_open_backward(
    # In:
    first: wp.int32,
    widths: wp.array[wp.float32],  # [curve_count]
    opacity_count: wp.int32,
    scale: wp.float32,
    part_first: wp.array[wp.int32],  # [part_count]
    part_last: wp.array[wp.int32],  # [part_count]
    part_columns: wp.array[wp.int32],  # [part_count]
    part_rows: wp.array[wp.int32],  # [part_count]
    column_grad: wp.array[wp.vec2],  # [capacity]
    column_width_grad: wp.array[wp.float32],  # [capacity]
    # Out:
    points_grad: wp.array2d[wp.vec2],  # [curve_count, point_count] written
    widths_grad: wp.array[wp.float32],  # [curve_count] written
):
    """A gather, one thread a control point; the thread of point 0 sums the width's gradient too."""
    i, point = wp.tid()
    curve = first + i
    segment_count = (points_grad.shape[1] - 1) / (3 * opacity_count)
    total = wp.vec2(0.0, 0.0)
    width_total = float(0.0)
    for opacity in range(opacity_count):
        part = curve * opacity_count + opacity
        start = part_first[part]
        if part_last[part] > start:
            columns = part_columns[part]
            index = point - 3 * segment_count * opacity
            run = columns / segment_count
            for column in range(columns):
                j = index - 3 * (column / run)
                if j >= 0 and j <= 3:
                    place = open_column(column % run, run, part_rows[part], scale * widths[curve])
                    total += cubic_weights(place[0])[j] * column_grad[start + column]
                    total += cubic_tangent_weights(place[0])[j] * column_grad[start + columns + column]
                if point == 0:
                    width_total += column_width_grad[start + column]
    points_grad[curve, point] = total
    if point == 0:
        widths_grad[curve] = width_total
