"""Polylines with a width -> coverage of round strokes, and the adjoint.

A round-capped, round-joined stroke is all that lies within half its width of the centre line, so a pixel
needs the distance d to the nearest segment and no outline: overlaps, loops and cusps are unions of
themselves.
Coverage is the exact area of the pixel's square between two straight lines at h - d and -h - d along the
direction n of the nearest point (h half the width): exact for straight strokes of any angle and width.

Adjoint: moving the nearest segment's ends by v_a, v_b changes d by -n . ((1 - t) v_a + t v_b), t the nearest
point's parameter (which is at a minimum, or at an end). The turning of n is of second order and left out.
"""

import warp as wp

from warpsplat.kernels import constants
from warpsplat.kernels.tile import column

wp.set_module_options(constants.MODULE_OPTIONS)

TILE = wp.constant(constants.TILE)
COVERED = wp.constant(constants.COVERED)
UNCOVERED = wp.constant(constants.UNCOVERED)
PARTIAL = wp.constant(constants.PARTIAL)
REACH_MAX = wp.constant(constants.REACH_MAX)
FAR = wp.constant(1.0e15)
TINY = wp.constant(1.0e-12)
FLAT = wp.constant(1.0e-4)
HALF_DIAGONAL = wp.constant(0.70711)  # of a pixel: an edge further away does not cross it
MARGIN = wp.constant(0.02)  # [px] against rounding


@wp.func
def half_plane(x: wp.float32, n: wp.vec2) -> wp.float32:
    """Area of the unit square centred at 0 where n . p < x, n a unit vector."""
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
def half_plane_slope(x: wp.float32, n: wp.vec2) -> wp.float32:
    """Derivative of ``half_plane`` by ``x``: the length of the line inside the square."""
    a = wp.max(wp.abs(n[0]), wp.abs(n[1]))
    b = wp.min(wp.abs(n[0]), wp.abs(n[1]))
    distance = wp.abs(x)
    if distance >= 0.5 * (a + b):
        return 0.0
    if distance <= 0.5 * (a - b) or b < FLAT:
        return 1.0 / a
    return (0.5 * (a + b) - distance) / (a * b)


@wp.func
def nearest(p: wp.vec2, a: wp.vec2, b: wp.vec2) -> wp.float32:
    """Parameter in [0, 1] of the point of segment (a, b) nearest to ``p``."""
    e = b - a
    return wp.clamp(wp.dot(p - a, e) / wp.max(wp.dot(e, e), TINY), 0.0, 1.0)


@wp.func
def direction(r: wp.vec2, length: wp.float32) -> wp.vec2:
    """Unit vector of ``r``; on the centre line itself any will do."""
    if length < 1.0e-6:
        return wp.vec2(1.0, 0.0)
    return r / length


@wp.func
def turn(before: wp.vec2, after: wp.vec2) -> wp.float32:
    """Sine of the angle between two segments, 1 for a right angle and more, or where one has no length."""
    lengths = wp.length(before) * wp.length(after)
    if lengths < TINY or wp.dot(before, after) <= 0.0:
        return 1.0
    return wp.min(wp.abs(before[0] * after[1] - before[1] * after[0]) / lengths + 0.01, 1.0)


@wp.func
def overhang(
    vertex: wp.array[wp.vec2], i: wp.int32, first: wp.int32, last: wp.int32, reach: wp.float32
) -> wp.vec2:
    """How far beyond its ends segment ``i`` of the vertices [first, last) is looked at [px].

    A pixel whose nearest point is the joint of two segments lies in the wedge between their normals, hence at
    most the sine of their angle times its distance beyond each of them; at the ends of the stroke are caps.
    """
    e = vertex[i + 1] - vertex[i]
    start = float(1.0)
    end = float(1.0)
    if i > first:
        start = turn(vertex[i] - vertex[i - 1], e)
    if i + 2 < last:
        end = turn(e, vertex[i + 2] - vertex[i + 1])
    return wp.vec2(start * reach + MARGIN, end * reach + MARGIN)


@wp.func
def segment_rows(a: wp.vec2, e: wp.vec2, length: wp.float32, reach: wp.float32, over: wp.vec2) -> wp.vec2:
    """Lowest and highest y of the rectangle around the segment from ``a`` along the unit vector ``e``."""
    start = a[1] - over[0] * e[1]
    end = a[1] + (length + over[1]) * e[1]
    side = reach * wp.abs(e[0])
    return wp.vec2(wp.min(start, end) - side, wp.max(start, end) + side)


@wp.func
def segment_ends(e: wp.vec2, length: wp.float32, over: wp.vec2) -> wp.vec3:
    """Where the rectangle's short sides meet the line at a's height, lower x first, and their slope dx / dy;
    relative to a.
    """
    if wp.abs(e[0]) <= FLAT:
        return wp.vec3(-1.0e8, 1.0e8, 0.0)
    x0 = -over[0] / e[0]
    x1 = (length + over[1]) / e[0]
    return wp.vec3(wp.min(x0, x1), wp.max(x0, x1), -e[1] / e[0])


@wp.func
def segment_sides(e: wp.vec2, reach: wp.float32) -> wp.vec2:
    """Half of the chord between the rectangle's long sides, and their slope dx / dy."""
    if wp.abs(e[1]) <= FLAT:
        return wp.vec2(1.0e8, 0.0)
    return wp.vec2(reach / wp.abs(e[1]), e[0] / e[1])


@wp.func
def segment_span(x: wp.float32, dy: wp.float32, ends: wp.vec3, sides: wp.vec2) -> wp.vec2:
    """Lowest and highest x of the rectangle at ``dy`` below a, a at ``x``; empty (low > high) without any."""
    low = wp.max(ends[0] + ends[2] * dy, sides[1] * dy - sides[0])
    high = wp.min(ends[1] + ends[2] * dy, sides[1] * dy + sides[0])
    return wp.vec2(x + low - MARGIN, x + high + MARGIN)


@wp.kernel
def stroke_forward(
    # In:
    first: wp.int32,
    lane_rows: wp.int32,  # pixel rows of a tile that a thread handles
    slot_part: wp.array[wp.int32],  # [slot_capacity] -1: unused
    slot_first: wp.array[wp.int32],  # [part_count]
    opacity_count: wp.int32,
    widths: wp.array[wp.float32],  # [curve_count] canvas units
    scale: wp.float32,
    part_tiles: wp.array2d[wp.int32],  # [part_count, 4]
    part_first: wp.array[wp.int32],  # [part_count] vertices
    part_last: wp.array[wp.int32],  # [part_count]
    vertex: wp.array[wp.vec2],  # [vertex_capacity] px
    # Out:
    coverage: wp.array2d[wp.float32],  # [slot_capacity, TILE_PIXELS] in [0, 1]; by column
    columns: wp.array2d[column],  # [slot_capacity, TILE] the same memory
    segment: wp.array2d[wp.int32],  # [slot_capacity, TILE_PIXELS] nearest segment (its first vertex)
    slot_state: wp.array[wp.int32],  # [slot_capacity] UNCOVERED, PARTIAL or FULL
    slot_near: wp.array2d[wp.int32],  # [slot_capacity, lanes] whether a segment is near
):
    """One thread a row of tiles of a part (that of its leftmost slot) and lane: the nearest segment of each
    pixel first, then coverage.
    """
    i, lane = wp.tid()
    slot = first + i
    part = slot_part[slot]
    if part < 0:
        return
    tile_x0 = part_tiles[part, 0]
    wide = part_tiles[part, 2] - tile_x0
    local = slot - slot_first[part]
    if local % wide != 0:
        return
    half = wp.min(0.5 * scale * widths[part / opacity_count], REACH_MAX)
    reach = half + HALF_DIAGONAL
    # What is stored first is reach^2 - distance^2, 0 where nothing is near. From here on a pixel is covered.
    inside = float(FAR)
    if half > HALF_DIAGONAL:
        inside = reach * reach - (half - HALF_DIAGONAL) * (half - HALF_DIAGONAL)
    left = TILE * tile_x0
    right = left + TILE * wide
    row_zero = TILE * (part_tiles[part, 1] + local / wide)
    row_first = row_zero + lane * lane_rows
    row_last = row_first + lane_rows
    for s in range(slot, slot + wide):
        slot_near[s, lane] = 0
        if lane_rows == TILE:
            for x in range(TILE):
                columns[s, x] = column(0.0)
        else:
            for x in range(TILE):
                coverage[s, TILE * x + lane] = 0.0
    start = part_first[part]
    stop = part_last[part]
    b = vertex[start]
    for j in range(start, stop - 1):
        a = b
        b = vertex[j + 1]
        if wp.min(a[1], b[1]) - reach < float(row_last) and wp.max(a[1], b[1]) + reach > float(row_first):
            d = b - a
            length = wp.length(d)
            e = direction(d, length)
            inverse = 1.0 / wp.max(length * length, TINY)
            over = overhang(vertex, j, start, stop, reach)
            ends = segment_ends(e, length, over)
            sides = segment_sides(e, reach)
            rows = segment_rows(a, e, length, reach, over)
            y0 = wp.max(row_first, int(wp.ceil(wp.max(rows[0], -1.0) - 0.5)))
            y1 = wp.min(row_last, int(wp.floor(wp.min(rows[1], 1.0e8) + 0.5)))
            for y in range(y0, y1):
                py = float(y) + 0.5 - a[1]
                span = segment_span(a[0], py, ends, sides)
                x0 = wp.max(left, int(wp.ceil(wp.clamp(span[0], -1.0, 1.0e8) - 0.5)))
                x1 = wp.min(right, int(wp.floor(wp.min(span[1], 1.0e8) + 0.5)))
                if x0 < x1:
                    for s in range(slot + (x0 - left) / TILE, slot + (x1 - 1 - left) / TILE + 1):
                        slot_near[s, lane] = 1
                for x in range(x0, x1):
                    s = slot + (x - left) / TILE
                    p = TILE * ((x - left) % TILE) + y - row_zero
                    so_far = coverage[s, p]
                    # Well inside the stroke it does not matter which segment is nearest.
                    if so_far < inside:
                        px = float(x) + 0.5 - a[0]
                        t = wp.clamp((px * d[0] + py * d[1]) * inverse, 0.0, 1.0)
                        rx = px - t * d[0]
                        ry = py - t * d[1]
                        near = reach * reach - rx * rx - ry * ry
                        if near > so_far:
                            coverage[s, p] = near
                            segment[s, p] = j
    for s in range(slot, slot + wide):
        state = int(UNCOVERED)
        if slot_near[s, lane] == 1:
            most = float(0.0)
            least = float(1.0)
            for x in range(TILE):
                for y in range(row_first, row_last):
                    p = TILE * x + y - row_zero
                    value = coverage[s, p]
                    if value >= inside:
                        value = 1.0
                        coverage[s, p] = 1.0
                    elif value > 0.0:
                        j = segment[s, p]
                        centre = wp.vec2(float(left + TILE * (s - slot) + x) + 0.5, float(y) + 0.5)
                        t = nearest(centre, vertex[j], vertex[j + 1])
                        r = centre - (1.0 - t) * vertex[j] - t * vertex[j + 1]
                        distance = wp.length(r)
                        n = direction(r, distance)
                        value = half_plane(half - distance, n)
                        if half + distance < HALF_DIAGONAL:
                            value += half_plane(half + distance, n) - 1.0
                        coverage[s, p] = value
                    most = wp.max(most, value)
                    least = wp.min(least, value)
            if most > 0.0:
                state = COVERED
                if least < 1.0:
                    state = PARTIAL
        wp.atomic_or(slot_state, s, state)


@wp.kernel
def stroke_backward(
    # In:
    first: wp.int32,
    width: wp.int32,  # px
    height: wp.int32,  # px
    opacity_count: wp.int32,
    widths: wp.array[wp.float32],  # [curve_count] canvas units
    scale: wp.float32,
    vertex_part: wp.array[wp.int32],  # [vertex_capacity]
    part_ends: wp.array[wp.int32],  # [part_count] end of each part's vertices
    part_first: wp.array[wp.int32],  # [part_count]
    part_last: wp.array[wp.int32],  # [part_count]
    slot_first: wp.array[wp.int32],  # [part_count]
    slot_last: wp.array[wp.int32],  # [part_count]
    slot_state: wp.array[wp.int32],  # [slot_capacity]
    part_tiles: wp.array2d[wp.int32],  # [part_count, 4]
    vertex: wp.array[wp.vec2],  # [vertex_capacity] px
    segment: wp.array2d[wp.int32],  # [slot_capacity, TILE_PIXELS]
    sum_grad: wp.array2d[wp.float32],  # [slot_capacity, TILE_PIXELS] 0 where the coverage is 0 or 1
    # Out:
    start_grad: wp.array[wp.vec2],  # [vertex_capacity] of the first end of the segment that starts here
    end_grad: wp.array[wp.vec2],  # [vertex_capacity] of its second end
    half_grad: wp.array[wp.float32],  # [vertex_capacity] of half the width [px]
):
    """One thread a segment, over the border pixels whose nearest segment it is."""
    i = first + wp.tid()
    if i >= part_ends[part_ends.shape[0] - 1]:
        return
    part = vertex_part[i]
    if i < part_first[part] or i >= part_last[part]:
        return
    at_start = wp.vec2(0.0, 0.0)
    at_end = wp.vec2(0.0, 0.0)
    of_half = float(0.0)
    base_slot = slot_first[part]
    if slot_last[part] > base_slot and i + 1 < part_last[part]:
        half = wp.min(0.5 * scale * widths[part / opacity_count], REACH_MAX)
        reach = half + HALF_DIAGONAL
        tile_x0 = part_tiles[part, 0]
        tile_y0 = part_tiles[part, 1]
        wide = part_tiles[part, 2] - tile_x0
        a = vertex[i]
        b = vertex[i + 1]
        length = wp.length(b - a)
        e = direction(b - a, length)
        over = overhang(vertex, i, part_first[part], part_last[part], reach)
        ends = segment_ends(e, length, over)
        sides = segment_sides(e, reach)
        rows = segment_rows(a, e, length, reach, over)
        # The rectangle's corners may lie outside the part's tiles, where it has no pixel.
        left = TILE * tile_x0
        right = wp.min(width, TILE * part_tiles[part, 2])
        top = TILE * tile_y0
        bottom = wp.min(height, TILE * part_tiles[part, 3])
        y0 = wp.max(top, int(wp.ceil(wp.max(rows[0], 0.0) - 0.5)))
        y1 = wp.min(bottom, int(wp.floor(wp.min(rows[1], 1.0e8) + 0.5)))
        for y in range(y0, y1):
            slot_row = base_slot + (y / TILE - tile_y0) * wide - tile_x0
            span = segment_span(a[0], float(y) + 0.5 - a[1], ends, sides)
            x0 = wp.max(left, int(wp.ceil(wp.clamp(span[0], 0.0, 1.0e8) - 0.5)))
            x1 = wp.min(right, int(wp.floor(wp.min(span[1], 1.0e8) + 0.5)))
            for x in range(x0, x1):
                slot = slot_row + x / TILE
                p = TILE * (x % TILE) + y % TILE
                g = float(0.0)
                if slot_state[slot] == PARTIAL:
                    g = sum_grad[slot, p]
                # No gradient, no segment: the array is kept only where the coverage is neither 0 nor 1.
                if g != 0.0 and segment[slot, p] == i:
                    centre = wp.vec2(float(x) + 0.5, float(y) + 0.5)
                    t = nearest(centre, a, b)
                    r = centre - (1.0 - t) * a - t * b
                    distance = wp.length(r)
                    n = direction(r, distance)
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
    first: wp.int32,
    opacity_count: wp.int32,
    scale: wp.float32,
    part_first: wp.array[wp.int32],  # [part_count]
    part_last: wp.array[wp.int32],  # [part_count]
    half_grad: wp.array[wp.float32],  # [vertex_capacity]
    # Out:
    widths_grad: wp.array[wp.float32],  # [curve_count] written
):
    """One thread a curve sums its segments in order."""
    curve = first + wp.tid()
    total = float(0.0)
    for part in range(curve * opacity_count, (curve + 1) * opacity_count):
        for i in range(part_first[part], part_last[part]):
            total += half_grad[i]
    widths_grad[curve] = 0.5 * scale * total
