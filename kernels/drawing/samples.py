"""Where samples lie on cubics."""

import warp as wp

from warpsplat.kernels import constants
from warpsplat.kernels.drawing.cubic import TINY, nearest_at, point_at, polynomial, slope_at

wp.set_module_options(constants.MODULE_OPTIONS)


@wp.kernel
def along(
    # In:
    offset: wp.int32,
    cubics: wp.array[wp.vec2d],  # [4 x cubic] [px]
    first: wp.array[wp.int64],  # [cubic + 1]
    t: wp.array[wp.float64],  # [sample]
    share: wp.array[wp.float64],  # [sample] weight for each unit of speed
    # Out:
    place: wp.array[wp.vec2d],  # [sample] on the cubic [px]
    across: wp.array[wp.vec2d],  # [sample]
    weight: wp.array[wp.float64],  # [sample]
):
    """Lay samples on their own cubics. One thread a cubic."""
    i = offset + wp.tid()
    f = polynomial(cubics, i)
    for s in range(int(first[i]), int(first[i + 1])):
        ahead = slope_at(f, t[s])
        speed = wp.length(ahead)
        place[s] = point_at(f, t[s])
        across[s] = wp.vec2d(-ahead[1], ahead[0]) / wp.max(speed, TINY)
        weight[s] = share[s] * speed


@wp.kernel
def nearest(
    # In:
    offset: wp.int32,
    cubics: wp.array[wp.vec2d],  # [4 x cubic] [px]
    first: wp.array[wp.int64],  # [cubic + 1]
    place: wp.array[wp.vec2d],  # [sample] [px]
    rounds: wp.int32,
    # Out:
    t: wp.array[wp.float64],  # [sample] updated
):
    """Find where cubics are nearest to the places of their samples. One thread a cubic."""
    i = offset + wp.tid()
    f = polynomial(cubics, i)
    for s in range(int(first[i]), int(first[i + 1])):
        t[s] = nearest_at(f, place[s], t[s], rounds)
