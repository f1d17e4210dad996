"""Coverage -> image by front-to-back alpha blending (paper eq. 8, once a part), and the adjoint.

alpha = opacity x coverage; C = sum_i c_i alpha_i prod_{j<i} (1 - alpha_j) + background x what is left.
Both directions run front to back. The adjoint starts from total = dot(C, dL/dC), subtracts each part's own
share and so knows the share of all that lies behind, without stored lists:
dL/d alpha_i = T_i dot(c_i, G) - behind_i / (1 - alpha_i).
A coverage may come from splats or from any other model: this stage knows only slots. It takes the magnitude
(an exact fill stores which way round it is as a sign), and 1 throughout a slot whose state is FULL.
"""

import warp as wp

from warpsplat.kernels import constants

wp.set_module_options({"enable_backward": False})

TILE = wp.constant(constants.TILE)
TRANSMITTANCE_MIN = wp.constant(constants.TRANSMITTANCE_MIN)
FULL = wp.constant(constants.FULL)


@wp.kernel
def composite_forward(
    # In:
    first: wp.int32,
    lane_rows: wp.int32,  # pixel rows of a tile that a thread handles
    tiles_x: wp.int32,
    tile_first: wp.array[wp.int32],  # [tile_count]
    tile_last: wp.array[wp.int32],  # [tile_count]
    sort_slots: wp.array[wp.int32],  # [2 x slot_capacity] slots by tile, front to back
    slot_part: wp.array[wp.int32],  # [slot_capacity]
    slot_seen: wp.array2d[wp.int32],  # [slot_capacity, lanes] 0 empty, 1 partly covered, FULL
    coverage: wp.array2d[wp.float32],  # [slot_capacity, TILE_PIXELS]
    opacity_count: wp.int32,
    colors: wp.array[wp.vec3],  # [curve_count]
    opacities: wp.array2d[wp.float32],  # [curve_count, opacity_count]
    background: wp.vec3,
    # Out:
    image: wp.array2d[wp.vec3],  # [height, width]
    transmittance: wp.array2d[wp.float32],  # [height, width] light left behind the last part
):
    """One thread a tile and lane; a lane stops when no light passes any of its pixels."""
    i, lane = wp.tid()
    tile = first + i
    x0 = TILE * (tile % tiles_x)
    y0 = TILE * (tile / tiles_x)
    x1 = wp.min(x0 + TILE, image.shape[1])
    row_first = y0 + lane * lane_rows
    row_last = wp.min(row_first + lane_rows, image.shape[0])
    for y in range(row_first, row_last):
        for x in range(x0, x1):
            image[y, x] = wp.vec3(0.0, 0.0, 0.0)
            transmittance[y, x] = 1.0
    k = tile_first[tile]
    last = tile_last[tile]
    while k < last:
        slot = sort_slots[k]
        k += 1
        state = slot_seen[slot, lane]
        if state != 0:
            part = slot_part[slot]
            curve = part / opacity_count
            color = colors[curve]
            opacity = opacities[curve, part % opacity_count]
            light = float(0.0)
            for y in range(row_first, row_last):
                base = (y - y0) * TILE - x0
                for x in range(x0, x1):
                    t = transmittance[y, x]
                    if t > TRANSMITTANCE_MIN:
                        alpha = opacity
                        if state != FULL:
                            alpha = opacity * wp.abs(coverage[slot, base + x])
                        image[y, x] = image[y, x] + (t * alpha) * color
                        t = t * (1.0 - alpha)
                        transmittance[y, x] = t
                        light = wp.max(light, t)
            if light <= TRANSMITTANCE_MIN:
                k = last
    for y in range(row_first, row_last):
        for x in range(x0, x1):
            image[y, x] = image[y, x] + transmittance[y, x] * background


@wp.kernel
def composite_backward(
    # In:
    first: wp.int32,
    lane_rows: wp.int32,
    tiles_x: wp.int32,
    tile_first: wp.array[wp.int32],  # [tile_count]
    tile_last: wp.array[wp.int32],  # [tile_count]
    sort_slots: wp.array[wp.int32],  # [2 x slot_capacity]
    slot_part: wp.array[wp.int32],  # [slot_capacity]
    slot_seen: wp.array2d[wp.int32],  # [slot_capacity, lanes] 0 empty, 1 partly covered, FULL
    coverage: wp.array2d[wp.float32],  # [slot_capacity, TILE_PIXELS]
    opacity_count: wp.int32,
    colors: wp.array[wp.vec3],  # [curve_count]
    opacities: wp.array2d[wp.float32],  # [curve_count, opacity_count]
    image: wp.array2d[wp.vec3],  # [height, width] of the forward pass
    image_grad: wp.array2d[wp.vec3],  # [height, width]
    # Out:
    transmittance: wp.array2d[wp.float32],  # [height, width] scratch
    behind: wp.array2d[wp.float32],  # [height, width] scratch: dot(colour still to come, image_grad)
    coverage_grad: wp.array2d[wp.float32],  # [slot_capacity, TILE_PIXELS] written for every listed slot
    slot_grad: wp.array2d[wp.vec4],  # [slot_capacity, lanes] of colour (3) and opacity
):
    """See the module; the same visits and the same stop as the forward pass."""
    i, lane = wp.tid()
    tile = first + i
    x0 = TILE * (tile % tiles_x)
    y0 = TILE * (tile / tiles_x)
    x1 = wp.min(x0 + TILE, image.shape[1])
    row_first = y0 + lane * lane_rows
    row_last = wp.min(row_first + lane_rows, image.shape[0])
    for y in range(row_first, row_last):
        for x in range(x0, x1):
            transmittance[y, x] = 1.0
            behind[y, x] = wp.dot(image[y, x], image_grad[y, x])
    light = float(1.0)
    for k in range(tile_first[tile], tile_last[tile]):
        slot = sort_slots[k]
        color_sum = wp.vec3(0.0, 0.0, 0.0)
        opacity_sum = float(0.0)
        state = slot_seen[slot, lane]
        if state != 0:
            part = slot_part[slot]
            curve = part / opacity_count
            color = colors[curve]
            opacity = opacities[curve, part % opacity_count]
            if light <= TRANSMITTANCE_MIN:
                for p in range(lane * lane_rows * TILE, (lane + 1) * lane_rows * TILE):
                    coverage_grad[slot, p] = 0.0
            else:
                light = float(0.0)
                for y in range(row_first, row_last):
                    base = (y - y0) * TILE - x0
                    for x in range(x0, x1):
                        t = transmittance[y, x]
                        alpha_grad = float(0.0)
                        if t > TRANSMITTANCE_MIN:
                            c = float(1.0)
                            if state != FULL:
                                c = wp.abs(coverage[slot, base + x])
                            alpha = opacity * c
                            g = image_grad[y, x]
                            share = t * wp.dot(color, g)
                            left = behind[y, x] - alpha * share
                            alpha_grad = share - left / (1.0 - alpha)
                            color_sum += (t * alpha) * g
                            opacity_sum += c * alpha_grad
                            behind[y, x] = left
                            t = t * (1.0 - alpha)
                            transmittance[y, x] = t
                            light = wp.max(light, t)
                        coverage_grad[slot, base + x] = opacity * alpha_grad
        slot_grad[slot, lane] = wp.vec4(color_sum[0], color_sum[1], color_sum[2], opacity_sum)


@wp.kernel
def reduce_slots(
    # In:
    first: wp.int32,
    opacity_count: wp.int32,
    slot_first: wp.array[wp.int32],  # [part_count]
    slot_last: wp.array[wp.int32],  # [part_count]
    slot_grad: wp.array2d[wp.vec4],  # [slot_capacity, lanes]
    # Out:
    colors_grad: wp.array[wp.vec3],  # [curve_count] written
    opacities_grad: wp.array2d[wp.float32],  # [curve_count, opacity_count] written
):
    """One thread a curve sums its slots in a fixed order: the same bits on every run."""
    curve = first + wp.tid()
    color_total = wp.vec3(0.0, 0.0, 0.0)
    for j in range(opacity_count):
        part = curve * opacity_count + j
        opacity_total = float(0.0)
        for slot in range(slot_first[part], slot_last[part]):
            for lane in range(slot_grad.shape[1]):
                g = slot_grad[slot, lane]
                color_total += wp.vec3(g[0], g[1], g[2])
                opacity_total += g[3]
        opacities_grad[curve, j] = opacity_total
    colors_grad[curve] = color_total


@wp.kernel
def removal_cost(
    # In:
    first: wp.int32,
    lane_rows: wp.int32,
    tiles_x: wp.int32,
    tile_first: wp.array[wp.int32],  # [tile_count]
    tile_last: wp.array[wp.int32],  # [tile_count]
    sort_slots: wp.array[wp.int32],  # [2 x slot_capacity]
    slot_part: wp.array[wp.int32],  # [slot_capacity]
    slot_seen: wp.array2d[wp.int32],  # [slot_capacity, lanes] 0 empty, 1 partly covered, FULL
    coverage: wp.array2d[wp.float32],  # [slot_capacity, TILE_PIXELS]
    opacity_count: wp.int32,
    colors: wp.array[wp.vec3],  # [curve_count]
    opacities: wp.array2d[wp.float32],  # [curve_count, opacity_count]
    image: wp.array2d[wp.vec3],  # [height, width] of the forward pass
    target: wp.array2d[wp.vec3],  # [height, width]
    # Out:
    transmittance: wp.array2d[wp.float32],  # [height, width] scratch
    rest: wp.array2d[wp.vec3],  # [height, width] scratch: light still to come
    slot_cost: wp.array2d[wp.float32],  # [slot_capacity, lanes] sum over pixels and channels
):
    """What the squared error would grow by if a part alone were taken away.

    Behind a part lies the colour b = rest / T; without it a pixel changes by d = T alpha (b - c), and its
    squared error by 2 d . (image - target) + d . d.
    """
    i, lane = wp.tid()
    tile = first + i
    x0 = TILE * (tile % tiles_x)
    y0 = TILE * (tile / tiles_x)
    x1 = wp.min(x0 + TILE, image.shape[1])
    row_first = y0 + lane * lane_rows
    row_last = wp.min(row_first + lane_rows, image.shape[0])
    for y in range(row_first, row_last):
        for x in range(x0, x1):
            transmittance[y, x] = 1.0
            rest[y, x] = image[y, x]
    for k in range(tile_first[tile], tile_last[tile]):
        slot = sort_slots[k]
        state = slot_seen[slot, lane]
        cost = float(0.0)
        if state != 0:
            part = slot_part[slot]
            color = colors[part / opacity_count]
            opacity = opacities[part / opacity_count, part % opacity_count]
            for y in range(row_first, row_last):
                for x in range(x0, x1):
                    t = transmittance[y, x]
                    if t > TRANSMITTANCE_MIN:
                        alpha = opacity
                        if state != FULL:
                            alpha = opacity * wp.abs(coverage[slot, (y - y0) * TILE + x - x0])
                        after = t * (1.0 - alpha)
                        left = rest[y, x] - (t * alpha) * color
                        change = (t * alpha) * (left / after - color)
                        cost += wp.dot(change, change + 2.0 * (image[y, x] - target[y, x]))
                        rest[y, x] = left
                        transmittance[y, x] = after
        slot_cost[slot, lane] = cost
