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
from warpsplat.kernels.tile import column

wp.set_module_options(constants.MODULE_OPTIONS)

TILE = wp.constant(constants.TILE)
FULL = wp.constant(constants.FULL)
PARTIAL = wp.constant(constants.PARTIAL)
UNCOVERED = wp.constant(constants.UNCOVERED)
FLAT = wp.constant(1.0e-30)  # [px] an edge that rises less is horizontal: its slope would not be finite
MIDDLE = wp.constant(7.73)  # of a row of tiles [px]: a line on which vertices seldom lie
MARGIN = wp.constant(0.01)  # [px] an edge that ends so near to a tile counts as touching it


@wp.func
def next_vertex(i: wp.int32, part_first: wp.int32, part_last: wp.int32) -> wp.int32:
    """The vertex after ``i`` in its ring."""
    if i + 1 == part_last:
        return part_first
    return i + 1


@wp.func
def tile_of(x: wp.float32, wide: wp.int32) -> wp.int32:
    """Tile of ``x`` px right of the part's tiles' left border: -1 left of them, ``wide`` right of them."""
    return int(wp.floor(wp.clamp(x, -1.0, float(TILE * wide)) / float(TILE)))


@wp.func
def add_area(coverage: wp.array2d[wp.float32], slot: wp.int32, x: wp.int32, row: wp.int32, value: wp.float32):
    """Add to the pixel ``x`` right of the left border of ``slot``, in row ``row`` of its tile."""
    s = slot + x / TILE
    p = TILE * (x % TILE) + row
    coverage[s, p] = coverage[s, p] + value


@wp.kernel
def fill_states(
    # In:
    first: wp.int32,
    slot_part: wp.array[wp.int32],  # [slot_capacity] -1: unused
    slot_first: wp.array[wp.int32],  # [part_count]
    part_tiles: wp.array2d[wp.int32],  # [part_count, 4]
    part_first: wp.array[wp.int32],  # [part_count] vertices
    part_last: wp.array[wp.int32],  # [part_count]
    vertex: wp.array[wp.vec2],  # [vertex_capacity] px
    # Out:
    slot_state: wp.array[wp.int32],  # [slot_capacity] 0, UNCOVERED, PARTIAL or FULL
    slot_winding: wp.array[wp.int32],  # [slot_capacity] of slots that no edge touches
):
    """One thread a row of tiles of a part (that of its leftmost slot).

    Slots that an edge touches are PARTIAL; in the others the winding number is the same everywhere: that on
    a line through the middle of the row.
    """
    slot = first + wp.tid()
    part = slot_part[slot]
    if part < 0:
        return
    tile_x0 = part_tiles[part, 0]
    wide = part_tiles[part, 2] - tile_x0
    local = slot - slot_first[part]
    if local % wide != 0:
        return
    low = float(TILE * (part_tiles[part, 1] + local / wide))
    high = low + float(TILE)
    middle = low + MIDDLE
    left = float(TILE * tile_x0)
    end = slot + wide
    for s in range(slot, end):
        slot_state[s] = 0
        slot_winding[s] = 0
    winding = int(0)
    start = part_first[part]
    stop = part_last[part]
    b = vertex[stop - 1]
    for j in range(start, stop):
        a = b
        b = vertex[j]
        if wp.min(a[1], b[1]) <= high and wp.max(a[1], b[1]) >= low:
            x0 = a[0]
            x1 = b[0]
            if wp.abs(a[1] - b[1]) > FLAT:
                slope = (b[0] - a[0]) / (b[1] - a[1])
                x0 = a[0] + slope * (wp.clamp(a[1], low, high) - a[1])
                x1 = a[0] + slope * (wp.clamp(b[1], low, high) - a[1])
                crossing = int(0)
                if a[1] <= middle and b[1] > middle:
                    crossing = 1
                elif b[1] <= middle and a[1] > middle:
                    crossing = -1
                if crossing != 0:
                    s = slot + tile_of(a[0] + slope * (middle - a[1]) - left, wide)
                    if s < slot:
                        winding += crossing
                    elif s < end:
                        slot_winding[s] = slot_winding[s] + crossing
            s0 = wp.max(slot + tile_of(wp.min(x0, x1) - MARGIN - left, wide), slot)
            s1 = wp.min(slot + tile_of(wp.max(x0, x1) + MARGIN - left, wide), end - 1)
            for s in range(s0, s1 + 1):
                slot_state[s] = PARTIAL
    for s in range(slot, end):
        winding += slot_winding[s]
        slot_winding[s] = winding
        if slot_state[s] != PARTIAL:
            slot_state[s] = UNCOVERED
            if winding != 0:
                slot_state[s] = FULL


@wp.kernel
def fill_forward(
    # In:
    first: wp.int32,
    lane_rows: wp.int32,  # pixel rows of a tile that a thread handles
    slot_part: wp.array[wp.int32],  # [slot_capacity] -1: unused
    slot_first: wp.array[wp.int32],  # [part_count]
    slot_state: wp.array[wp.int32],  # [slot_capacity]
    slot_winding: wp.array[wp.int32],  # [slot_capacity]
    part_tiles: wp.array2d[wp.int32],  # [part_count, 4]
    part_first: wp.array[wp.int32],  # [part_count] vertices
    part_last: wp.array[wp.int32],  # [part_count]
    vertex: wp.array[wp.vec2],  # [vertex_capacity] px
    # Out:
    coverage: wp.array2d[wp.float32],  # [slot_capacity, TILE_PIXELS] signed, in [-1, 1]; by column
    columns: wp.array2d[column],  # [slot_capacity, TILE] the same memory
):
    """One thread a row of tiles of a part (that of its leftmost slot) and lane. Only slots that are PARTIAL
    are written, and rows without a visible one are left out.
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
    seen = int(0)
    for s in range(slot, slot + wide):
        if slot_state[s] == PARTIAL:
            seen = 1
    if seen == 0:
        return
    tile_y = part_tiles[part, 1] + local / wide
    left = float(TILE * tile_x0)
    pixels = TILE * wide
    row_first = TILE * tile_y + lane * lane_rows
    row_last = row_first + lane_rows
    low = float(row_first)
    high = float(row_last)
    for s in range(slot, slot + wide):
        if slot_state[s] & PARTIAL == PARTIAL:
            if lane_rows == TILE:
                for x in range(TILE):
                    columns[s, x] = column(0.0)
            else:
                for x in range(TILE):
                    coverage[s, TILE * x + lane] = 0.0
    start = part_first[part]
    stop = part_last[part]
    second = vertex[stop - 1]
    for j in range(start, stop):
        a = second
        second = vertex[j]
        b = second
        sign = float(1.0)
        if a[1] > b[1]:
            b = a
            a = second
            sign = -1.0
        if b[1] > low and a[1] < high and b[1] - a[1] > FLAT:
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
                row = y - TILE * tile_y
                x_low = wp.clamp(wp.min(x_top, x_next), 0.0, float(pixels))
                x_high = wp.min(wp.max(x_top, x_next), float(pixels))
                index = int(x_low)
                height = sign * dy
                if x_low >= x_high:
                    # Vertical, or wholly left or right of the part's tiles.
                    if index < pixels:
                        fraction = x_low - float(index)
                        add_area(coverage, slot, index, row, height * (1.0 - fraction))
                        if index + 1 < pixels:
                            add_area(coverage, slot, index + 1, row, height * fraction)
                else:
                    per_x = height / wp.abs(x_next - x_top)
                    # What lies left of the part's tiles acts at their left border.
                    outside = wp.max(-wp.min(x_top, x_next), 0.0) * per_x
                    if outside != 0.0:
                        add_area(coverage, slot, 0, row, outside)
                    at = x_low
                    while at < x_high:
                        edge = wp.min(float(index + 1), x_high)
                        part_height = (edge - at) * per_x
                        fraction = 0.5 * (at + edge) - float(index)
                        add_area(coverage, slot, index, row, part_height * (1.0 - fraction))
                        index += 1
                        if index < pixels:
                            add_area(coverage, slot, index, row, part_height * fraction)
                        at = edge
                x_top = x_next
                y_top = y_next
    # Prefix sums along the rows.
    if lane_rows == TILE:
        total = column(0.0)
        one = column(1.0)
        for s in range(slot, slot + wide):
            if slot_state[s] & PARTIAL == PARTIAL:
                for x in range(TILE):
                    total = total + columns[s, x]
                    columns[s, x] = wp.min(wp.max(total, -one), one)
            else:
                total = float(slot_winding[s]) * one
    else:
        value = float(0.0)
        for s in range(slot, slot + wide):
            if slot_state[s] & PARTIAL == PARTIAL:
                for x in range(TILE):
                    value += coverage[s, TILE * x + lane]
                    coverage[s, TILE * x + lane] = wp.clamp(value, -1.0, 1.0)
            else:
                value = float(slot_winding[s])


@wp.kernel
def fill_backward(
    # In:
    first: wp.int32,
    width: wp.int32,  # px
    height: wp.int32,  # px
    vertex_part: wp.array[wp.int32],  # [vertex_capacity]
    part_ends: wp.array[wp.int32],  # [part_count] end of each part's vertices
    part_first: wp.array[wp.int32],  # [part_count]
    part_last: wp.array[wp.int32],  # [part_count]
    slot_first: wp.array[wp.int32],  # [part_count]
    slot_last: wp.array[wp.int32],  # [part_count]
    slot_state: wp.array[wp.int32],  # [slot_capacity]
    part_tiles: wp.array2d[wp.int32],  # [part_count, 4]
    vertex: wp.array[wp.vec2],  # [vertex_capacity] px
    sum_grad: wp.array2d[wp.float32],  # [slot_capacity, TILE_PIXELS] of the area, not clamped; by column
    # Out:
    start_grad: wp.array[wp.vec2],  # [vertex_capacity] of the first end of the edge that starts here
    end_grad: wp.array[wp.vec2],  # [vertex_capacity] of its second end
):
    """One thread an edge, walking the pixels that it crosses."""
    i = first + wp.tid()
    if i >= part_ends[part_ends.shape[0] - 1]:
        return
    part = vertex_part[i]
    if i < part_first[part] or i >= part_last[part]:
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
        x = wp.clamp(int(wp.floor(middle_x)), 0, width - 1)
        row = wp.clamp(int(wp.floor(middle_y)), 0, height - 1)
        while s < s_end:
            # Where the edge leaves this pixel.
            s_next = s_end
            across = int(0)
            if step_x != 0:
                s_x = (float(x + (step_x + 1) / 2) - a[0]) * inverse_x
                if s_x < s_next:
                    s_next = s_x
                    across = 1
            if step_y != 0:
                s_y = (float(row + (step_y + 1) / 2) - a[1]) * inverse_y
                if s_y < s_next:
                    s_next = s_y
                    across = 2
            s_next = wp.max(s_next, s)
            slot = base_slot + (row / TILE - tile_y0) * wide + x / TILE - tile_x0
            p = TILE * (x % TILE) + row % TILE
            # Rounding may take the walk a pixel beyond the part's tiles.
            out = x < TILE * tile_x0 or x >= TILE * part_tiles[part, 2]
            out = out or row < TILE * tile_y0 or row >= TILE * part_tiles[part, 3]
            if not out and slot_state[slot] == PARTIAL:
                g = sum_grad[slot, p] * (s_next - s)
                move = wp.vec2(-d[1] * g, d[0] * g)
                middle = 0.5 * (s + s_next)
                at_start += (1.0 - middle) * move
                at_end += middle * move
            if across == 1:
                x += step_x
            elif across == 2:
                row += step_y
            else:
                s_next = s_end
            if x < 0 or x >= width or row < 0 or row >= height:
                s_next = s_end
            s = s_next
    start_grad[i] = at_start
    end_grad[i] = at_end
