"""Kernels with and without races, for the test that finds those."""

import warp as wp

from warpsplat.kernels import constants

wp.set_module_options(constants.MODULE_OPTIONS)


@wp.kernel
def writes_own(offset: wp.int32, source: wp.array[wp.float32], result: wp.array[wp.float32]):
    i, lane = wp.tid()
    k = 4 * (offset + i) + lane
    result[k] = source[k] + source[k + 1]


@wp.kernel
def updates_own(offset: wp.int32, source: wp.array[wp.float32], result: wp.array[wp.float32]):
    i, lane = wp.tid()
    k = 4 * (offset + i) + lane
    result[k] = result[k] + source[k]
    result[k] = result[k] + 1.0


@wp.kernel
def writes_next_too(offset: wp.int32, source: wp.array[wp.float32], result: wp.array[wp.float32]):
    i, lane = wp.tid()
    k = 4 * (offset + i) + lane
    result[k] = source[k]
    result[k + 1] = source[k]


@wp.kernel
def lanes_share(offset: wp.int32, source: wp.array[wp.float32], result: wp.array[wp.float32]):
    i, lane = wp.tid()
    result[offset + i] = source[4 * i + lane]


@wp.kernel
def raises_flag(offset: wp.int32, source: wp.array[wp.float32], result: wp.array[wp.float32]):
    i, lane = wp.tid()
    if source[4 * (offset + i) + lane] > 5.0:
        result[0] = 1.0


@wp.kernel
def reads_next(offset: wp.int32, source: wp.array[wp.float32], result: wp.array[wp.float32]):
    i, lane = wp.tid()
    k = 4 * (offset + i) + lane
    result[k] = source[k] + result[k + 1]


@wp.kernel
def adds_up(offset: wp.int32, source: wp.array[wp.float32], result: wp.array[wp.float32]):
    i, lane = wp.tid()
    result[offset + i] += source[4 * i + lane]
