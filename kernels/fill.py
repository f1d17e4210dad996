"""Polygons -> exact coverage, and the adjoint.

The winding-weighted area of a polygon in each pixel is summed up edge by edge as font rasterisers do: a piece
of an edge inside one pixel adds its height to all pixels on its right, and to its own pixel the share of it
right of the piece. What is stored is that sum, clamped to [-1, 1]; its magnitude is the coverage of a
non-zero fill. No samples: a straight edge's coverage is the exact area.

Adjoint: a piece with extent (dx, dy), moved by v, changes its pixel's area by dx v_y - dy v_x and no other
pixel's. An edge's ends take (1 - s) and s of it, s the edge's parameter at the middle of the piece.
"""

import warp as wp

from warpsplat.kernels import constants

wp.set_module_options({"enable_backward": False})

TILE = wp.constant(constants.TILE)
FULL = wp.constant(constants.FULL)


@wp.func
def next_vertex(i: wp.int32, part_first: wp.int32, part_last: wp.int32) -> wp.int32:
    """The vertex after ``i`` in its ring."""
    if i + 1 == part_last:
        return part_first
    return i + 1


@wp.kernel
def fill_forward(
    # In:
    first: wp.int32,
    lane_rows: wp.int32,  # pixel rows of a tile that a thread handles
    slot_part: wp.array[wp.int32],  # [slot_capacity] -1: unused
    slot_first: wp.array[wp.int32],  # [part_count]
    part_tiles: wp.array2d[wp.int32],  # [part_count, 4]
    part_first: wp.array[wp.int32],  # [part_count] vertices
    part_last: wp.array[wp.int32],  # [part_count]
    vertex: wp.array[wp.vec2],  # [vertex_capacity] px
    # Out:
    coverage: wp.array2d[wp.float32],  # [slot_capacity, TILE_PIXELS] signed, in [-1, 1]
    slot_seen: wp.array2d[wp.int32],  # [slot_capacity, lanes] 0 empty, 1 partly covered, FULL
):
    """One thread a row of tiles of a part (the thread of its leftmost slot) and lane."""
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
    tile_y = part_tiles[part, 1] + local / wide
    left = float(TILE * tile_x0)
    pixels = TILE * wide
    row_first = TILE * tile_y + lane * lane_rows
    row_last = row_first + lane_rows
    low = float(row_first)
    high = float(row_last)
    for s in range(slot, slot + wide):
        for p in range(lane * lane_rows * TILE, (lane + 1) * lane_rows * TILE):
            coverage[s, p] = 0.0
    start = part_first[part]
    stop = part_last[part]
    touched = int(0)
    for j in range(start, stop):
        a = vertex[j]
        b = vertex[next_vertex(j, start, stop)]
        sign = float(1.0)
        if a[1] > b[1]:
            a = vertex[next_vertex(j, start, stop)]
            b = vertex[j]
            sign = -1.0
        if b[1] > low and a[1] < high and b[1] > a[1]:
            touched = 1
            slope = (b[0] - a[0]) / (b[1] - a[1])
            y_top = wp.max(a[1], low)
            y_bottom = wp.min(b[1], high)
            y_first = int(y_top)
            y_last = wp.min(int(y_bottom), row_last - 1)
            # x relative to the part's leftmost pixel
            x_top = a[0] + (y_top - a[1]) * slope - left
            for y in range(y_first, y_last + 1):
                y_next = wp.min(float(y + 1), y_bottom)
                dy = y_next - y_top
                x_next = x_top + dy * slope
                base = (y - TILE * tile_y) * TILE
                x_low = wp.max(wp.min(x_top, x_next), 0.0)
                x_high = wp.min(wp.max(x_top, x_next), float(pixels))
                column = int(x_low)
                height = sign * dy
                if x_low >= x_high:
                    # Vertical, or wholly left or right of the part's tiles.
                    if column < pixels:
                        fraction = x_low - float(column)
                        s = slot + column / TILE
                        p = base + column % TILE
                        coverage[s, p] = coverage[s, p] + height * (1.0 - fraction)
                        column += 1
                        if column < pixels:
                            s = slot + column / TILE
                            p = base + column % TILE
                            coverage[s, p] = coverage[s, p] + height * fraction
                else:
                    per_x = height / wp.abs(x_next - x_top)
                    # What lies left of the part's tiles acts at their left border.
                    outside = wp.max(-wp.min(x_top, x_next), 0.0) * per_x
                    if outside != 0.0:
                        coverage[slot, base] = coverage[slot, base] + outside
                    x = x_low
                    while x < x_high:
                        edge = wp.min(float(column + 1), x_high)
                        part_height = (edge - x) * per_x
                        fraction = 0.5 * (x + edge) - float(column)
                        s = slot + column / TILE
                        p = base + column % TILE
                        coverage[s, p] = coverage[s, p] + part_height * (1.0 - fraction)
                        column += 1
                        if column < pixels:
                            s = slot + column / TILE
                            p = base + column % TILE
                            coverage[s, p] = coverage[s, p] + part_height * fraction
                        x = edge
                x_top = x_next
                y_top = y_next
    # Prefix sums along the rows, tile by tile.
    for s in range(slot, slot + wide):
        slot_seen[s, lane] = 0
    if touched == 0:
        return
    for r in range(lane * lane_rows, (lane + 1) * lane_rows):
        total = float(0.0)
        for s in range(slot, slot + wide):
            most = float(0.0)
            least = float(1.0)
            for p in range(r * TILE, (r + 1) * TILE):
                total += coverage[s, p]
                value = wp.clamp(total, -1.0, 1.0)
                coverage[s, p] = value
                most = wp.max(most, wp.abs(value))
                least = wp.min(least, wp.abs(value))
            # Rounding leaves sums of about 1e-7 outside and 1 - 1e-7 inside.
            state = int(1)
            if most < 1.0e-5:
                state = 0
            elif least > 0.99999:
                state = FULL
            if r == lane * lane_rows:
                slot_seen[s, lane] = state
            elif slot_seen[s, lane] != state:
                slot_seen[s, lane] = 1


@wp.kernel
def fill_backward(
    # In:
    first: wp.int32,
    width: wp.int32,  # px
    height: wp.int32,  # px
    vertex_part: wp.array[wp.int32],  # [vertex_capacity] -1: unused
    part_first: wp.array[wp.int32],  # [part_count]
    part_last: wp.array[wp.int32],  # [part_count]
    slot_first: wp.array[wp.int32],  # [part_count]
    slot_last: wp.array[wp.int32],  # [part_count]
    part_tiles: wp.array2d[wp.int32],  # [part_count, 4]
    vertex: wp.array[wp.vec2],  # [vertex_capacity] px
    coverage: wp.array2d[wp.float32],  # [slot_capacity, TILE_PIXELS] signed
    coverage_grad: wp.array2d[wp.float32],  # [slot_capacity, TILE_PIXELS] of the magnitude
    # Out:
    start_grad: wp.array[wp.vec2],  # [vertex_capacity] of the first end of the edge that starts here
    end_grad: wp.array[wp.vec2],  # [vertex_capacity] of its second end
):
    """One thread an edge, walking the pixels that it crosses."""
    i = first + wp.tid()
    part = vertex_part[i]
    if part < 0:
        return
    at_start = wp.vec2(0.0, 0.0)
    at_end = wp.vec2(0.0, 0.0)
    base_slot = slot_first[part]
    a = vertex[i]
    b = vertex[next_vertex(i, part_first[part], part_last[part])]
    d = b - a
    if slot_last[part] > base_slot and wp.abs(d[0]) + wp.abs(d[1]) > 0.0:
        tile_x0 = part_tiles[part, 0]
        tile_y0 = part_tiles[part, 1]
        wide = part_tiles[part, 2] - tile_x0
        # Parameters at which the edge is inside the canvas.
        s = float(0.0)
        s_end = float(1.0)
        for axis in range(2):
            size = float(width)
            if axis == 1:
                size = float(height)
            if d[axis] != 0.0:
                s0 = (0.0 - a[axis]) / d[axis]
                s1 = (size - a[axis]) / d[axis]
                s = wp.max(s, wp.min(s0, s1))
                s_end = wp.min(s_end, wp.max(s0, s1))
            elif a[axis] < 0.0 or a[axis] >= size:
                s_end = -1.0
        inverse_x = float(0.0)
        inverse_y = float(0.0)
        step_x = int(0)
        step_y = int(0)
        if d[0] != 0.0:
            inverse_x = 1.0 / d[0]
            step_x = 1
            if d[0] < 0.0:
                step_x = -1
        if d[1] != 0.0:
            inverse_y = 1.0 / d[1]
            step_y = 1
            if d[1] < 0.0:
                step_y = -1
        middle_x = a[0] + s * d[0]
        middle_y = a[1] + s * d[1]
        column = wp.clamp(int(wp.floor(middle_x)), 0, width - 1)
        row = wp.clamp(int(wp.floor(middle_y)), 0, height - 1)
        while s < s_end:
            # Where the edge leaves this pixel.
            s_next = s_end
            across = int(0)
            if step_x != 0:
                s_x = (float(column + (step_x + 1) / 2) - a[0]) * inverse_x
                if s_x < s_next:
                    s_next = s_x
                    across = 1
            if step_y != 0:
                s_y = (float(row + (step_y + 1) / 2) - a[1]) * inverse_y
                if s_y < s_next:
                    s_next = s_y
                    across = 2
            s_next = wp.max(s_next, s)
            slot = base_slot + (row / TILE - tile_y0) * wide + column / TILE - tile_x0
            p = (row % TILE) * TILE + column % TILE
            value = coverage[slot, p]
            if wp.abs(value) < 1.0 and value != 0.0:
                g = coverage_grad[slot, p] * wp.sign(value) * (s_next - s)
                move = wp.vec2(-d[1] * g, d[0] * g)
                middle = 0.5 * (s + s_next)
                at_start += (1.0 - middle) * move
                at_end += middle * move
            if across == 1:
                column += step_x
            elif across == 2:
                row += step_y
            else:
                s_next = s_end
            if column < 0 or column >= width or row < 0 or row >= height:
                s_next = s_end
            s = s_next
    start_grad[i] = at_start
    end_grad[i] = at_end
