"""Prefix sums as ranges; what 32 bits do not hold."""

from __future__ import annotations

import numpy as np
import pytest
import warp as wp

from tests.helpers import renderer_for
from tests.scenes import random_scene
from warpsplat.errors import CapacityError
from warpsplat.kernels import constants
from warpsplat.rendering.backend import Backend
from warpsplat.rendering.ranges import record_ranges
from warpsplat.scene import Kind

CAPACITY = 100


def ranges_of(counts: list[int], device: str, *, reverse: bool = False) -> tuple[np.ndarray, int]:
    """Ranges, shape (count, 2), and the need."""
    backend = Backend.on(device)
    wanted = wp.array(np.array(counts, np.int32), dtype=wp.int32, device=device)
    ends, ranges = backend.array(wp.int32, len(wanted)), backend.array(wp.vec2i, len(wanted))
    needed = backend.array(wp.int32, 1)
    program = backend.program()
    record_ranges(program, wanted, ends, ranges, needed, capacity=CAPACITY, reverse=reverse)
    program.run()
    return ranges.numpy(), int(needed.numpy()[0])


@pytest.mark.parametrize("reverse", [False, True])
def test_ranges_beyond_the_capacity_are_left_out_and_counted(device: str, reverse: bool) -> None:
    ranges, needed = ranges_of([40, 0, 30, 31, 5], device, reverse=reverse)
    sizes = (ranges[:, 1] - ranges[:, 0])[:: -1 if reverse else 1]
    assert sizes.tolist() == [40, 0, 30, 0, 0]
    assert needed == 106


@pytest.mark.parametrize(
    "counts",
    [
        [2**30, 2**30],
        [10, 2**31 - 1, 5],
        # Round to where they began: the last total is small, as is that of the fifth.
        [2**30, 2**30, 2**30, 2**30, 7],
        [2**30, 2**30, 2**30, 2**30, 7, 2**30, 2**30, 2**30, 2**30, 7],
    ],
)
def test_a_sum_beyond_32_bits_is_noticed(device: str, counts: list[int]) -> None:
    ranges, needed = ranges_of(counts, device)
    assert needed == constants.INT_MAX
    assert (ranges[:, 0] <= ranges[:, 1]).all()
    used = ranges[ranges[:, 1] > ranges[:, 0]]
    assert (used >= 0).all() and (used <= CAPACITY).all(), "nothing is written outside of the arrays"


def test_a_scene_beyond_32_bits_is_refused(device: str) -> None:
    renderer = renderer_for(random_scene(Kind.FILL, 2), device)
    renderer.needed_slots.fill_(constants.INT_MAX)
    with pytest.raises(CapacityError, match=r"needs \d+ samples and over 2 billion tile slots") as caught:
        renderer.grow()
    assert "\n" not in str(caught.value)
