"""Dash patterns of strokes (SVG 1.1, 11.4): which dash or gap is where."""

import warp as wp

from warpsplat.kernels import constants

wp.set_module_options(constants.MODULE_OPTIONS)


@wp.struct
class Pattern:
    """The dash array of a stroke, which begins with its offset: dash, gap, dash, gap ..."""

    lengths: wp.array[wp.float32]  # of all patterns [canvas units]
    first: wp.int32  # the offset
    last: wp.int32  # one past the end
    stretch: wp.float32  # [px a canvas unit]; 0 for a solid stroke


@wp.func
def pattern_of(
    dash: wp.int32, dash_first: wp.array[wp.int32], dashes: wp.array[wp.float32], scale: wp.float32
) -> Pattern:
    """Return pattern ``dash``; one without length, like NONE, is solid.

    A pattern that is too short to be seen is drawn a whole number of times larger: its mean is the same, and
    the number of dashes is bounded.
    """
    pattern = Pattern()
    pattern.lengths = dashes
    pattern.first = 0
    pattern.last = 0
    pattern.stretch = 0.0
    if dash != constants.NONE:
        pattern.first = dash_first[dash]
        pattern.last = dash_first[dash + 1]
        period = float(0.0)
        for k in range(pattern.first + 1, pattern.last):
            period += scale * dashes[k]
        if period > 0.0:
            pattern.stretch = scale * wp.max(wp.ceil(constants.DASH_PERIOD_MIN / period), 1.0)
    return pattern


@wp.func
def dash_at(pattern: Pattern, position: wp.float32) -> wp.vec2:
    """Return the index of the dash (even) or gap (odd) at ``position`` px of a contour, and its rest [px]."""
    period = float(0.0)
    for k in range(pattern.first + 1, pattern.last):
        period += pattern.stretch * pattern.lengths[k]
    rest = pattern.stretch * pattern.lengths[pattern.first] + position
    rest -= period * wp.floor(rest / period)
    index = int(0)
    length = pattern.stretch * pattern.lengths[pattern.first + 1]
    # A dash without length that the stroke begins with is not passed.
    while pattern.first + 2 + index < pattern.last and (rest > length or (rest == length and length > 0.0)):
        rest -= length
        index += 1
        length = pattern.stretch * pattern.lengths[pattern.first + 1 + index]
    return wp.vec2(float(index), wp.max(length - rest, 0.0))
