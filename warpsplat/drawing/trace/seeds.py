"""Seeds of regions: connected pixels where the image is flat or changes evenly."""

from __future__ import annotations

import numpy as np

from warpsplat.drawing.trace.grids import (
    NO_REGION,
    Floats,
    Ints,
    channel_max,
    dilated,
    linked_components,
)

EDGE = 24  # [levels] step between neighbours that is an edge, whatever the noise
NOISE_QUANTILE = 0.7  # of the steps beside edges, that measures the noise

BEND_OF_NOISE, BEND_OF_ROUNDING = 1.7, 0.6
"""How much steps of noise differ over their size, and what rounding to levels adds to that [levels]."""

EQUAL_NEIGHBOURS = 0.28
"""Share of neighbours that are equal after rounding, times the noise: 1 / (2 sqrt(pi)) for normal noise."""

ROUNDING = 1.0
"""How far pixels of one colour are off it, or one another, besides noise [levels]: more is seen."""

OUTLIERS = 3.0
"""How far outliers are off, over usual noise."""

RAMP_STEP = 12.0  # [levels] largest step between neighbours on a ramp, besides noise; more is an edge
RAMP_BEND = 2.0  # [levels] largest change of that step from one pixel to the next, besides noise
LEAST_RAMP = 9  # [px] in a seed that is flat nowhere: antialiasing looks like smaller ones


def noise_of(image: Floats) -> float:
    """Return how much flat regions vary beside their edges, where JPEG leaves its traces [levels of 255].

    0 for a drawing without noise. On black and on white it is the same, unlike that of shades that fade away.
    """
    # Channel by channel: means along an axis of three take ten times as long.
    first = image[..., 0]
    grey = first if image.shape[2] == 1 else (first + image[..., 1] + image[..., 2]) / 3
    noise = _noise_of_grey(grey)
    if noise and image.shape[2] == 4 and image[..., 3].min() < 255:
        noise = min(noise, _noise_of_grey(grey + 255 - image[..., 3]))
    return noise


def _noise_of_grey(grey: Floats) -> float:
    """Return the noise of an image of one channel, shape (height, width)."""
    step, bend = np.zeros(grey.shape, np.float32), np.zeros(grey.shape, np.float32)
    step[:, 1:] = np.abs(np.diff(grey, axis=1))
    step[1:] = np.maximum(step[1:], np.abs(np.diff(grey, axis=0)))
    bend[:, 1:-1] = np.abs(np.diff(grey, n=2, axis=1))
    bend[1:-1] = np.maximum(bend[1:-1], np.abs(np.diff(grey, n=2, axis=0)))
    edge = step > EDGE
    ring = dilated(edge, 13) & ~dilated(edge, 5)
    is_dense = ring.sum() < 64
    beside = ~edge if is_dense else ring
    if not beside.any():  # as in a checkerboard
        return 0.0
    some = [np.sort(change[beside]) for change in (step, bend)]
    noise, bent = (float(values[int(NOISE_QUANTILE * (len(values) - 1))]) for values in some)
    # Steps that are all alike are a gradient, but for a level of rounding; those of noise differ as much.
    noise = noise if bent > noise or bent == noise > 1 else max(bent / BEND_OF_NOISE - BEND_OF_ROUNDING, 0.0)
    if is_dense and edge.any():  # steps of the drawing are in it: noise would make equal neighbours rare
        noise = min(noise, EQUAL_NEIGHBOURS / max(float((np.diff(grey, axis=1) == 0).mean()), 1e-9))
    return noise


def find_seeds(image: Floats, noise: float) -> Ints:
    """Label the connected components of flat or evenly changing pixels.

    Args:
        image: Premultiplied, 0..255, shape (height, width, 4).
        noise: Of flat regions [levels].

    Returns:
        Labels, NO_REGION for pixels in no seed; shape (height, width).
    """
    right, below = np.diff(image, axis=1), np.diff(image, axis=0)
    step_right, step_below = channel_max(np.abs(right)), channel_max(np.abs(below))
    flat_right, flat_below = step_right <= ROUNDING + noise, step_below <= ROUNDING + noise
    block = flat_right[1:] & flat_right[:-1] & flat_below[:, 1:] & flat_below[:, :-1]
    flat = np.zeros(image.shape[:2], np.bool_)
    for rows in (slice(None, -1), slice(1, None)):
        for columns in (slice(None, -1), slice(1, None)):
            flat[rows, columns] |= block
    even = np.ones(image.shape[:2], np.bool_)
    even[:, 1:-1] &= channel_max(np.abs(np.diff(right, axis=1))) <= RAMP_BEND + noise
    even[1:-1] &= channel_max(np.abs(np.diff(below, axis=0))) <= RAMP_BEND + noise
    for part in (slice(1, None), slice(None, -1)):
        even[:, part] &= step_right <= RAMP_STEP + noise
        even[part] &= step_below <= RAMP_STEP + noise
    across = (flat_right & flat[:, 1:] & flat[:, :-1]) | (even[:, 1:] & even[:, :-1])
    down = (flat_below & flat[1:] & flat[:-1]) | (even[1:] & even[:-1])
    # A shadow that fades away ends where nothing is painted.
    clear = image[..., 3] == 0
    across &= clear[:, 1:] == clear[:, :-1]
    down &= clear[1:] == clear[:-1]
    count, parts = linked_components(across, down, flat | even)
    sizes = np.bincount(parts[parts >= 0], minlength=count)
    keep = (sizes >= LEAST_RAMP) | (np.bincount(parts[flat], minlength=count) > 0)
    # NO_REGION is the last.
    return np.append(np.where(keep, np.cumsum(keep) - 1, NO_REGION), NO_REGION).astype(np.int32)[parts]
