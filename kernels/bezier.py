"""Cubic Béziers and index arithmetic: ``@wp.func`` only, callable from plain Python for tests."""

import warp as wp

from warpsplat.kernels import constants

wp.set_module_options(constants.MODULE_OPTIONS)


@wp.func
def cubic_weights(t: wp.float32) -> wp.vec4:
    """The four cubic Bernstein weights at ``t`` in [0, 1] (paper eq. 2, M = 3); they sum to 1."""
    s = 1.0 - t
    return wp.vec4(s * s * s, 3.0 * s * s * t, 3.0 * s * t * t, t * t * t)


@wp.func
def cubic_tangent_weights(t: wp.float32) -> wp.vec4:
    """Derivatives of ``cubic_weights`` by ``t``; they sum to 0."""
    s = 1.0 - t
    return wp.vec4(-3.0 * s * s, 3.0 * s * s - 6.0 * s * t, 6.0 * s * t - 3.0 * t * t, 3.0 * t * t)


@wp.func
def ring_index(chain: wp.int32, i: wp.int32, point_count: wp.int32) -> wp.int32:
    """Place of control point ``i`` of a chain in the outline's ring: chain 0 runs forwards from point 0,
    chain 1 backwards; both end in the middle of the ring.
    """
    if chain == 0:
        return i
    return (point_count - i) % point_count


@wp.func
def cubic_end(start: wp.int32, point_first: wp.array[wp.int32], shape: wp.int32) -> wp.int32:
    """Last control point of the cubic from ``start``: the last one of a ring ends where its shape begins."""
    end = start + 3
    if end == point_first[shape + 1]:
        return point_first[shape]
    return end


@wp.func
def cross(a: wp.vec2, b: wp.vec2) -> wp.float32:
    """Signed area of the parallelogram of ``a`` and ``b``."""
    return a[0] * b[1] - a[1] * b[0]


@wp.func
def segment_at(t: wp.float32, segment_count: wp.int32) -> wp.int32:
    """Segment that holds parameter ``t`` in [0, segment_count] of a chain."""
    return wp.clamp(int(wp.floor(t)), 0, segment_count - 1)


@wp.func
def local_weight(weights: wp.vec4, segment: wp.int32, i: wp.int32) -> wp.float32:
    """Weight of chain control point ``i`` where the chain is in ``segment``; 0 outside its support."""
    j = i - 3 * segment
    if j < 0 or j > 3:
        return 0.0
    return weights[j]
