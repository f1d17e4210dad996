"""Polygons -> exact coverage; ``fill_backward`` has the adjoint.

The winding-weighted area of a polygon in each pixel is summed up edge by edge as font rasterisers do: a piece
of an edge inside one pixel adds its height to all pixels on its right, and to its own pixel the share of it
right of the piece. What is stored is that sum, clamped to [-1, 1]; its magnitude is the coverage of a
non-zero fill. By the even-odd rule it is folded instead. No samples: a straight edge's coverage is the exact
area.

Slots with an edge on a border of pixels (ALIGNED) store coverages that are never quite 0 or 1, which have a
gradient.
"""

import functools
from typing import Any

import warp as wp

from warpsplat.kernels import constants
from warpsplat.kernels.coverage.rows import partial_run, tile_row
from warpsplat.kernels.tile import tile_column

wp.set_module_options(constants.MODULE_OPTIONS)

FLAT = wp.constant(1.0e-30)  # [px] an edge that rises less is horizontal: its slope would not be finite
MIDDLE = wp.constant(7.73)  # of a row of tiles [px]: a line on which vertices seldom lie
MARGIN = wp.constant(constants.TILE_MARGIN)
BORDER_TOLERANCE = wp.constant(1.0e-5)  # [px] an edge that is so near to a border of pixels lies on it
ROUNDING = wp.constant(2.4e-7)  # of coordinates
MOST_VERTICES = wp.constant(512)  # of a shape whose edges on borders of pixels are treated apart
NOT_ALONG = wp.constant(0.02)  # [px] an edge whose ends differ more lies on no border: most are told by this


@wp.func
def tile_of(x: wp.float32, wide: wp.int32) -> wp.int32:
    """Return the tile of ``x`` px right of the shape's tiles' left border: -1 left of them, ``wide`` right of
    them.
    """
    return int(wp.floor(wp.clamp(x, -1.0, float(constants.TILE * wide)) / float(constants.TILE)))


@wp.func
def cut_to_row(a: wp.vec2, b: wp.vec2, low: wp.float32, high: wp.float32) -> wp.vec2:
    """Return the x at which an edge from ``a`` to ``b`` starts and ends between two heights that it
    reaches.
    """
    if wp.abs(a[1] - b[1]) <= FLAT:
        return wp.vec2(a[0], b[0])
    slope = (b[0] - a[0]) / (b[1] - a[1])
    return wp.vec2(
        a[0] + slope * (wp.clamp(a[1], low, high) - a[1]), a[0] + slope * (wp.clamp(b[1], low, high) - a[1])
    )


@wp.func
def crossing(a: wp.vec2, b: wp.vec2, y: wp.float32) -> wp.int32:
    """Return 1 where an edge crosses height ``y`` downwards, -1 upwards, 0 where it does not."""
    if wp.abs(a[1] - b[1]) <= FLAT:
        return 0
    if a[1] <= y and b[1] > y:
        return 1
    if b[1] <= y and a[1] > y:
        return -1
    return 0


@wp.func
def on_border(a: wp.float32, b: wp.float32) -> wp.bool:
    """Return whether an edge between two coordinates ``a`` and ``b`` lies on one border of pixels."""
    if wp.abs(b - a) > NOT_ALONG:
        return False
    border = wp.floor(a + 0.5)
    tolerance = BORDER_TOLERANCE + ROUNDING * wp.abs(border)
    return wp.max(wp.abs(a - border), wp.abs(b - border)) <= tolerance


@wp.func
def has_borders(vertices: wp.vec2i) -> wp.bool:
    """Return whether a shape has few enough vertices for the treatment of edges on borders of pixels.

    Winding numbers beside such an edge take a pass over all of the shape's edges.
    """
    return vertices[1] - vertices[0] <= MOST_VERTICES


@wp.kernel
def find_reach(
    # In:
    offset: wp.int32,
    vertex_next: wp.array[wp.int32],  # [vertex_capacity] where the edge that starts here ends
    vertex: wp.array[wp.vec2],  # [vertex_capacity] px
    # Out:
    reach: wp.array[wp.vec2],  # [vertex_capacity / EDGE_BLOCK] px; least and largest y
):
    """Find the least and the largest y of the edges of each block. One thread a block."""
    block = offset + wp.tid()
    low = float(constants.REACH_MAX)
    high = -float(constants.REACH_MAX)
    first = constants.EDGE_BLOCK * block
    for j in range(first, wp.min(first + constants.EDGE_BLOCK, vertex.shape[0])):
        y = vertex[j][1]
        end = y
        if vertex_next[j] >= 0:
            end = vertex[vertex_next[j]][1]
        low = wp.min(low, wp.min(y, end))
        high = wp.max(high, wp.max(y, end))
    reach[block] = wp.vec2(low, high)


@wp.kernel
def fill_states(
    # In:
    offset: wp.int32,
    own_part: wp.int32,  # of the shapes to cover
    part: wp.array[wp.int32],  # [shape_count]
    rule: wp.array[wp.int32],  # [shape_count] NONZERO or EVENODD
    slot_shape: wp.array[wp.int32],  # [slot_capacity] -1: unused
    slot_range: wp.array[wp.vec2i],  # [shape_count]
    shape_tiles: wp.array2d[wp.int32],  # [shape_count, 4]
    vertex_range: wp.array[wp.vec2i],  # [shape_count]
    vertex_next: wp.array[wp.int32],  # [vertex_capacity] where the edge that starts here ends
    vertex: wp.array[wp.vec2],  # [vertex_capacity] px
    reach: wp.array[wp.vec2],  # [vertex_capacity / EDGE_BLOCK] px
    # Out:
    slot_state: wp.array[wp.int32],  # [slot_capacity] UNCOVERED, PARTIAL, PARTIAL + ALIGNED or FULL
    slot_winding: wp.array[wp.int32],  # [slot_capacity] of slots that no edge touches
):
    """Find the states of slots. One thread a row of tiles of a shape (that of its leftmost slot).

    Slots that an edge touches are PARTIAL; in the others the winding number is the same everywhere: that on
    a line through the middle of the row.
    """
    slot = offset + wp.tid()
    row = tile_row(slot, slot_shape, slot_range, shape_tiles)
    shape = row[0]
    if shape < 0:
        return
    if part[shape] != own_part:
        return
    wide = row[2]
    low = float(constants.TILE * row[3])
    high = low + float(constants.TILE)
    left = float(constants.TILE * row[1])
    end = slot + wide
    for s in range(slot, end):
        slot_state[s] = 0
        slot_winding[s] = 0
    winding = int(0)
    vertices = vertex_range[shape]
    borders = has_borders(vertices)
    first = vertices[0]
    last = vertices[1]
    while first < last:
        block = first / constants.EDGE_BLOCK
        stop = wp.min(constants.EDGE_BLOCK * (block + 1), last)
        if reach[block][0] <= high + MARGIN and reach[block][1] >= low - MARGIN:
            for j in range(first, stop):
                a = vertex[j]
                b = vertex[vertex_next[j]]
                lowest = wp.min(a[1], b[1])
                highest = wp.max(a[1], b[1])
                level = bool(False)
                if borders and lowest <= high + MARGIN and highest >= low - MARGIN:
                    level = on_border(a[1], b[1])
                if level or (lowest <= high and highest >= low):
                    turn = crossing(a, b, low + MIDDLE)
                    if turn != 0:
                        slope = (b[0] - a[0]) / (b[1] - a[1])
                        s = slot + tile_of(a[0] + slope * (low + MIDDLE - a[1]) - left, wide)
                        if s < slot:
                            winding += turn
                        elif s < end:
                            slot_winding[s] = slot_winding[s] + turn
                    ends = wp.vec2(a[0], b[0])
                    if not level:
                        ends = cut_to_row(a, b, low, high)
                    state = int(constants.PARTIAL)
                    if level or (borders and on_border(a[0], b[0])):
                        state = constants.PARTIAL + constants.ALIGNED
                    s0 = wp.max(slot + tile_of(wp.min(ends[0], ends[1]) - MARGIN - left, wide), slot)
                    s1 = wp.min(slot + tile_of(wp.max(ends[0], ends[1]) + MARGIN - left, wide), end - 1)
                    for s in range(s0, s1 + 1):
                        slot_state[s] = slot_state[s] | state
        first = stop
    for s in range(slot, end):
        winding += slot_winding[s]
        slot_winding[s] = winding
        if slot_state[s] == 0:
            slot_state[s] = constants.UNCOVERED
            if winding % 2 != 0 or (winding != 0 and rule[shape] == constants.NONZERO):
                slot_state[s] = constants.FULL


@wp.func
def add_area(pixels: wp.array2d[wp.float32], slot: wp.int32, x: wp.int32, row: wp.int32, value: wp.float32):
    """Add to the pixel ``x`` right of the left border of ``slot``, in row ``row`` of its tile."""
    s = slot + x / constants.TILE
    p = constants.TILE * (x % constants.TILE) + row
    pixels[s, p] = pixels[s, p] + value


@wp.func
def add_piece(
    pixels: wp.array2d[wp.float32],
    slot: wp.int32,
    row: wp.int32,
    x0: wp.float32,
    x1: wp.float32,
    height: wp.float32,
    width: wp.int32,
    columns: wp.vec2i,
):
    """Add the area right of a piece of an edge that lies inside one row of pixels, in its own pixels and,
    whole, in the first on its right; the prefix sum carries it on.

    ``x0``, ``x1``: its ends, right of the left border of ``slot``; ``width``: of the row of tiles [px];
    ``columns``: pieces that start in other pixels of the row than these [first, last) are left out.
    """
    least = wp.min(x0, x1)
    low = wp.clamp(least, 0.0, float(width))
    most = wp.max(x0, x1)
    high = wp.min(most, float(width))
    index = int(low)
    if index < columns[0] or index >= columns[1]:
        return
    if low >= high or (least >= 0.0 and most <= float(index + 1)):
        # In one pixel, or wholly left or right of the shape's tiles.
        if index < width:
            fraction = 0.5 * (low + wp.max(low, high)) - float(index)
            add_area(pixels, slot, index, row, height * (1.0 - fraction))
            if index + 1 < width:
                add_area(pixels, slot, index + 1, row, height * fraction)
        return
    per_x = height / wp.abs(x1 - x0)
    # What lies left of the shape's tiles acts at their left border.
    outside = wp.max(-least, 0.0) * per_x
    if outside != 0.0:
        add_area(pixels, slot, 0, row, outside)
    at = low
    while at < high:
        edge = wp.min(float(index + 1), high)
        piece = (edge - at) * per_x
        fraction = 0.5 * (at + edge) - float(index)
        add_area(pixels, slot, index, row, piece * (1.0 - fraction))
        index += 1
        if index < width:
            add_area(pixels, slot, index, row, piece * fraction)
        at = edge


@wp.func
def add_edge(
    pixels: wp.array2d[wp.float32],
    slot: wp.int32,
    start: wp.vec2,
    end: wp.vec2,
    left: wp.float32,
    width: wp.int32,
    top: wp.int32,
    row_first: wp.int32,
    row_last: wp.int32,
    columns: wp.vec2i,
):
    """Add an edge's areas in the pixel rows [row_first, row_last) of a row of tiles that starts at ``left``,
    ``top``, but for pieces that do not start in ``columns``.
    """
    a = start
    b = end
    sign = float(1.0)
    if start[1] > end[1]:
        a = end
        b = start
        sign = -1.0
    if b[1] > float(row_first) and a[1] < float(row_last) and b[1] - a[1] > FLAT:
        slope = (b[0] - a[0]) / (b[1] - a[1])
        y_top = wp.max(a[1], float(row_first))
        y_bottom = wp.min(b[1], float(row_last))
        y_last = wp.min(int(y_bottom), row_last - 1)
        x_top = a[0] + (y_top - a[1]) * slope - left
        for y in range(int(y_top), y_last + 1):
            y_next = wp.min(float(y + 1), y_bottom)
            dy = y_next - y_top
            x_next = x_top + dy * slope
            add_piece(pixels, slot, y - top, x_top, x_next, sign * dy, width, columns)
            x_top = x_next
            y_top = y_next


@wp.func
def is_partial(state: wp.int32) -> wp.bool:
    """Return whether a slot is PARTIAL and not HIDDEN."""
    return state & (constants.PARTIAL + constants.HIDDEN) == constants.PARTIAL


@wp.func
def any_visible(slot_state: wp.array[wp.int32], first: wp.int32, last: wp.int32) -> wp.bool:
    """Return whether one of the slots [first, last) is PARTIAL and not HIDDEN."""
    for s in range(first, last):
        if is_partial(slot_state[s]):
            return True
    return False


@wp.func
def fold(s: wp.float32) -> wp.float32:
    """Return a winding-weighted area's signed distance from the nearest even number: by the even-odd rule,
    its magnitude is the coverage and its sign that of the coverage's derivative.
    """
    shifted = 0.5 * s + 0.5
    below = float(int(shifted))  # and not floor, which is a call for each number
    if below > shifted:
        below -= 1.0
    return s - 2.0 * below


@wp.func
def sum_columns(
    coverage: wp.array2d[tile_column],
    slot_state: wp.array[wp.int32],
    slot_winding: wp.array[wp.int32],
    first: wp.int32,
    last: wp.int32,
    rule: wp.int32,
):
    """Compute prefix sums along the rows of the slots [first, last), clamped or folded: 16 rows at a time."""
    total = tile_column(0.0)
    one = tile_column(1.0)
    for s in range(first, last):
        if slot_state[s] & constants.PARTIAL == constants.PARTIAL:
            columns = int(constants.TILE)  # not unrolled: as fast, and sooner compiled
            for x in range(columns):
                total = total + coverage[s, x]
                value = wp.min(wp.max(total, -one), one)
                if rule == constants.EVENODD:
                    for y in range(constants.TILE):
                        value[y] = fold(total[y])
                coverage[s, x] = value
        else:
            total = float(slot_winding[s]) * one


@wp.func
def sum_row(
    pixels: wp.array2d[wp.float32],
    first: wp.int32,
    last: wp.int32,
    row: wp.int32,
    rule: wp.int32,
    winding: wp.int32,
):
    """Compute prefix sums along one row of the slots [first, last), all PARTIAL, clamped or folded.

    ``winding``: the winding number left of them.
    """
    total = float(winding)
    for s in range(first, last):
        for x in range(constants.TILE):
            total += pixels[s, constants.TILE * x + row]
            value = wp.clamp(total, -1.0, 1.0)
            if rule == constants.EVENODD:
                value = fold(total)
            pixels[s, constants.TILE * x + row] = value


@wp.func
def keep_slopes(
    pixels: wp.array2d[wp.float32],
    slot_state: wp.array[wp.int32],
    first: wp.int32,
    last: wp.int32,
    row: wp.int32,
    rows: wp.int32,
):
    """Make coverages of ALIGNED slots positive and never quite 0 or 1, so that they have a gradient."""
    for s in range(first, last):
        if slot_state[s] & constants.ALIGNED != 0:
            columns = int(constants.TILE)  # not unrolled, which takes registers
            for x in range(columns):
                for p in range(constants.TILE * x + row, constants.TILE * x + row + rows):
                    pixels[s, p] = wp.clamp(wp.abs(pixels[s, p]), constants.NEARLY_NONE, constants.NEARLY_ALL)


@functools.cache
def make_forward(column: Any) -> wp.Kernel:
    """Return the kernel that computes coverages, for vectors of type ``column``.

    A thread has a row of tiles, by whole columns; or, where there are many threads, one row of pixels of a
    run of PARTIAL slots in it. No edge touches the slot left of a run, whose winding number stands for it.
    """
    by_rows = column is not tile_column
    lane_rows = 1 if by_rows else constants.TILE

    @wp.kernel(name="fill_forward", module="unique", module_options=constants.MODULE_OPTIONS)
    def fill_forward(
        # In:
        offset: wp.int32,
        own_part: wp.int32,  # of the shapes to cover
        part: wp.array[wp.int32],  # [shape_count]
        rule: wp.array[wp.int32],  # [shape_count] NONZERO or EVENODD
        slot_shape: wp.array[wp.int32],  # [slot_capacity] -1: unused
        slot_range: wp.array[wp.vec2i],  # [shape_count]
        slot_state: wp.array[wp.int32],  # [slot_capacity]
        slot_winding: wp.array[wp.int32],  # [slot_capacity]
        shape_tiles: wp.array2d[wp.int32],  # [shape_count, 4]
        vertex_range: wp.array[wp.vec2i],  # [shape_count]
        vertex_next: wp.array[wp.int32],  # [vertex_capacity] where the edge that starts here ends
        vertex: wp.array[wp.vec2],  # [vertex_capacity] px
        reach: wp.array[wp.vec2],  # [vertex_capacity / EDGE_BLOCK] px
        # Out:
        coverage: wp.array2d[column],  # [slot_capacity, columns] in [-1, 1], signed where not ALIGNED
        coverage_pixels: wp.array2d[wp.float32],  # [slot_capacity, TILE_PIXELS] the same memory
    ):
        """Compute the coverage of PARTIAL slots, in rows or runs with a visible one. One thread a row of
        tiles of a shape (that of its leftmost slot), or a run (likewise) and lane.
        """
        i, lane = wp.tid()
        slot = offset + i
        tiles = wp.vec2i(0, 0)
        if by_rows:
            tiles = partial_run(slot, slot_shape, slot_range, slot_state, shape_tiles)
            if tiles[0] == tiles[1]:
                return
            slot -= tiles[0]
        row = tile_row(slot, slot_shape, slot_range, shape_tiles)
        shape = row[0]
        if shape < 0:
            return
        if part[shape] != own_part:
            return
        if not by_rows:
            tiles[1] = row[2]
        first_slot = slot + tiles[0]
        end = slot + tiles[1]
        if not any_visible(slot_state, first_slot, end):
            return
        for s in range(first_slot, end):
            if slot_state[s] & constants.PARTIAL == constants.PARTIAL:
                for x in range(constants.TILE):
                    if by_rows:
                        coverage_pixels[s, constants.TILE * x + lane] = 0.0
                    else:
                        coverage[s, x] = column(0.0)
        columns = constants.TILE * tiles
        top = constants.TILE * row[3]
        row_first = top + lane * lane_rows
        left = float(constants.TILE * row[1])
        first = vertex_range[shape][0]
        last = vertex_range[shape][1]
        while first < last:
            block = first / constants.EDGE_BLOCK
            stop = wp.min(constants.EDGE_BLOCK * (block + 1), last)
            if reach[block][0] <= float(row_first + lane_rows) and reach[block][1] >= float(row_first):
                for j in range(first, stop):
                    a = vertex[j]
                    b = vertex[vertex_next[j]]
                    if by_rows:
                        if wp.min(a[0], b[0]) - left > float(columns[1]):
                            continue
                        if columns[0] > 0 and wp.max(a[0], b[0]) - left < float(columns[0]):
                            continue
                    add_edge(
                        coverage_pixels,
                        slot,
                        a,
                        b,
                        left,
                        constants.TILE * row[2],
                        top,
                        row_first,
                        row_first + lane_rows,
                        columns,
                    )
            first = stop
        if by_rows:
            winding = int(0)
            if first_slot > slot:
                winding = slot_winding[first_slot - 1]
            sum_row(coverage_pixels, first_slot, end, lane, rule[shape], winding)
        else:
            sum_columns(coverage, slot_state, slot_winding, slot, end, rule[shape])
        keep_slopes(coverage_pixels, slot_state, first_slot, end, row_first - top, lane_rows)

    return fill_forward
