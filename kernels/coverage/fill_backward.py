"""Adjoint of the coverage of polygons: from coverages to their vertices.

A piece of an edge with extent (dx, dy), moved by v, changes its pixel's area by dx v_y - dy v_x and no other
pixel's. The edge's ends take (1 - s) and s of it, s the edge's parameter at the middle of the piece.

An edge on a border of pixels changes the pixel that it moves into; its derivative is the mean of those to
either side. The sums there are whole numbers, where the derivative of a coverage jumps, so that the slope is
taken from the winding numbers beside each edge of slots with such an edge (ALIGNED).
"""

import warp as wp

from warpsplat.kernels import constants
from warpsplat.kernels.coverage.fill import crossing, has_borders, is_partial, on_border

wp.set_module_options(constants.MODULE_OPTIONS)

TILE_LAST = wp.constant(constants.TILE - 1)
TILE_BITS = wp.constant(constants.TILE.bit_length() - 1)  # of a pixel within its tile
NEVER = wp.constant(4.0)  # beyond the parameters of an edge, which are 0 to 1
BESIDE = wp.constant(1.0e-3)  # [px] distance from an edge at which winding numbers are those beside it


@wp.func
def inside_box(a: wp.vec2, d: wp.vec2, box: wp.vec4) -> wp.vec2:
    """Return the parameters between which the edge from ``a`` along ``d`` is inside a box (left, top, right,
    bottom); first > second: none.
    """
    s = float(0.0)
    s_end = float(1.0)
    for axis in range(2):
        if d[axis] != 0.0:
            s0 = (box[axis] - a[axis]) / d[axis]
            s1 = (box[axis + 2] - a[axis]) / d[axis]
            s = wp.max(s, wp.min(s0, s1))
            s_end = wp.min(s_end, wp.max(s0, s1))
        elif a[axis] < box[axis] or a[axis] >= box[axis + 2]:
            s_end = -1.0
    return wp.vec2(s, s_end)


@wp.func
def leaves_at(border: wp.int32, a: wp.float32, d: wp.float32, inverse: wp.float32) -> wp.float32:
    """Return the parameter at which an edge from ``a`` along ``d`` reaches a border; NEVER where it does
    not.
    """
    if d == 0.0:
        return NEVER
    return (float(border) - a) * inverse


@wp.func
def winding_of_edge(a: wp.vec2, b: wp.vec2, p: wp.vec2) -> wp.int32:
    """Return what an edge adds to the winding number of the point ``p``."""
    turn = crossing(a, b, p[1])
    if turn != 0:
        if a[0] + (b[0] - a[0]) / (b[1] - a[1]) * (p[1] - a[1]) >= p[0]:
            turn = 0
    return turn


@wp.func
def covers(winding: wp.int32, rule: wp.int32) -> wp.float32:
    """Return 1 where a winding number is that of the inside, else 0."""
    if rule == constants.NONZERO:
        return float(wp.min(wp.abs(winding), 1))
    return float(winding & 1)


@wp.func
def slopes_beside(
    vertex: wp.array[wp.vec2],
    vertex_next: wp.array[wp.int32],
    vertices: wp.vec2i,
    rule: wp.int32,
    p: wp.vec2,
    d: wp.vec2,
) -> wp.vec2:
    """Return half of what a coverage gains by the signed area that an edge along ``d``, moved at ``p``, gains
    on its one side and then on the other.

    ``vertices``: the shape's, first and last. Where the edge goes down, its first side is the left one: there
    the winding number is about to be one more.
    """
    aside = (BESIDE / (wp.abs(d[0]) + wp.abs(d[1]))) * wp.vec2(-d[1], d[0])
    before = int(0)
    after = int(0)
    for j in range(vertices[0], vertices[1]):
        a = vertex[j]
        b = vertex[vertex_next[j]]
        before += winding_of_edge(a, b, p + aside)
        after += winding_of_edge(a, b, p - aside)
    return 0.5 * wp.vec2(
        covers(before + 1, rule) - covers(before, rule), covers(after, rule) - covers(after - 1, rule)
    )


@wp.func
def gradient_at(
    sum_grad: wp.array2d[wp.float32],
    slot_state: wp.array[wp.int32],
    first: wp.int32,
    size: wp.vec2i,
    x: wp.int32,
    y: wp.int32,
) -> wp.float32:
    """Return the gradient in a pixel of a shape whose slots begin with ``first``, 0 where there is none.

    ``size``: of the shape's tiles [px], from whose corner ``x`` and ``y`` are counted.
    """
    if x < 0 or y < 0 or x >= size[0] or y >= size[1]:
        return 0.0
    slot = first + (y >> TILE_BITS) * (size[0] >> TILE_BITS) + (x >> TILE_BITS)
    if not is_partial(slot_state[slot]):
        return 0.0
    return sum_grad[slot, constants.TILE * (x & TILE_LAST) + (y & TILE_LAST)]


@wp.func
def is_upright(d: wp.vec2) -> wp.bool:
    """Return whether an edge that lies on a border of pixels lies on an upright one."""
    return wp.abs(d[1]) >= wp.abs(d[0])


@wp.func
def sums_along_border(
    sum_grad: wp.array2d[wp.float32],
    slot_state: wp.array[wp.int32],
    first: wp.int32,
    size: wp.vec2i,
    vertex: wp.array[wp.vec2],
    vertex_next: wp.array[wp.int32],
    vertices: wp.vec2i,
    rule: wp.int32,
    start: wp.vec2,
    corner: wp.vec2,
    d: wp.vec2,
) -> wp.vec2:
    """Return the sum, over the pixels on both sides of an edge on their border, of gradient x part of the
    edge, and the same x parameter at the middle of that part.

    ``start``: where the edge begins; ``corner``: that of the shape's tiles; see ``gradient_at`` for others.
    """
    upright = is_upright(d)
    border = int(wp.floor(wp.where(upright, start[0] - corner[0], start[1] - corner[1]) + 0.5))
    a = wp.where(upright, start[1] - corner[1], start[0] - corner[0])
    length = wp.where(upright, d[1], d[0])
    # The pixels on the side where the edge, moved there, adds to the area come first.
    before = border
    if upright == (length > 0.0):
        before = border - 1
    after = 2 * border - 1 - before
    low = wp.max(wp.min(a, a + length), 0.0)
    high = wp.min(wp.max(a, a + length), float(wp.where(upright, size[1], size[0])))
    area = float(0.0)
    moment = float(0.0)
    for k in range(int(low), int(wp.ceil(high))):
        top = wp.max(float(k), low)
        bottom = wp.min(float(k + 1), high)
        s = (0.5 * (top + bottom) - a) / length
        slopes = slopes_beside(vertex, vertex_next, vertices, rule, start + s * d, d)
        x = wp.where(upright, before, k)
        y = wp.where(upright, k, before)
        g = slopes[0] * gradient_at(sum_grad, slot_state, first, size, x, y)
        x = wp.where(upright, after, k)
        y = wp.where(upright, k, after)
        g += slopes[1] * gradient_at(sum_grad, slot_state, first, size, x, y)
        part = (bottom - top) / wp.abs(length)
        area += g * part
        moment += g * part * s
    return wp.vec2(area, moment)


@wp.kernel
def fill_backward(
    # In:
    offset: wp.int32,
    own_part: wp.int32,  # of the shapes to cover
    part: wp.array[wp.int32],  # [shape_count]
    rule: wp.array[wp.int32],  # [shape_count] NONZERO or EVENODD
    vertex_shape: wp.array[wp.int32],  # [vertex_capacity]
    vertex_ends: wp.array[wp.int32],  # [shape_count] end of each shape's vertices
    vertex_range: wp.array[wp.vec2i],  # [shape_count]
    slot_range: wp.array[wp.vec2i],  # [shape_count]
    slot_state: wp.array[wp.int32],  # [slot_capacity]
    shape_tiles: wp.array2d[wp.int32],  # [shape_count, 4]
    vertex_next: wp.array[wp.int32],  # [vertex_capacity] where the edge that starts here ends
    vertex: wp.array[wp.vec2],  # [vertex_capacity] px
    sum_grad: wp.array2d[wp.float32],  # [slot_capacity, TILE_PIXELS] of the area, not clamped; by column
    # Out:
    start_grad: wp.array[wp.vec2],  # [vertex_capacity] of the first end of the edge that starts here
    end_grad: wp.array[wp.vec2],  # [vertex_capacity] of its second end
):
    """Compute the gradients of an edge's ends along the pixels that it crosses. One thread an edge."""
    i = offset + wp.tid()
    if i >= vertex_ends[vertex_ends.shape[0] - 1]:
        return
    shape = vertex_shape[i]
    vertices = vertex_range[shape]
    if part[shape] != own_part or i < vertices[0] or i >= vertices[1]:
        return
    at_start = wp.vec2(0.0, 0.0)
    at_end = wp.vec2(0.0, 0.0)
    start = vertex[i]
    d = vertex[vertex_next[i]] - start
    slots = slot_range[shape]
    if slots[1] > slots[0] and wp.abs(d[0]) + wp.abs(d[1]) > 0.0:
        # From here on, pixels are counted from the corner of the shape's tiles. Those of them that lie
        # outside the canvas have no gradient.
        across = shape_tiles[shape, 2] - shape_tiles[shape, 0]
        wide = constants.TILE * across
        high = constants.TILE * (shape_tiles[shape, 3] - shape_tiles[shape, 1])
        corner = float(constants.TILE) * wp.vec2(float(shape_tiles[shape, 0]), float(shape_tiles[shape, 1]))
        a = start - corner
        sums = wp.vec2(0.0, 0.0)
        along = wp.where(is_upright(d), 0, 1)
        if has_borders(vertices) and on_border(start[along], start[along] + d[along]):
            size = wp.vec2i(wide, high)
            sums = sums_along_border(
                sum_grad,
                slot_state,
                slots[0],
                size,
                vertex,
                vertex_next,
                vertices,
                rule[shape],
                start,
                corner,
                d,
            )
        else:
            span = inside_box(a, d, wp.vec4(0.0, 0.0, float(wide), float(high)))
            s = span[0]
            s_end = span[1]
            x = wp.clamp(int(wp.floor(a[0] + s * d[0])), 0, wide - 1)
            y = wp.clamp(int(wp.floor(a[1] + s * d[1])), 0, high - 1)
            # The way to the next pixel, and from a pixel to its border on that side.
            step_x = int(wp.sign(d[0]))
            step_y = int(wp.sign(d[1]))
            ahead_x = (step_x + 1) / 2
            ahead_y = (step_y + 1) / 2
            inverse_x = 1.0 / d[0]
            inverse_y = 1.0 / d[1]
            s_x = leaves_at(x + ahead_x, a[0], d[0], inverse_x)
            s_y = leaves_at(y + ahead_y, a[1], d[1], inverse_y)
            first = slots[0]
            area = float(0.0)
            moment = float(0.0)
            while s < s_end and x >= 0 and x < wide and y >= 0 and y < high:
                s_next = wp.max(wp.min(wp.min(s_x, s_y), s_end), s)
                slot = first + (y >> TILE_BITS) * across + (x >> TILE_BITS)
                state = slot_state[slot]
                if is_partial(state):
                    g = sum_grad[slot, constants.TILE * (x & TILE_LAST) + (y & TILE_LAST)] * (s_next - s)
                    if state & constants.ALIGNED != 0:
                        middle = start + 0.5 * (s + s_next) * d
                        slopes = slopes_beside(vertex, vertex_next, vertices, rule[shape], middle, d)
                        g *= slopes[0] + slopes[1]
                    area += g
                    moment += g * (s + s_next)
                s = s_next
                if s_x < s_y:
                    x += step_x
                    s_x = (float(x + ahead_x) - a[0]) * inverse_x
                else:
                    y += step_y
                    s_y = (float(y + ahead_y) - a[1]) * inverse_y
            sums = wp.vec2(area, 0.5 * moment)
        move = wp.vec2(-d[1], d[0])
        at_start = (sums[0] - sums[1]) * move
        at_end = sums[1] * move
    start_grad[i] = at_start
    end_grad[i] = at_end
