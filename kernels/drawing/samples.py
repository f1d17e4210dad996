"""Where samples lie on cubics, and how far off."""

import warp as wp

from warpsplat.kernels import constants
from warpsplat.kernels.drawing.cubic import ZERO, nearest_at, point_at, polynomial, slope_at

wp.set_module_options(constants.MODULE_OPTIONS)

LEAST_SPEED = wp.constant(wp.float64(1.0e-9))


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
        across[s] = wp.vec2d(-ahead[1], ahead[0]) / wp.max(speed, LEAST_SPEED)
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


@wp.kernel
def errors(
    # In:
    offset: wp.int32,
    cubics: wp.array[wp.vec2d],  # [4 x n] in place of others [px]
    instead: wp.array[wp.int64],  # [n] the cubic whose samples are taken
    low: wp.array[wp.float64],  # [n] where on the new cubic the old one would begin
    high: wp.array[wp.float64],  # [n] and end
    first: wp.array[wp.int64],  # [cubic + 1]
    t: wp.array[wp.float64],  # [sample]
    place: wp.array[wp.vec2d],  # [sample] [px]
    across: wp.array[wp.vec2d],  # [sample]
    weight: wp.array[wp.float64],  # [sample]
    rounds: wp.int32,
    # Out:
    error: wp.array[wp.float64],  # [n]
):
    """Sum the errors of samples on cubics that take the places of theirs. One thread a cubic."""
    i = offset + wp.tid()
    f = polynomial(cubics, i)
    old = int(instead[i])
    total = ZERO
    for s in range(int(first[old]), int(first[old + 1])):
        start = low[i] + (high[i] - low[i]) * t[s]
        there = nearest_at(f, place[s], start, rounds)
        off = wp.dot(point_at(f, there) - place[s], across[s])
        total += weight[s] * off * off
    error[i] = total
