"""Grid positions -> Gaussians (position, scale, angle, and what rasterisation needs), and the adjoint.

With Dx the central difference of neighbours along a row and Dr that across rows:

    scale_x = sqrt((SPREAD straightness |Dx|)^2 + PIXEL_SIGMA^2)         paper eq. 6, straightness = 1
    scale_y = sqrt((SPREAD cross(Dx, Dr) / |Dx|)^2 + PIXEL_SIGMA^2)      the shape of Dr across the row
    angle   = atan2(Dx.y, Dx.x)                                          paper eq. 7

The paper takes |Dr| for scale_y. Where the grid is sheared (near the ends of a closed curve, where the
chains run towards each other) that makes Gaussians reach far out of the shape; the perpendicular shape
does not, and covers the same cells. Where a row turns sharply (it does where an outline has a corner),
a Gaussian as long as the spacing would reach out of the shape: its length shrinks with the straightness,
the squared cosine of the turn. The straightness is taken as a constant by the adjoint.
"""

import warp as wp

from warpsplat.kernels import constants
from warpsplat.kernels.bezier import cross
from warpsplat.paper import constants as paper
from warpsplat.paper.kernels.strips import ShapeGrid

wp.set_module_options(constants.MODULE_OPTIONS)


@wp.func
def difference_weight(index: wp.int32, neighbour: wp.int32, count: wp.int32) -> wp.float32:
    """Weight of position ``neighbour`` in the difference at ``index`` of ``count`` (>= 2) positions."""
    weight = float(0.0)
    if neighbour == wp.min(index + 1, count - 1):
        weight += 0.5
    if neighbour == wp.max(index - 1, 0):
        weight -= 0.5
    return weight


@wp.func
def difference(
    values: wp.array[wp.vec2], i: wp.int32, stride: wp.int32, index: wp.int32, count: wp.int32
) -> wp.vec2:
    """Central difference at entry ``i``, number ``index`` of ``count`` entries ``stride`` apart. At an
    end the entry stands for its missing neighbour: the last Gaussians reach half as far out.
    """
    low = wp.max(index - 1, 0)
    high = wp.min(index + 1, count - 1)
    return 0.5 * (values[i + (high - index) * stride] - values[i + (low - index) * stride])


@wp.func
def straightness(values: wp.array[wp.vec2], i: wp.int32, index: wp.int32, count: wp.int32) -> wp.float32:
    """Squared cosine of the turn at entry ``i``, number ``index`` of ``count``, 0 for right angles and more,
    1 at an end.
    """
    if index == 0 or index == count - 1:
        return 1.0
    before = values[i] - values[i - 1]
    after = values[i + 1] - values[i]
    lengths = wp.length(before) * wp.length(after)
    if lengths < constants.EPSILON * constants.EPSILON:
        return 1.0
    cosine = wp.max(wp.dot(before, after) / lengths, 0.0)
    return cosine * cosine


@wp.func
def differences_at(mean: wp.array[wp.vec2], i: wp.int32, index: wp.int32, grid: ShapeGrid):
    """Return Dx, Dr and the straightness at Gaussian ``i``, number ``index`` of its shape."""
    run = grid.stations / grid.runs
    station = (index % grid.stations) % run
    dx = difference(mean, i, 1, station, run)
    dr = difference(mean, i, grid.stations, index / grid.stations, grid.rows)
    return dx, dr, straightness(mean, i, station, run)


@wp.func
def conic_and_extent(e: wp.vec2, variance_x: wp.float32, variance_y: wp.float32, cut: wp.float32):
    """Return the inverse covariance of a Gaussian along the unit vector ``e``, and the half size of the box
    where q <= ``cut``.
    """
    ix = 1.0 / variance_x
    iy = 1.0 / variance_y
    cc = e[0] * e[0]
    ss = e[1] * e[1]
    cs = e[0] * e[1]
    return (
        wp.vec3(cc * ix + ss * iy, cs * (ix - iy), ss * ix + cc * iy),
        wp.vec2(
            wp.sqrt(cut * (cc * variance_x + ss * variance_y)),
            wp.sqrt(cut * (ss * variance_x + cc * variance_y)),
        ),
    )


@wp.func
def conic_adjoint(e: wp.vec2, g: wp.vec3) -> wp.vec3:
    """Return the gradients of ix, of iy, and of the angle over ix - iy from those of (a, b, c)."""
    cc = e[0] * e[0]
    ss = e[1] * e[1]
    cs = e[0] * e[1]
    return wp.vec3(
        cc * g[0] + cs * g[1] + ss * g[2],
        ss * g[0] - cs * g[1] + cc * g[2],
        -2.0 * cs * g[0] + (cc - ss) * g[1] + 2.0 * cs * g[2],
    )


@wp.func
def difference_grads(
    dx: wp.vec2,
    dr: wp.vec2,
    length_grad: wp.float32,
    h_grad: wp.float32,
    angle_grad: wp.float32,
    fold: wp.float32,
):
    """Return the gradients of Dx and Dr; ``fold``: weight of the folded area x the outline's orientation."""
    length = wp.length(dx)
    e = dx / length
    n = wp.vec2(-e[1], e[0])
    along = length_grad * e + ((angle_grad - h_grad * wp.dot(e, dr)) / length) * n
    across = h_grad * n
    if fold * wp.dot(n, dr) < 0.0:
        along -= fold * wp.vec2(dr[1], -dr[0])
        across -= fold * wp.vec2(-dx[1], dx[0])
    return along, across


@wp.func
def variance(spacing: wp.float32) -> wp.float32:
    """Return a Gaussian's variance along one of its axes [px^2]."""
    reach = paper.SPREAD * paper.SPREAD * spacing * spacing
    return reach + paper.PIXEL_SIGMA * paper.PIXEL_SIGMA


@wp.kernel
def gaussians_forward(
    # In:
    offset: wp.int32,
    gaussian_shape: wp.array[wp.int32],  # [gaussian_capacity] -1: unused
    gaussian_range: wp.array[wp.vec2i],  # [shape_count]
    shape_grid: wp.array[ShapeGrid],  # [shape_count]
    mean: wp.array[wp.vec2],  # [gaussian_capacity] px
    # Out:
    conic: wp.array[wp.vec3],  # [gaussian_capacity] (a, b, c) of q = a dx^2 + 2 b dx dy + c dy^2, px^-2
    extent: wp.array[wp.vec2],  # [gaussian_capacity] px, half size of the box where q <= cut
    cut: wp.array[wp.float32],  # [gaussian_capacity] the q beyond which a Gaussian is 0
):
    """Scale, angle and inverse covariance (paper eq. 10 and 11) of each grid position."""
    i = offset + wp.tid()
    shape = gaussian_shape[i]
    if shape < 0:
        return
    grid = shape_grid[shape]
    index = i - gaussian_range[shape][0]
    dx, dr, straight = differences_at(mean, i, index, grid)
    length = wp.length(dx)
    e = wp.vec2(1.0, 0.0)
    across = wp.length(dr)
    if length >= constants.EPSILON:
        e = dx / length
        across = cross(e, dr)
    q_cut = float(paper.Q_INNER)
    if index < grid.stations or index / grid.stations == grid.rows - 1:
        q_cut = paper.Q_MAX
    cut[i] = q_cut
    inverse, box = conic_and_extent(e, variance(straight * length), variance(across), q_cut)
    conic[i] = inverse
    extent[i] = box


@wp.kernel
def differences_backward(
    # In:
    offset: wp.int32,
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
):
    """From dL/d(a, b, c) through 1 / scale^2 and the angle to Dx and Dr.

    With ix = scale_x^-2, iy = scale_y^-2, (c, s) the unit of Dx, n = (-s, c):
    d ix = c^2 da + cs db + s^2 dc;  d iy = s^2 da - cs db + c^2 dc;
    d angle = (ix - iy) (-2cs da + (c^2 - s^2) db + 2cs dc);
    ix = 1 / (SPREAD^2 |Dx|^2 + PIXEL_SIGMA^2), so d|Dx| = -2 SPREAD^2 |Dx| ix^2 d ix, iy likewise with
    h = n . Dr; h depends on the direction too: dh/d angle = -(c, s) . Dr.

    And from the fold loss, fold_factor * sum relu(-sign J) over grid points, J = cross(Dx, Dr) their cell's
    signed area: where the strip between the chains folds over, its cells turn round and splats cover what
    the path does not.
    """
    i = offset + wp.tid()
    shape = gaussian_shape[i]
    if shape < 0:
        return
    along_grad[i] = wp.vec2(0.0, 0.0)
    across_grad[i] = wp.vec2(0.0, 0.0)
    grid = shape_grid[shape]
    dx, dr, straight = differences_at(mean, i, i - gaussian_range[shape][0], grid)
    length = wp.length(dx)
    if length < constants.EPSILON:
        return
    e = dx / length
    h = wp.dot(wp.vec2(-e[1], e[0]), dr)
    reach = straight * length
    ix = 1.0 / variance(reach)
    iy = 1.0 / variance(h)
    g = conic_adjoint(e, through_scales * conic_grad[i])
    length_grad = -2.0 * paper.SPREAD * paper.SPREAD * straight * reach * ix * ix * g[0]
    h_grad = -2.0 * paper.SPREAD * paper.SPREAD * h * iy * iy * g[1]
    fold = fold_factor * grid.sign
    along, across = difference_grads(dx, dr, length_grad, h_grad, (ix - iy) * g[2], fold)
    along_grad[i] = along
    across_grad[i] = across


@wp.kernel
def positions_backward(
    # In:
    offset: wp.int32,
    gaussian_shape: wp.array[wp.int32],  # [gaussian_capacity] -1: unused
    gaussian_range: wp.array[wp.vec2i],  # [shape_count]
    shape_grid: wp.array[ShapeGrid],  # [shape_count]
    mean_grad: wp.array[wp.vec2],  # [gaussian_capacity]
    along_grad: wp.array[wp.vec2],  # [gaussian_capacity] of Dx
    across_grad: wp.array[wp.vec2],  # [gaussian_capacity] of Dr
    # Out:
    position_grad: wp.array[wp.vec2],  # [gaussian_capacity] of the grid positions
):
    """A gather: a position counts as a mean and in the differences at its neighbours and at itself."""
    i = offset + wp.tid()
    shape = gaussian_shape[i]
    if shape < 0:
        return
    grid = shape_grid[shape]
    run = grid.stations / grid.runs
    station = (i - gaussian_range[shape][0]) % grid.stations % run
    row = (i - gaussian_range[shape][0]) / grid.stations
    total = mean_grad[i]
    for k in range(wp.max(station - 1, 0), wp.min(station + 2, run)):
        total += difference_weight(k, station, run) * along_grad[i + k - station]
    for r in range(wp.max(row - 1, 0), wp.min(row + 2, grid.rows)):
        total += difference_weight(r, row, grid.rows) * across_grad[i + (r - row) * grid.stations]
    position_grad[i] = total
