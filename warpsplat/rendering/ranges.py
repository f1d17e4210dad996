"""Counts -> ranges of a long array, one range a shape."""

from __future__ import annotations

import warp as wp

from warpsplat.kernels import ranges
from warpsplat.rendering.program import Program


def record_ranges(
    program: Program,
    count: wp.array,
    ends: wp.array,
    found: wp.array,
    needed: wp.array,
    *,
    capacity: int,
    reverse: bool = False,
) -> None:
    """Record the prefix sum of ``count`` into ``ends``, and into ``found`` the ranges within ``capacity``."""
    if count.shape[0] == 0:
        return
    program.call(wp.utils.array_scan, count, ends, True)
    program.launch(
        ranges.clip_ranges,
        count.shape[0],
        count=count,
        ends=ends,
        ranges=found,
        needed=needed,
        capacity=capacity,
        reverse=int(reverse),
    )
