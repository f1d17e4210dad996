"""Polylines with a width -> coverage of round strokes, and the adjoint.

A round-capped, round-joined stroke is all that lies within half its width of the centre line, so a pixel
needs the distance d to the nearest segment and no outline: overlaps, loops and cusps are unions of
themselves.
Coverage is the exact area of the pixel's square between two straight lines at h - d and -h - d along the
direction n of the nearest point (h half the width): exact for straight strokes of any angle and width.

Adjoint: moving the nearest segment's ends by v_a, v_b changes d by -n . ((1 - t) v_a + t v_b), t the nearest
point's parameter (which is at a minimum, or at an end). The turning of n is left out: what it takes from a
pixel it gives to the next. With it, gradients agree with central differences by 0.01 px (within .02 for .5 on
strokes thinner than a pixel), but no better by the 0.3 px that optimisers take, and fits end lower or
higher by some five percent.
"""

import functools
from typing import Any

import warp as wp

from warpsplat.kernels import constants
from warpsplat.kernels.coverage.rows import one_tile, tile_row
from warpsplat.kernels.tile import tile_column

wp.set_module_options(constants.MODULE_OPTIONS)

FAR = wp.constant(1.0e15)
TINY = wp.constant(1.0e-12)
FLAT = wp.constant(1.0e-4)
HALF_DIAGONAL = wp.constant(0.70711)  # of a pixel: an edge further away does not cross it
MARGIN = wp.constant(0.02)  # [px] against rounding
BORDER_TOLERANCE = wp.constant(8.0e-5)  # [px] an edge that is so near to a border of pixels lies on it


@wp.func
def half_plane(x: wp.float32, n: wp.vec2) -> wp.float32:
    """Return the area of the unit square centred at 0 where n . p < x, n a unit vector."""
    a = wp.max(wp.abs(n[0]), wp.abs(n[1]))
    b = wp.min(wp.abs(n[0]), wp.abs(n[1]))
    distance = wp.abs(x)
    area = float(0.5)
    if distance >= 0.5 * (a + b):
        area = 0.0
    elif distance <= 0.5 * (a - b) or b < FLAT:
        area = wp.max(0.5 - distance / a, 0.0)
    else:
        rest = 0.5 * (a + b) - distance
        area = rest * rest / (2.0 * a * b)
    if x > 0.0:
        return 1.0 - area
    return area


@wp.func
def is_side(x: wp.float32) -> wp.bool:
    """Return whether an upright or level line at ``x`` is a side of the unit square centred at 0."""
    return wp.abs(wp.abs(x) - 0.5) <= BORDER_TOLERANCE


@wp.func
def half_plane_slope(x: wp.float32, n: wp.vec2) -> wp.float32:
    """Return the derivative of ``half_plane`` by ``x``: the length of the line inside the square; on its side
    the mean of what it is to either side.
    """
    a = wp.max(wp.abs(n[0]), wp.abs(n[1]))
    b = wp.min(wp.abs(n[0]), wp.abs(n[1]))
    distance = wp.abs(x)
    if b < FLAT:
        if is_side(x):
            return 0.5
    if distance >= 0.5 * (a + b):
        return 0.0
    if distance <= 0.5 * (a - b) or b < FLAT:
        return 1.0 / a
    return (0.5 * (a + b) - distance) / (a * b)


@wp.func
def nearest(p: wp.vec2, a: wp.vec2, b: wp.vec2) -> wp.float32:
    """Return the parameter in [0, 1] of the point of segment (a, b) nearest to ``p``."""
    e = b - a
    return wp.clamp(wp.dot(p - a, e) / wp.max(wp.dot(e, e), TINY), 0.0, 1.0)


@wp.func
def direction(r: wp.vec2, length: wp.float32) -> wp.vec2:
    """Return the unit vector of ``r``; any on the centre line itself."""
    if length < 1.0e-6:
        return wp.vec2(1.0, 0.0)
    return r / length


@wp.func
def normal(r: wp.vec2, distance: wp.float32, d: wp.vec2) -> wp.vec2:
    """Return the unit vector of ``r``, of length ``distance``; on the line itself that across ``d``."""
    if distance < 1.0e-6:
        return direction(wp.vec2(-d[1], d[0]), wp.length(d))
    return r / distance


@wp.func
def turn(before: wp.vec2, after: wp.vec2) -> wp.float32:
    """Return the sine of the angle between two segments, 1 for a right angle and more, or where one has no
    length.
    """
    lengths = wp.length(before) * wp.length(after)
    if lengths < TINY or wp.dot(before, after) <= 0.0:
        return 1.0
    return wp.min(wp.abs(before[0] * after[1] - before[1] * after[0]) / lengths + 0.01, 1.0)


@wp.func
def overhang(
    vertex: wp.array[wp.vec2],
    vertex_next: wp.array[wp.int32],
    i: wp.int32,
    first: wp.int32,
    reach: wp.float32,
) -> wp.vec2:
    """Return how far beyond its ends the segment that starts at vertex ``i`` may be nearest to pixels [px].

    A pixel whose nearest point is the joint of two segments lies in the wedge between their normals, hence at
    most the sine of their angle times its distance beyond each of them; at the ends of the stroke are caps.
    ``first``: the shape's first vertex. The angle at the start of a closed contour is ignored.
    """
    e = vertex[vertex_next[i]] - vertex[i]
    start = float(1.0)
    end = float(1.0)
    if i > first:
        if vertex_next[i - 1] == i:
            start = turn(vertex[i] - vertex[i - 1], e)
    following = vertex_next[vertex_next[i]]
    if following != constants.NONE:
        end = turn(e, vertex[following] - vertex[vertex_next[i]])
    return wp.vec2(start * reach + MARGIN, end * reach + MARGIN)


@wp.func
def box_around(a: wp.vec2, e: wp.vec2, length: wp.float32, reach: wp.float32, over: wp.vec2) -> wp.vec4:
    """Return the lowest and highest x and y of the rectangle around the segment from ``a`` along the unit
    vector ``e``.
    """
    start = a - over[0] * e
    end = a + (length + over[1]) * e
    side = reach * wp.vec2(wp.abs(e[1]), wp.abs(e[0]))
    low = wp.min(start, end) - side
    high = wp.max(start, end) + side
    return wp.vec4(low[0], high[0], low[1], high[1])


@wp.func
def short_sides(e: wp.vec2, length: wp.float32, over: wp.vec2) -> wp.vec4:
    """Return where the rectangle's short sides meet the line at a's height, lower x first, and their slope
    dx / dy; relative to a. And 1 / length^2.
    """
    inverse = 1.0 / wp.max(length * length, TINY)
    if wp.abs(e[0]) <= FLAT:
        return wp.vec4(-1.0e8, 1.0e8, 0.0, inverse)
    x0 = -over[0] / e[0]
    x1 = (length + over[1]) / e[0]
    return wp.vec4(wp.min(x0, x1), wp.max(x0, x1), -e[1] / e[0], inverse)


@wp.func
def long_sides(e: wp.vec2, reach: wp.float32) -> wp.vec2:
    """Return half of the chord between the rectangle's long sides, and their slope dx / dy."""
    if wp.abs(e[1]) <= FLAT:
        return wp.vec2(1.0e8, 0.0)
    return wp.vec2(reach / wp.abs(e[1]), e[0] / e[1])


@wp.func
def segment_span(x: wp.float32, dy: wp.float32, ends: wp.vec4, sides: wp.vec2) -> wp.vec2:
    """Return the lowest and highest x of the rectangle at ``dy`` below a, which is at ``x``; low > high where
    there is none.
    """
    low = wp.max(ends[0] + ends[2] * dy, sides[1] * dy - sides[0])
    high = wp.min(ends[1] + ends[2] * dy, sides[1] * dy + sides[0])
    return wp.vec2(x + low - MARGIN, x + high + MARGIN)


@wp.func
def pixels_within(low: wp.float32, high: wp.float32, first: wp.int32, last: wp.int32) -> wp.vec2i:
    """Return the range of pixels of [first, last) with centres between two coordinates, give or take one."""
    start = wp.max(first, int(wp.ceil(wp.clamp(low, -1.0, 1.0e8) - 0.5)))
    return wp.vec2i(start, wp.min(last, int(wp.floor(wp.min(high, 1.0e8) + 0.5))))


@wp.func
def half_width(width: wp.float32, scale: wp.float32) -> wp.float32:
    """Return half a stroke's width [px], clamped to what kernels can hold."""
    return wp.min(0.5 * scale * width, constants.REACH_MAX)


@wp.kernel
def segment_rectangles(
    # In:
    offset: wp.int32,
    part: wp.array[wp.int32],  # [shape_count]
    widths: wp.array[wp.float32],  # [shape_count] canvas units
    scale: wp.float32,
    vertex_shape: wp.array[wp.int32],  # [vertex_capacity]
    vertex_ends: wp.array[wp.int32],  # [shape_count] end of each shape's vertices
    vertex_range: wp.array[wp.vec2i],  # [shape_count]
    vertex_next: wp.array[wp.int32],  # [vertex_capacity] where the segment that starts here ends, or NONE
    vertex: wp.array[wp.vec2],  # [vertex_capacity] px
    # Out:
    segment_box: wp.array[wp.vec4],  # [vertex_capacity] px; lowest and highest x and y; none: highest below
    segment_ends: wp.array[wp.vec4],  # [vertex_capacity] see short_sides
    segment_sides: wp.array[wp.vec2],  # [vertex_capacity] see long_sides
):
    """Find the rectangles of pixels that segments may be nearest to. One thread a segment."""
    i = offset + wp.tid()
    if i >= vertex_ends[vertex_ends.shape[0] - 1]:
        return
    shape = vertex_shape[i]
    if part[shape] != constants.STROKE:
        return
    vertices = vertex_range[shape]
    if i < vertices[0] or i >= vertices[1] or vertex_next[i] == constants.NONE:
        segment_box[i] = wp.vec4(FAR, -FAR, FAR, -FAR)
        return
    reach = half_width(widths[shape], scale) + HALF_DIAGONAL
    a = vertex[i]
    d = vertex[vertex_next[i]] - a
    length = wp.length(d)
    e = direction(d, length)
    over = overhang(vertex, vertex_next, i, vertices[0], reach)
    segment_box[i] = box_around(a, e, length, reach, over)
    segment_ends[i] = short_sides(e, length, over)
    segment_sides[i] = long_sides(e, reach)


@wp.func
def keep_nearest(
    pixels: wp.array2d[wp.float32],
    segment: wp.array2d[wp.int32],
    slot_near: wp.array2d[wp.int32],
    j: wp.int32,
    a: wp.vec2,
    b: wp.vec2,
    ends: wp.vec4,
    sides: wp.vec2,
    reach: wp.float32,
    inside: wp.float32,
    slot: wp.int32,
    lane: wp.int32,
    columns: wp.vec2i,
    rows: wp.vec2i,
    top: wp.int32,
):
    """Store segment ``j`` from ``a`` to ``b`` and reach^2 - distance^2 in the pixels to which it is nearer
    than all segments before it.

    ``ends``, ``sides``: see ``short_sides`` and ``long_sides``. ``columns``: a lane's pixels [first, last) of
    the row of tiles at ``top`` that starts with ``slot``; ``rows``: those of them that the segment reaches.
    Those that have ``inside`` are finished.
    """
    d = b - a
    for y in range(rows[0], rows[1]):
        py = float(y) + 0.5 - a[1]
        span = segment_span(a[0], py, ends, sides)
        xs = pixels_within(span[0], span[1], columns[0], columns[1])
        if xs[0] < xs[1]:
            for s in range(
                slot + (xs[0] - columns[0]) / constants.TILE,
                slot + (xs[1] - 1 - columns[0]) / constants.TILE + 1,
            ):
                slot_near[s, lane] = 1
        for x in range(xs[0], xs[1]):
            s = slot + (x - columns[0]) / constants.TILE
            p = constants.TILE * ((x - columns[0]) % constants.TILE) + y - top
            so_far = pixels[s, p]
            # Well inside the stroke it does not matter which segment is nearest.
            if so_far < inside:
                px = float(x) + 0.5 - a[0]
                t = wp.clamp((px * d[0] + py * d[1]) * ends[3], 0.0, 1.0)
                rx = px - t * d[0]
                ry = py - t * d[1]
                near = reach * reach - rx * rx - ry * ry
                if near > so_far:
                    pixels[s, p] = near
                    segment[s, p] = j


@wp.func
def strip_coverage(centre: wp.vec2, a: wp.vec2, b: wp.vec2, half: wp.float32) -> wp.float32:
    """Return the area of the pixel at ``centre`` within ``half`` of the segment from ``a`` to ``b``."""
    t = nearest(centre, a, b)
    r = centre - (1.0 - t) * a - t * b
    distance = wp.length(r)
    n = normal(r, distance, b - a)
    value = half_plane(half - distance, n)
    if half + distance < HALF_DIAGONAL:
        value += half_plane(half + distance, n) - 1.0
    if wp.min(wp.abs(n[0]), wp.abs(n[1])) < FLAT:
        if is_side(half - distance) or is_side(half + distance):
            value = wp.clamp(value, constants.NEARLY_NONE, constants.NEARLY_ALL)
    return value


@wp.func
def cover_slot(
    pixels: wp.array2d[wp.float32],
    segment: wp.array2d[wp.int32],
    vertex: wp.array[wp.vec2],
    vertex_next: wp.array[wp.int32],
    s: wp.int32,
    left: wp.int32,
    top: wp.int32,
    rows: wp.vec2i,
    half: wp.float32,
    inside: wp.float32,
) -> wp.int32:
    """Turn the distances of a slot's pixels in ``rows`` into coverages; return the state of these pixels."""
    most = float(0.0)
    least = float(1.0)
    columns = int(constants.TILE)  # not unrolled, which takes registers
    for x in range(columns):
        for y in range(rows[0], rows[1]):
            p = constants.TILE * x + y - top
            value = pixels[s, p]
            if value >= inside:
                value = 1.0
                pixels[s, p] = 1.0
            elif value > 0.0:
                j = segment[s, p]
                centre = wp.vec2(float(left + x) + 0.5, float(y) + 0.5)
                value = strip_coverage(centre, vertex[j], vertex[vertex_next[j]], half)
                pixels[s, p] = value
            most = wp.max(most, value)
            least = wp.min(least, value)
    if most <= 0.0:
        return constants.UNCOVERED
    if least < 1.0:
        return constants.PARTIAL
    return constants.COVERED


@functools.cache
def make_forward(column: Any) -> wp.Kernel:
    """Return the kernel that covers strokes, for vectors of type ``column``.

    A thread has a row of tiles; or, where there are many threads, one row of pixels of one tile.
    """
    by_rows = column is not tile_column
    lane_rows = 1 if by_rows else constants.TILE
    own_row = one_tile if by_rows else tile_row

    @wp.kernel(name="stroke_forward", module="unique", module_options=constants.MODULE_OPTIONS)
    def stroke_forward(
        # In:
        offset: wp.int32,
        slot_shape: wp.array[wp.int32],  # [slot_capacity] -1: unused
        slot_range: wp.array[wp.vec2i],  # [shape_count]
        part: wp.array[wp.int32],  # [shape_count]
        widths: wp.array[wp.float32],  # [shape_count] canvas units
        scale: wp.float32,
        shape_tiles: wp.array2d[wp.int32],  # [shape_count, 4]
        vertex_range: wp.array[wp.vec2i],  # [shape_count]
        vertex_next: wp.array[wp.int32],  # [vertex_capacity] where the segment that starts here ends, or NONE
        vertex: wp.array[wp.vec2],  # [vertex_capacity] px
        segment_box: wp.array[wp.vec4],  # [vertex_capacity] px, see segment_rectangles
        segment_ends: wp.array[wp.vec4],  # [vertex_capacity]
        segment_sides: wp.array[wp.vec2],  # [vertex_capacity]
        # Out:
        coverage: wp.array2d[column],  # [slot_capacity, columns] in [0, 1]
        coverage_pixels: wp.array2d[wp.float32],  # [slot_capacity, TILE_PIXELS] the same memory
        segment: wp.array2d[wp.int32],  # [slot_capacity, TILE_PIXELS] nearest segment (its first vertex)
        slot_state: wp.array[wp.int32],  # [slot_capacity] UNCOVERED, PARTIAL or FULL
        slot_near: wp.array2d[wp.int32],  # [slot_capacity, row_lanes] whether a segment is near
    ):
        """Find the nearest segment of each pixel, then coverages. One thread a row of tiles of a shape (that
        of its leftmost slot), or a slot and lane.
        """
        i, lane = wp.tid()
        slot = offset + i
        row = own_row(slot, slot_shape, slot_range, shape_tiles)
        shape = row[0]
        if shape < 0:
            return
        if part[shape] != constants.STROKE:
            return
        half = half_width(widths[shape], scale)
        reach = half + HALF_DIAGONAL
        # What is stored first is reach^2 - distance^2, 0 where nothing is near; from here on a pixel is
        # covered.
        inside = float(FAR)
        if half > HALF_DIAGONAL:
            inside = reach * reach - (half - HALF_DIAGONAL) * (half - HALF_DIAGONAL)
        left = constants.TILE * row[1]
        top = constants.TILE * row[3]
        columns = wp.vec2i(left, left + constants.TILE * row[2])
        rows = wp.vec2i(top + lane * lane_rows, top + (lane + 1) * lane_rows)
        for s in range(slot, slot + row[2]):
            slot_near[s, lane] = 0
            for x in range(constants.TILE):
                if by_rows:
                    coverage_pixels[s, constants.TILE * x + lane] = 0.0
                else:
                    coverage[s, x] = column(0.0)
        vertices = vertex_range[shape]
        for j in range(vertices[0], vertices[1]):
            box = segment_box[j]
            near_rows = pixels_within(box[2], box[3], rows[0], rows[1])
            if near_rows[0] < near_rows[1] and box[0] < float(columns[1]) and box[1] > float(columns[0]):
                keep_nearest(
                    coverage_pixels,
                    segment,
                    slot_near,
                    j,
                    vertex[j],
                    vertex[vertex_next[j]],
                    segment_ends[j],
                    segment_sides[j],
                    reach,
                    inside,
                    slot,
                    lane,
                    columns,
                    near_rows,
                    top,
                )
        for s in range(slot, slot + row[2]):
            state = int(constants.UNCOVERED)
            if slot_near[s, lane] == 1:
                at = left + constants.TILE * (s - slot)
                state = cover_slot(
                    coverage_pixels, segment, vertex, vertex_next, s, at, top, rows, half, inside
                )
            wp.atomic_or(slot_state, s, state)

    return stroke_forward


@wp.kernel
def stroke_backward(
    # In:
    offset: wp.int32,
    width: wp.int32,  # px
    height: wp.int32,  # px
    part: wp.array[wp.int32],  # [shape_count]
    widths: wp.array[wp.float32],  # [shape_count] canvas units
    scale: wp.float32,
    vertex_shape: wp.array[wp.int32],  # [vertex_capacity]
    vertex_ends: wp.array[wp.int32],  # [shape_count] end of each shape's vertices
    vertex_range: wp.array[wp.vec2i],  # [shape_count]
    slot_range: wp.array[wp.vec2i],  # [shape_count]
    slot_state: wp.array[wp.int32],  # [slot_capacity]
    shape_tiles: wp.array2d[wp.int32],  # [shape_count, 4]
    vertex_next: wp.array[wp.int32],  # [vertex_capacity] where the segment that starts here ends, or NONE
    vertex: wp.array[wp.vec2],  # [vertex_capacity] px
    segment_box: wp.array[wp.vec4],  # [vertex_capacity] px, see segment_rectangles
    segment_ends: wp.array[wp.vec4],  # [vertex_capacity]
    segment_sides: wp.array[wp.vec2],  # [vertex_capacity]
    segment: wp.array2d[wp.int32],  # [slot_capacity, TILE_PIXELS]
    sum_grad: wp.array2d[wp.float32],  # [slot_capacity, TILE_PIXELS] 0 where the coverage is 0 or 1
    # Out:
    start_grad: wp.array[wp.vec2],  # [vertex_capacity] of the first end of the segment that starts here
    end_grad: wp.array[wp.vec2],  # [vertex_capacity] of its second end
    half_grad: wp.array[wp.float32],  # [vertex_capacity] of half the width [px]
):
    """Sum over the border pixels whose nearest segment it is. One thread a segment."""
    i = offset + wp.tid()
    if i >= vertex_ends[vertex_ends.shape[0] - 1]:
        return
    shape = vertex_shape[i]
    vertices = vertex_range[shape]
    if part[shape] != constants.STROKE or i < vertices[0] or i >= vertices[1]:
        return
    at_start = wp.vec2(0.0, 0.0)
    at_end = wp.vec2(0.0, 0.0)
    of_half = float(0.0)
    slots = slot_range[shape]
    if slots[1] > slots[0] and vertex_next[i] != constants.NONE:
        half = half_width(widths[shape], scale)
        x0 = shape_tiles[shape, 0]
        y0 = shape_tiles[shape, 1]
        wide = shape_tiles[shape, 2] - x0
        a = vertex[i]
        b = vertex[vertex_next[i]]
        box = segment_box[i]
        # The rectangle's corners may lie outside the shape's tiles, where it has no pixel.
        right = wp.min(width, constants.TILE * shape_tiles[shape, 2])
        bottom = wp.min(height, constants.TILE * shape_tiles[shape, 3])
        ys = pixels_within(box[2], box[3], constants.TILE * y0, bottom)
        for y in range(ys[0], ys[1]):
            slot_row = slots[0] + (y / constants.TILE - y0) * wide - x0
            span = segment_span(a[0], float(y) + 0.5 - a[1], segment_ends[i], segment_sides[i])
            xs = pixels_within(span[0], span[1], constants.TILE * x0, right)
            for x in range(xs[0], xs[1]):
                slot = slot_row + x / constants.TILE
                p = constants.TILE * (x % constants.TILE) + y % constants.TILE
                g = float(0.0)
                if slot_state[slot] == constants.PARTIAL:
                    g = sum_grad[slot, p]
                # No gradient, no segment: the array is kept only where the coverage is neither 0 nor 1.
                if g != 0.0 and segment[slot, p] == i:
                    centre = wp.vec2(float(x) + 0.5, float(y) + 0.5)
                    t = nearest(centre, a, b)
                    r = centre - (1.0 - t) * a - t * b
                    distance = wp.length(r)
                    n = normal(r, distance, b - a)
                    inner = half_plane_slope(half - distance, n)
                    outer = half_plane_slope(half + distance, n)
                    of_half += g * (inner + outer)
                    if distance >= 1.0e-6:
                        move = (g * (inner - outer)) * n
                        at_start += (1.0 - t) * move
                        at_end += t * move
    start_grad[i] = at_start
    end_grad[i] = at_end
    half_grad[i] = of_half


@wp.kernel
def widths_backward(
    # In:
    offset: wp.int32,
    part: wp.array[wp.int32],  # [shape_count]
    scale: wp.float32,
    vertex_range: wp.array[wp.vec2i],  # [shape_count]
    half_grad: wp.array[wp.float32],  # [vertex_capacity]
    # Out:
    widths_grad: wp.array[wp.float32],  # [shape_count] written
):
    """Sum over the segments of a shape in order. One thread a shape."""
    shape = offset + wp.tid()
    if part[shape] != constants.STROKE:
        return
    total = float(0.0)
    vertices = vertex_range[shape]
    for i in range(vertices[0], vertices[1]):
        total += half_grad[i]
    widths_grad[shape] = 0.5 * scale * total
