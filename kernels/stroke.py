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

wp.set_module_options(constants.MODULE_OPTIONS)

TILE = wp.constant(constants.TILE)
COVERED = wp.constant(constants.COVERED)
UNCOVERED = wp.constant(constants.UNCOVERED)
PARTIAL = wp.constant(constants.PARTIAL)
FAR = wp.constant(1.0e9)
TINY = wp.constant(1.0e-12)
FLAT = wp.constant(1.0e-4)


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


@wp.kernel
def stroke_forward(
    # In:
    first: wp.int32,
    lane_rows: wp.int32,  # pixel rows of a tile that a thread handles
    slot_part: wp.array[wp.int32],  # [slot_capacity] -1: unused
    slot_tile: wp.array[wp.int32],  # [slot_capacity]
    tiles_x: wp.int32,
    opacity_count: wp.int32,
    widths: wp.array[wp.float32],  # [curve_count] canvas units
    scale: wp.float32,
    part_first: wp.array[wp.int32],  # [part_count] vertices
    part_last: wp.array[wp.int32],  # [part_count]
    vertex: wp.array[wp.vec2],  # [vertex_capacity] px
    # Out:
    coverage: wp.array2d[wp.float32],  # [slot_capacity, TILE_PIXELS] in [0, 1]; by column
    segment: wp.array2d[wp.int32],  # [slot_capacity, TILE_PIXELS] nearest segment (its first vertex)
    slot_state: wp.array[wp.int32],  # [slot_capacity] 0, UNCOVERED, PARTIAL or FULL
):
    """One thread a slot and lane: squared distances first, then coverage."""
    i, lane = wp.tid()
    slot = first + i
    part = slot_part[slot]
    if part < 0:
        return
    half = 0.5 * scale * widths[part / opacity_count]
    reach = half + 0.75
    inside = wp.max(half - 0.75, 0.0) * wp.max(half - 0.75, 0.0)
    tile_x = TILE * (slot_tile[slot] % tiles_x)
    tile_y = TILE * (slot_tile[slot] / tiles_x)
    row_first = tile_y + lane * lane_rows
    row_last = row_first + lane_rows
    for x in range(TILE):
        for y in range(lane * lane_rows, (lane + 1) * lane_rows):
            coverage[slot, TILE * x + y] = FAR
    seen = int(0)
    for j in range(part_first[part], part_last[part] - 1):
        a = vertex[j]
        b = vertex[j + 1]
        low = wp.min(a, b)
        high = wp.max(a, b)
        x0 = wp.max(tile_x, int(wp.ceil(wp.max(low[0] - reach, -1.0) - 0.5)))
        x1 = wp.min(tile_x + TILE, int(wp.floor(wp.min(high[0] + reach, 1.0e8) + 0.5)))
        y0 = wp.max(row_first, int(wp.ceil(wp.max(low[1] - reach, -1.0) - 0.5)))
        y1 = wp.min(row_last, int(wp.floor(wp.min(high[1] + reach, 1.0e8) + 0.5)))
        if x0 < x1 and y0 < y1:
            seen = 1
            e = b - a
            inverse = 1.0 / wp.max(wp.dot(e, e), TINY)
            for y in range(y0, y1):
                base = y - tile_y - TILE * tile_x
                py = float(y) + 0.5 - a[1]
                for x in range(x0, x1):
                    so_far = coverage[slot, base + TILE * x]
                    # Well inside the stroke it does not matter which segment is nearest.
                    if so_far > inside:
                        px = float(x) + 0.5 - a[0]
                        t = wp.clamp((px * e[0] + py * e[1]) * inverse, 0.0, 1.0)
                        rx = px - t * e[0]
                        ry = py - t * e[1]
                        squared = rx * rx + ry * ry
                        if squared < so_far:
                            coverage[slot, base + TILE * x] = squared
                            segment[slot, base + TILE * x] = j
    if seen == 0:
        wp.atomic_or(slot_state, slot, UNCOVERED)
        return
    most = float(0.0)
    least = float(1.0)
    for y in range(row_first, row_last):
        for x in range(TILE):
            p = TILE * x + y - tile_y
            squared = coverage[slot, p]
            value = float(0.0)
            if squared < reach * reach:
                distance = wp.sqrt(squared)
                if squared <= inside and half > 0.75:
                    value = 1.0
                else:
                    j = segment[slot, p]
                    centre = wp.vec2(float(tile_x + x) + 0.5, float(y) + 0.5)
                    t = nearest(centre, vertex[j], vertex[j + 1])
                    n = direction(centre - (1.0 - t) * vertex[j] - t * vertex[j + 1], distance)
                    value = half_plane(half - distance, n) + half_plane(half + distance, n) - 1.0
            coverage[slot, p] = value
            most = wp.max(most, value)
            least = wp.min(least, value)
    state = int(0)
    if most > 0.0:
        state = COVERED
    if least < 1.0:
        state = state | UNCOVERED
    wp.atomic_or(slot_state, slot, state)


@wp.kernel
def stroke_backward(
    # In:
    first: wp.int32,
    width: wp.int32,  # px
    height: wp.int32,  # px
    opacity_count: wp.int32,
    widths: wp.array[wp.float32],  # [curve_count] canvas units
    scale: wp.float32,
    vertex_part: wp.array[wp.int32],  # [vertex_capacity] -1: unused
    part_last: wp.array[wp.int32],  # [part_count]
    slot_first: wp.array[wp.int32],  # [part_count]
    slot_last: wp.array[wp.int32],  # [part_count]
    slot_state: wp.array[wp.int32],  # [slot_capacity]
    part_tiles: wp.array2d[wp.int32],  # [part_count, 4]
    vertex: wp.array[wp.vec2],  # [vertex_capacity] px
    segment: wp.array2d[wp.int32],  # [slot_capacity, TILE_PIXELS]
    coverage: wp.array2d[wp.float32],  # [slot_capacity, TILE_PIXELS]
    coverage_grad: wp.array2d[wp.float32],  # [slot_capacity, TILE_PIXELS]
    # Out:
    start_grad: wp.array[wp.vec2],  # [vertex_capacity] of the first end of the segment that starts here
    end_grad: wp.array[wp.vec2],  # [vertex_capacity] of its second end
    half_grad: wp.array[wp.float32],  # [vertex_capacity] of half the width [px]
):
    """One thread a segment, over the border pixels whose nearest segment it is."""
    i = first + wp.tid()
    part = vertex_part[i]
    if part < 0:
        return
    at_start = wp.vec2(0.0, 0.0)
    at_end = wp.vec2(0.0, 0.0)
    of_half = float(0.0)
    base_slot = slot_first[part]
    if slot_last[part] > base_slot and i + 1 < part_last[part]:
        half = 0.5 * scale * widths[part / opacity_count]
        reach = half + 0.75
        tile_x0 = part_tiles[part, 0]
        tile_y0 = part_tiles[part, 1]
        wide = part_tiles[part, 2] - tile_x0
        a = vertex[i]
        b = vertex[i + 1]
        low = wp.min(a, b)
        high = wp.max(a, b)
        x0 = int(wp.ceil(wp.max(low[0] - reach, 0.0) - 0.5))
        x1 = wp.min(width, int(wp.floor(wp.min(high[0] + reach, 1.0e8) + 0.5)))
        y0 = int(wp.ceil(wp.max(low[1] - reach, 0.0) - 0.5))
        y1 = wp.min(height, int(wp.floor(wp.min(high[1] + reach, 1.0e8) + 0.5)))
        for y in range(y0, y1):
            slot_row = base_slot + (y / TILE - tile_y0) * wide - tile_x0
            for x in range(x0, x1):
                slot = slot_row + x / TILE
                p = TILE * (x % TILE) + y % TILE
                value = float(0.0)
                if slot_state[slot] == PARTIAL:
                    value = coverage[slot, p]
                if value > 0.0 and value < 1.0:
                    if segment[slot, p] == i:
                        centre = wp.vec2(float(x) + 0.5, float(y) + 0.5)
                        t = nearest(centre, a, b)
                        r = centre - (1.0 - t) * a - t * b
                        distance = wp.length(r)
                        n = direction(r, distance)
                        inner = half_plane_slope(half - distance, n)
                        outer = half_plane_slope(half + distance, n)
                        g = coverage_grad[slot, p]
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
