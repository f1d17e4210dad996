"""Shapes -> soft Gaussians (the paper's own model), and the adjoint.

Fills are the strips of ``grid.fill``. A stroke is one row of Gaussians along its course, whose scale across
is learnt: the stroke's width. With Dx and Dr the differences along and across rows, as in ``grid.gaussians``:

    scale_x^2 = (SPREAD straightness |Dx|)^2 + softness^2 + PIXEL_VARIANCE
    scale_y^2 = (SPREAD cross(Dx, Dr) / |Dx|)^2 + (WIDTH_SIGMA width)^2 + softness^2 + PIXEL_VARIANCE

Dr is 0 for strokes, width is 0 for fills. Grids are planned and the softness is counted in canvas units: at
any scale it is the same picture, seen through the area of a pixel.

What each Gaussian lets through is its own: its **strength** is the opacity of its shape, or of its third of a
stroke, inside the product over the shape's Gaussians (paper eq. 8 and 9: a shape's Gaussians share one depth,
and so lie side by side in the order of blending).
"""

import warp as wp

from warpsplat.kernels import constants
from warpsplat.kernels.bezier import cross, cubic_weights
from warpsplat.paper import constants as paper
from warpsplat.paper.kernels.gaussians import (
    conic_adjoint,
    conic_and_extent,
    difference_grads,
    differences_at,
)
from warpsplat.paper.kernels.strips import Place, ShapeGrid, make_grid_forward
from warpsplat.paper.kernels.stroke import weighted_point

wp.set_module_options(constants.MODULE_OPTIONS)


@wp.func
def soft_stroke_position(points: wp.array[wp.vec2], p: Place, grid: ShapeGrid) -> wp.vec2:
    """X(k) = B(t_k) (paper eq. 3), t_k at the middle of its cell."""
    each = grid.stations / (p.count / 3)
    weights = cubic_weights((float(p.station % each) + 0.5) / float(each))
    return weighted_point(points, p.start + 3 * (p.station / each), weights)


soft_stroke_forward = make_grid_forward("soft_stroke_forward", constants.STROKE, soft_stroke_position)


@wp.func
def third(station: wp.int32, stations: wp.int32) -> wp.int32:
    """The third of a stroke that a station lies in; of three cubics, the cubic."""
    return 3 * station / stations


@wp.kernel
def soft_gaussians_forward(
    # In:
    offset: wp.int32,
    widths: wp.array[wp.float32],  # [shape_count] canvas units, 0 for fills
    opacities: wp.array[wp.float32],  # [shape_count]
    fades: wp.array[wp.vec3],  # [shape_count] what is added to a stroke's opacity by thirds
    scale: wp.float32,
    softness: wp.float32,  # canvas units
    gaussian_shape: wp.array[wp.int32],  # [gaussian_capacity] -1: unused
    gaussian_range: wp.array[wp.vec2i],  # [shape_count]
    shape_grid: wp.array[ShapeGrid],  # [shape_count]
    mean: wp.array[wp.vec2],  # [gaussian_capacity] px
    # Out:
    conic: wp.array[wp.vec3],  # [gaussian_capacity] (a, b, c) of q = a dx^2 + 2 b dx dy + c dy^2, px^-2
    extent: wp.array[wp.vec2],  # [gaussian_capacity] px, half size of the box where q <= cut
    cut: wp.array[wp.float32],  # [gaussian_capacity] the q beyond which a Gaussian is 0
    strength: wp.array[wp.float32],  # [gaussian_capacity] peak, in [0, GAUSSIAN_MAX]
):
    """See the module. One thread a Gaussian."""
    i = offset + wp.tid()
    shape = gaussian_shape[i]
    if shape < 0:
        return
    grid = shape_grid[shape]
    index = i - gaussian_range[shape][0]
    dx, dr, straight = differences_at(mean, i, index, grid)
    length = wp.length(dx)
    reach = paper.SPREAD * straight * length
    e = wp.vec2(1.0, 0.0)
    if length >= constants.EPSILON:
        e = dx / length
    across = paper.SPREAD * cross(e, dr)
    half = paper.WIDTH_SIGMA * scale * widths[shape]
    least = scale * scale * softness * softness + paper.PIXEL_VARIANCE
    inverse, box = conic_and_extent(
        e, reach * reach + least, across * across + half * half + least, paper.Q_SOFT
    )
    conic[i] = inverse
    cut[i] = paper.Q_SOFT
    extent[i] = box
    opacity = opacities[shape] + fades[shape][third(index % grid.stations, grid.stations)]
    strength[i] = paper.GAUSSIAN_MAX * wp.clamp(opacity, 0.0, 1.0)


@wp.kernel
def soft_differences_backward(
    # In:
    offset: wp.int32,
    widths: wp.array[wp.float32],  # [shape_count] canvas units
    scale: wp.float32,
    softness: wp.float32,
    gaussian_shape: wp.array[wp.int32],  # [gaussian_capacity] -1: unused
    gaussian_range: wp.array[wp.vec2i],  # [shape_count]
    shape_grid: wp.array[ShapeGrid],  # [shape_count]
    mean: wp.array[wp.vec2],  # [gaussian_capacity] px
    conic_grad: wp.array[wp.vec3],  # [gaussian_capacity] (of a, b, c)
    through_scales: wp.float32,  # 1: gradients flow through scales and angles; 0: detached, as the reference
    fold_factor: wp.float32,  # weight of the folded area [per px squared]
    # Out:
    along_grad: wp.array[wp.vec2],  # [gaussian_capacity] of Dx
    across_grad: wp.array[wp.vec2],  # [gaussian_capacity] of Dr
    gaussian_width_grad: wp.array[wp.float32],  # [gaussian_capacity] each Gaussian's share in the width's
):
    """As ``gaussians.differences_backward``, which derives it, with the width's part of scale_y:
    d width = -2 iy^2 d iy WIDTH_SIGMA^2 scale^2 width. The width's gradient flows always.
    """
    i = offset + wp.tid()
    shape = gaussian_shape[i]
    if shape < 0:
        return
    grid = shape_grid[shape]
    index = i - gaussian_range[shape][0]
    dx, dr, straight = differences_at(mean, i, index, grid)
    length = wp.length(dx)
    e = wp.vec2(1.0, 0.0)
    if length >= constants.EPSILON:
        e = dx / length
    h = wp.dot(wp.vec2(-e[1], e[0]), dr)
    reach = paper.SPREAD * straight * length
    half = paper.WIDTH_SIGMA * scale * widths[shape]
    least = scale * scale * softness * softness + paper.PIXEL_VARIANCE
    ix = 1.0 / (reach * reach + least)
    iy = 1.0 / (paper.SPREAD * paper.SPREAD * h * h + half * half + least)
    g = conic_adjoint(e, conic_grad[i])
    variance_grad = -iy * iy * g[1]
    gaussian_width_grad[i] = 2.0 * paper.WIDTH_SIGMA * scale * half * variance_grad
    along = wp.vec2(0.0, 0.0)
    across = wp.vec2(0.0, 0.0)
    if length >= constants.EPSILON:
        length_grad = -2.0 * paper.SPREAD * straight * reach * ix * ix * (through_scales * g[0])
        h_grad = 2.0 * paper.SPREAD * paper.SPREAD * h * (through_scales * variance_grad)
        fold = fold_factor * grid.sign
        angle_grad = (ix - iy) * (through_scales * g[2])
        along, across = difference_grads(dx, dr, length_grad, h_grad, angle_grad, fold)
    along_grad[i] = along
    across_grad[i] = across


@wp.kernel
def soft_stroke_backward(
    # In:
    offset: wp.int32,
    kind: wp.array[wp.int32],  # [shape_count]
    point_first: wp.array[wp.int32],  # [shape_count + 1]
    point_shape: wp.array[wp.int32],  # [point_count]
    scale: wp.float32,
    gaussian_range: wp.array[wp.vec2i],  # [shape_count]
    shape_grid: wp.array[ShapeGrid],  # [shape_count]
    position_grad: wp.array[wp.vec2],  # [gaussian_capacity]
    # Out:
    points_grad: wp.array[wp.vec2],  # [point_count] written
):
    """A gather, one thread a control point: the sum over stations of Bernstein weight x gradient."""
    i = offset + wp.tid()
    shape = point_shape[i]
    if kind[shape] != constants.STROKE:
        return
    gaussians = gaussian_range[shape]
    point = i - point_first[shape]
    segments = (point_first[shape + 1] - point_first[shape]) / 3
    total = wp.vec2(0.0, 0.0)
    if gaussians[1] > gaussians[0]:
        stations = shape_grid[shape].stations
        each = stations / segments
        for station in range(stations):
            j = point - 3 * (station / each)
            if j >= 0 and j <= 3:
                weights = cubic_weights((float(station % each) + 0.5) / float(each))
                total += weights[j] * position_grad[gaussians[0] + station]
    points_grad[i] = scale * total


@wp.kernel
def soft_shapes_backward(
    # In:
    offset: wp.int32,
    opacities: wp.array[wp.float32],  # [shape_count]
    fades: wp.array[wp.vec3],  # [shape_count]
    gaussian_range: wp.array[wp.vec2i],  # [shape_count]
    shape_grid: wp.array[ShapeGrid],  # [shape_count]
    strength_grad: wp.array[wp.float32],  # [gaussian_capacity]
    gaussian_width_grad: wp.array[wp.float32],  # [gaussian_capacity]
    # Out:
    opacities_grad: wp.array[wp.float32],  # [shape_count] written, over what compositing left
    fades_grad: wp.array[wp.vec3],  # [shape_count] written
    widths_grad: wp.array[wp.float32],  # [shape_count] written
):
    """One thread a shape sums over its Gaussians. Where an opacity with its fade lies outside [0, 1], only a
    gradient that leads back counts.
    """
    shape = offset + wp.tid()
    gaussians = gaussian_range[shape]
    stations = shape_grid[shape].stations
    width = float(0.0)
    sums = wp.vec3(0.0, 0.0, 0.0)
    for i in range(gaussians[0], gaussians[1]):
        k = third((i - gaussians[0]) % stations, stations)
        sums[k] = sums[k] + paper.GAUSSIAN_MAX * strength_grad[i]
        width += gaussian_width_grad[i]
    for k in range(3):
        opacity = opacities[shape] + fades[shape][k]
        if opacity > 1.0:
            sums[k] = wp.max(sums[k], 0.0)
        if opacity < 0.0:
            sums[k] = wp.min(sums[k], 0.0)
    opacities_grad[shape] = sums[0] + sums[1] + sums[2]
    fades_grad[shape] = sums
    widths_grad[shape] = width
