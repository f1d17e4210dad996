"""Prefix sums as ranges: which entries of a long array belong to which owner."""

import warp as wp

from warpsplat.kernels import constants

wp.set_module_options(constants.MODULE_OPTIONS)


@wp.func
def find_range(ends: wp.array[wp.int32], count: wp.int32, i: wp.int32) -> wp.int32:
    """Return the smallest index with ``ends[index] > i``; ``ends`` is an inclusive prefix sum of ``count``
    entries.
    """
    low = int(0)
    high = int(count)
    while low < high:
        middle = (low + high) / 2
        if ends[middle] > i:
            high = middle
        else:
            low = middle + 1
    return low


@wp.kernel
def clip_ranges(
    # In:
    offset: wp.int32,
    count: wp.array[wp.int32],  # [n] entries wanted
    ends: wp.array[wp.int32],  # [n] their inclusive prefix sum
    capacity: wp.int32,
    reverse: wp.int32,  # 1: entry i of the prefix sum belongs to range n - 1 - i
    # Out:
    ranges: wp.array[wp.vec2i],  # [n] first, and one past the end; empty where the capacity is exceeded
    needed: wp.array[wp.int32],  # [1] the largest total ever asked for; INT_MAX: more than 32 bits hold
):
    """Turn a prefix sum into ranges. A range that does not fit is left out whole and counted, never cut.

    A sum that exceeds 31 bits turns negative where it first does, as no count does by itself. What comes
    behind may have any range within the capacity, until ``needed`` is read.
    """
    i = offset + wp.tid()
    n = ends.shape[0]
    end = ends[i]
    start = end - count[i]
    if end < 0 or start < 0:
        wp.atomic_max(needed, 0, constants.INT_MAX)
        start = int(0)
        end = int(0)
    if end > capacity:
        end = start
    index = i
    if reverse == 1:
        index = n - 1 - i
    ranges[index] = wp.vec2i(start, end)
    if i == n - 1:
        wp.atomic_max(needed, 0, ends[i])
