"""One cubic in place of two (Schneider 1990, "An algorithm for automatically fitting digitized curves")."""

import warp as wp

from warpsplat.kernels import constants
from warpsplat.kernels.drawing.cubic import ONE, THREE, ZERO, nearest_at, point_at, polynomial

wp.set_module_options(constants.MODULE_OPTIONS)

LEAST_LENGTH = wp.constant(wp.float64(1.0e-6))  # [px] below which a vector has no direction
LEAST_SHARE = wp.constant(wp.float64(0.01))  # of the usual length, a third of the way, that a handle has
SINGULAR = wp.constant(wp.float64(1.0e-12))
HALF = wp.constant(wp.float64(0.5))


@wp.func
def begun(cubics: wp.array[wp.vec2d], start: wp.int32, step: wp.int32) -> wp.vec2d:
    """Return the unit vector in which a cubic begins, or ends for a ``step`` of -1; 0 without extent."""
    for k in range(1, 4):
        offset = cubics[start + k * step] - cubics[start]
        length = wp.length(offset)
        if length > LEAST_LENGTH:
            return offset / length
    return wp.vec2d(ZERO, ZERO)


@wp.kernel
def handles_through(
    # In:
    offset: wp.int32,
    cubics: wp.array[wp.vec2d],  # [8 x pair] two, the second one beginning where the first one ends [px]
    samples: wp.int32,  # on each cubic
    rounds: wp.int32,  # of fitting handles and finding the samples' places along the cubic
    # Out:
    place: wp.array2d[wp.vec2d],  # [pair, 2 x samples] scratch
    t: wp.array2d[wp.float64],  # [pair, 2 x samples] scratch
    made: wp.array[wp.vec2d],  # [4 x pair] the cubic nearest to both [px]
):
    """Fit the handles' lengths of cubics that begin and end where, and as, two do. One thread a pair."""
    i = offset + wp.tid()
    start = cubics[8 * i]
    end = cubics[8 * i + 7]
    ahead = begun(cubics, 8 * i, 1)
    back = begun(cubics, 8 * i + 7, -1)
    f = polynomial(cubics, 2 * i)
    g = polynomial(cubics, 2 * i + 1)
    count = wp.float64(samples)
    travelled = ZERO
    last = start
    for s in range(2 * samples):
        here = start
        if s < samples:
            here = point_at(f, (wp.float64(s) + HALF) / count)
        else:
            here = point_at(g, (wp.float64(s - samples) + HALF) / count)
        travelled += wp.length(here - last)
        last = here
        place[i, s] = here
        t[i, s] = travelled
    travelled = wp.max(travelled + wp.length(end - last), LEAST_LENGTH)
    for s in range(2 * samples):
        t[i, s] = t[i, s] / travelled
    reach = wp.length(end - start) / THREE
    made[4 * i] = start
    made[4 * i + 3] = end
    for _ in range(rounds):
        aa = ZERO
        ab = ZERO
        bb = ZERO
        ra = ZERO
        rb = ZERO
        for s in range(2 * samples):
            u = t[i, s]
            v = ONE - u
            first = THREE * v * v * u
            second = THREE * v * u * u
            missing = place[i, s] - (v * v * v + first) * start - (second + u * u * u) * end
            aa += first * first
            ab += first * second
            bb += second * second
            ra += first * wp.dot(missing, ahead)
            rb += second * wp.dot(missing, back)
        aa *= wp.dot(ahead, ahead)
        ab *= wp.dot(ahead, back)
        bb *= wp.dot(back, back)
        # By least squares; where one direction is missing, or both are the same, the shortest solution.
        determinant = aa * bb - ab * ab
        trace = aa + bb
        a = ZERO
        b = ZERO
        if determinant > SINGULAR * trace * trace:
            a = (bb * ra - ab * rb) / determinant
            b = (aa * rb - ab * ra) / determinant
        elif trace > ZERO:
            a = (aa * ra + ab * rb) / (trace * trace)
            b = (ab * ra + bb * rb) / (trace * trace)
        if wp.min(a, b) < LEAST_SHARE * reach:
            a = reach
            b = reach
        made[4 * i + 1] = start + a * ahead
        made[4 * i + 2] = end + b * back
        h = polynomial(made, i)
        for s in range(2 * samples):
            t[i, s] = nearest_at(h, place[i, s], t[i, s], 1)
