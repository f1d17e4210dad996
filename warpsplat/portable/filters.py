"""Image filters like OpenCV's, by sums of slices.

Images are float arrays of shape (height, width) or (height, width, channels). Results are float64 for float64
images, else float32. Images are processed in bands that fit a processor's cache.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import cv2
import numpy as np
import numpy.typing as npt

from warpsplat.portable import elementary

Floats = npt.NDArray[Any]
Indices = npt.NDArray[np.intp]
Border = Literal["reflect101", "replicate"]
"""Continuation of an image past its border: reflected about the outermost pixels, or copies of them."""

BAND = 1 << 16
"""Numbers in a band: a few such arrays fit a processor's L2 cache."""

BLOCK = 32
"""Sides of the blocks that masks are cut into [px]."""

CUBIC = -0.75
"""Slope of cubic interpolation's kernel at 1, as in OpenCV."""

FADE_SQUARINGS, FADE_TERMS, FADE_MOST = 5, (1 / 24, -1 / 6, 1 / 2, -1.0), 0.625
"""For exp(-x) in ``bilateral``: squarings of the series at x / 32, its coefficients, the highest power first,
and the largest x / 32."""

LUMA = 0.299, 0.587, 0.114
"""Weights of red, green and blue (ITU-R BT.601)."""

XYZ = (0.412453, 0.357580, 0.180423), (0.212671, 0.715160, 0.072169), (0.019334, 0.119193, 0.950227)
WHITE = 0.950456, 1.0, 1.088754
"""The matrix from linear sRGB to CIE XYZ, and white in XYZ (D65)."""


def _floats(image: Floats) -> Floats:
    image = np.asarray(image)
    return image if image.dtype == np.float64 else image.astype(np.float32, copy=False)


@dataclass(frozen=True)
class _Taps:
    """The pixels along one axis of an image that each pixel of a resized axis is a weighted sum of."""

    indices: Indices
    """Shape (tap, pixel)."""
    weights: Floats
    """The same shape."""
    whole: bool = False
    """Whether each pixel is the mean of a block of its own."""


def _area_taps(before: int, after: int, dtype: Any) -> _Taps:
    """Return taps with weights by overlap, computed in whole numbers."""
    taps = 2 if after > before else -(-before // after) + (before % after > 0)
    pixel, tap = np.arange(after), np.arange(taps)[:, None]
    index = pixel * before // after + tap
    low = np.maximum(pixel * before, index * after)
    high = np.minimum((pixel + 1) * before, (index + 1) * after)
    weights = (np.maximum(high - low, 0) / before).astype(dtype)
    return _Taps(np.minimum(index, before - 1), weights, before % after == 0)


def _point_taps(before: int, after: int, dtype: Any, *, cubic: bool) -> _Taps:
    """Return taps of linear or cubic interpolation at the centres of pixels; border pixels repeat."""
    place = (np.arange(after) + 0.5) * (before / after) - 0.5
    low = np.floor(place)
    x = place - low
    weights, offsets = [1 - x, x], [0, 1]
    if cubic:
        weights = [_outer_cubic(1 + x), _inner_cubic(x), _inner_cubic(1 - x)]
        weights.append(1 - weights[0] - weights[1] - weights[2])
        offsets = [-1, 0, 1, 2]
    indices = low.astype(np.intp) + np.array(offsets)[:, None]
    return _Taps(np.clip(indices, 0, before - 1), np.array(weights).astype(dtype))


def _inner_cubic(x: Floats) -> Floats:
    """Return the cubic kernel between 0 and 1."""
    return ((CUBIC + 2) * x - (CUBIC + 3)) * x * x + 1


def _outer_cubic(x: Floats) -> Floats:
    """Return the cubic kernel between 1 and 2."""
    return ((CUBIC * x - 5 * CUBIC) * x + 8 * CUBIC) * x - 4 * CUBIC


def _gathered(band: Floats, taps: _Taps, axis: int) -> Floats:
    """Return a band (row, number) with one axis resized."""
    shape = list(band.shape)
    shape[axis] = taps.indices.shape[1]
    total, spare = np.zeros(shape, band.dtype), np.empty(shape, band.dtype)
    for indices, weights in zip(taps.indices, taps.weights, strict=True):
        np.take(band, indices, axis=axis, out=spare, mode="clip")
        if not taps.whole:
            spare *= weights[:, None] if axis == 0 else weights
        total += spare
    if taps.whole:
        total *= band.dtype.type(1 / len(taps.indices))
    return total


def _resized(image: Floats, size: tuple[int, int], taps: Callable[[int, int, Any], _Taps]) -> Floats:
    """Return an image at another size by the ``taps`` of its sides (before, after, dtype)."""
    image = np.ascontiguousarray(_floats(image))
    across, down = (taps(image.shape[1 - i], size[i], image.dtype) for i in (0, 1))
    channels = image.shape[2] if image.ndim == 3 else 1
    height, width = down.indices.shape[1], across.indices.shape[1]
    rows, channel = image.reshape(image.shape[0], -1), np.arange(channels)
    numbers = (across.indices[..., None] * channels + channel).reshape(len(across.indices), -1)
    along = _Taps(numbers, np.repeat(across.weights, channels, axis=1), across.whole)
    result = np.empty((height, width * channels), image.dtype)
    step = max(1, BAND // (max(width, image.shape[1]) * channels))
    for top in range(0, height, step):
        here = slice(top, top + step)
        band = _Taps(down.indices[:, here], down.weights[:, here], down.whole)
        result[here] = _gathered(_gathered(rows, band, 0), along, 1)
    return result.reshape(height, width, *image.shape[2:])


def resize_area(image: Floats, size: tuple[int, int]) -> Floats:
    """Return an image at another size (width, height) [px]; pixels are means of the area that they cover.

    As OpenCV's ``INTER_AREA``, except where one side grows while the other shrinks, which OpenCV samples.
    """
    return _resized(image, size, _area_taps)


def boxed(image: Floats, factor: int) -> Floats:
    """Return means of squares of ``factor`` x ``factor`` px; beyond the border its pixels repeat."""
    height, width = image.shape[:2]
    size = (-(-width // factor), -(-height // factor))
    below, right = size[1] * factor - height, size[0] * factor - width
    if below or right:
        image = np.pad(image, ((0, below), (0, right), *[(0, 0)] * (image.ndim - 2)), mode="edge")
    return resize_area(image, size)


def resize_linear(image: Floats, size: tuple[int, int]) -> Floats:
    """Return an image at another size (width, height) [px], interpolated linearly at pixel centres."""
    return _resized(image, size, functools.partial(_point_taps, cubic=False))


def resize_cubic(image: Floats, size: tuple[int, int]) -> Floats:
    """Return an image at another size (width, height) [px], interpolated by cubics at pixel centres."""
    return _resized(image, size, functools.partial(_point_taps, cubic=True))


def _beyond(places: Indices, size: int, border: Border) -> Indices:
    """Return the pixels, of ``size``, that stand for places, some of them beyond the border."""
    if border == "replicate" or size == 1:
        return np.clip(places, 0, size - 1)
    period = 2 * (size - 1)
    places = places % period
    return np.minimum(places, period - places)


def _weighted(parts: Sequence[Floats], weights: Sequence[float], total: Floats, spare: Floats) -> None:
    """Write the weighted sum of ``parts`` to ``total``, in pairs if the weights are symmetric."""
    middle = len(parts) // 2
    mirrored = len(parts) % 2 == 1 and list(weights) == list(weights)[::-1]
    np.multiply(parts[middle], weights[middle], out=total)
    for i in range(len(parts)):
        if i == middle or weights[i] == 0 or (mirrored and i > middle):
            continue
        part = parts[i]
        if mirrored:
            part = np.add(part, parts[-1 - i], out=spare)
        total += part if weights[i] == 1 else np.multiply(part, weights[i], out=spare)


def _convolved(
    image: Floats, down: Sequence[float], across: Sequence[float], border: Border = "reflect101"
) -> Floats:
    """Return an image convolved with a separable kernel; n weights begin n // 2 pixels before the pixel."""
    image = np.ascontiguousarray(_floats(image))
    height, width = image.shape[:2]
    channels = image.shape[2] if image.ndim == 3 else 1
    rows, result = image.reshape(height, -1), np.empty((height, width * channels), image.dtype)
    above, left = len(down) // 2, len(across) // 2
    right = len(across) - 1 - left
    columns = _beyond(np.arange(-left, width + right), width, border)
    step = max(1, min(height, BAND // (width * channels)))
    wide = np.empty((step, width + len(across) - 1, channels), image.dtype)
    spare = np.empty((step, width * channels), image.dtype)
    for top in range(0, height, step):
        bottom = min(top + step, height)
        count = bottom - top
        first, last = top - above, bottom + len(down) - 1 - above
        if first >= 0 and last <= height:
            band = rows[first:last]
        else:
            band = rows[_beyond(np.arange(first, last), height, border)]
        mixed = spare[:count]
        held = wide[:count]
        _weighted([band[i : i + count] for i in range(len(down))], down, result[top:bottom], mixed)
        held[:, left : left + width] = result[top:bottom].reshape(count, width, channels)
        held[:, :left] = held[:, left + columns[:left]]
        held[:, left + width :] = held[:, left + columns[left + width :]]
        flat = held.reshape(count, -1)
        parts = [flat[:, i * channels : (i + width) * channels] for i in range(len(across))]
        _weighted(parts, across, result[top:bottom], mixed)
    return result.reshape(image.shape)


def gaussian_blur(image: Floats, sigma: float, border: Border = "reflect101") -> Floats:
    """Return an image blurred by a Gaussian of standard deviation ``sigma`` [px], as OpenCV blurs floats."""
    reach = (round(8 * sigma + 1) | 1) // 2
    offsets = np.arange(-reach, reach + 1.0)
    weights = elementary.exp(offsets * offsets * (-0.5 / (sigma * sigma)))
    kernel = (weights / weights.sum()).tolist()
    return _convolved(image, kernel, kernel, border)


def blurred_within(image: Floats, mask: npt.NDArray[np.bool_], sigma: float) -> Floats:
    """Return ``gaussian_blur`` of the pixels of a mask alone; elsewhere than there it may be 0.

    Blocks without such pixels are left out where that is quicker: the mask may be a ring around an image.
    """
    margin, (height, width) = (round(8 * sigma + 1) | 1) // 2, mask.shape
    tops, lefts = np.arange(0, height, BLOCK), np.arange(0, width, BLOCK)
    taken = np.logical_or.reduceat(np.logical_or.reduceat(mask, tops, axis=0), lefts, axis=1)
    rows, columns = np.nonzero(taken)
    side = BLOCK + 2 * margin
    if len(rows) * side * side >= height * width:
        return _normalized_blur(image, mask, sigma)
    near, own = np.arange(-margin, BLOCK + margin), np.arange(BLOCK)
    ys = _beyond(tops[rows, None] + near, height, "reflect101")[:, :, None]
    xs = _beyond(lefts[columns, None] + near, width, "reflect101")[:, None]
    soft = _normalized_blur(
        image[ys, xs].reshape(-1, side, *image.shape[2:]), mask[ys, xs].reshape(-1, side), sigma
    )
    soft = soft.reshape(len(rows), side, side, *image.shape[2:])[:, margin:-margin, margin:-margin]
    found = np.zeros((len(tops) * BLOCK, len(lefts) * BLOCK, *image.shape[2:]), soft.dtype)
    found[(tops[rows, None] + own)[:, :, None], (lefts[columns, None] + own)[:, None]] = soft
    return found[:height, :width]


def _normalized_blur(image: Floats, mask: npt.NDArray[np.bool_], sigma: float) -> Floats:
    shaped = mask.reshape(*mask.shape, *[1] * (image.ndim - 2))
    weight = gaussian_blur(shaped.astype(np.float32), sigma).reshape(shaped.shape)
    return np.asarray(gaussian_blur((image * shaped).astype(np.float32), sigma) / np.maximum(weight, 1e-3))


def box_sum(image: Floats, size: int) -> Floats:
    """Return the sum of the ``size`` x ``size`` pixels around each one, reflected past the border."""
    return _convolved(image, [1.0] * size, [1.0] * size)


def box_blur(image: Floats, size: int) -> Floats:
    """Return the mean of the ``size`` x ``size`` pixels around each one, reflected past the border."""
    total = box_sum(image, size)
    total *= total.dtype.type(1 / (size * size))
    return total


def sobel(image: Floats) -> tuple[Floats, Floats]:
    """Return eight times the derivatives of an image along x and y, by Sobel kernels of 3 x 3 px."""
    smooth, slope = (1.0, 2.0, 1.0), (-1.0, 0.0, 1.0)
    return _convolved(image, smooth, slope), _convolved(image, slope, smooth)


def bilateral(image: Floats, diameter: int, sigma_color: float, sigma_space: float) -> Floats:
    """Return an image after a bilateral filter over discs of ``diameter`` px (odd), reflected at the border.

    ``sigma_space`` [px] and ``sigma_color`` are the standard deviations of the weights by distance and by the
    sum of the channels' absolute differences.
    """
    image = _floats(image)
    height, width = image.shape[:2]
    channels = image.shape[2] if image.ndim == 3 else 1
    planes = np.ascontiguousarray(image.reshape(height, width, channels).transpose(2, 0, 1))
    reach = diameter // 2
    columns = _beyond(np.arange(-reach, width + reach), width, "reflect101")
    result = np.empty_like(planes)
    step = max(1, BAND // (width + 2 * reach))
    for top in range(0, height, step):
        bottom = min(top + step, height)
        band = planes[:, _beyond(np.arange(top - reach, bottom + reach), height, "reflect101")][:, :, columns]
        blurred = _bilateral_band(band.reshape(channels, -1), band.shape[2], reach, sigma_color, sigma_space)
        inner = blurred.reshape(band.shape)[:, reach : reach + bottom - top, reach : reach + width]
        result[:, top:bottom] = inner
    return np.ascontiguousarray(result.transpose(1, 2, 0)).reshape(image.shape)


def _bilateral_band(planes: Floats, width: int, reach: int, sigma_color: float, sigma_space: float) -> Floats:
    """Return planes (channel, pixel) of rows of ``width`` after a bilateral filter.

    Weights are symmetric, so that half of the neighbours are visited. In margins of ``reach`` px, where they
    may belong to another row, the result is wrong.
    """
    size = planes.shape[1]
    total, weights = np.zeros_like(planes), np.ones(size, planes.dtype)
    steps, spare, all_weight = np.empty_like(planes), np.empty_like(weights), np.empty_like(weights)
    scale = 0.5 / (sigma_color * sigma_color * (1 << FADE_SQUARINGS))
    for down in range(reach + 1):
        for right in range(-reach if down else 1, reach + 1):
            square = down * down + right * right
            if square > reach * reach:
                continue
            offset = down * width + right
            rest, weight = spare[: size - offset], all_weight[: size - offset]
            for channel, plane in enumerate(planes):
                step = np.subtract(plane[offset:], plane[:-offset], out=steps[channel, : size - offset])
                difference = np.abs(step, out=rest if channel else weight)
                if channel:
                    weight += difference
            # exp(-x) is a power of exp(-x / 32), for which a few terms of the series suffice.
            np.multiply(weight, weight, out=rest)
            rest *= scale
            np.minimum(rest, FADE_MOST, out=rest)
            np.multiply(rest, FADE_TERMS[0], out=weight)
            for term in FADE_TERMS[1:]:
                weight += term
                weight *= rest
            weight += 1
            for _ in range(FADE_SQUARINGS):
                weight *= weight
            weight *= float(elementary.exp(-0.5 * square / (sigma_space * sigma_space)))
            weights[:-offset] += weight
            weights[offset:] += weight
            for sums, step in zip(total, steps[:, : size - offset], strict=True):
                np.multiply(step, weight, out=rest)
                sums[:-offset] += rest
                sums[offset:] -= rest
    total /= weights
    total += planes
    return total


def distance(mask: npt.NDArray[Any]) -> npt.NDArray[np.float32]:
    """Return the distance of each pixel of ``mask`` from the nearest that is 0 [px], shape (height, width).

    By steps of up to a knight's move, accurate to 2 %. With labels OpenCV computes it in whole numbers;
    without, Intel's library may do it in floating point.
    """
    pixels = np.asarray(mask, np.uint8)
    found, _ = cv2.distanceTransformWithLabels(pixels, cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL)
    return np.asarray(found, np.float32)


def grey(rgb: Floats) -> Floats:
    """Return the luma of colours (..., 3), shape (...)."""
    rgb = _floats(rgb)
    red, green, blue = (rgb.dtype.type(share) * rgb[..., i] for i, share in enumerate(LUMA))
    return np.asarray(red + green + blue)


def linear_light(rgb: Floats) -> Floats:
    """Return sRGB values in [0, 1] as linear light in float64 (IEC 61966-2-1)."""
    colors = np.asarray(rgb, np.float64)
    bent = elementary.power((np.maximum(colors, 0.04045) + 0.055) / 1.055, 2.4)
    return np.asarray(np.where(colors <= 0.04045, colors / 12.92, bent))


def lab(rgb: Floats) -> Floats:
    """Return colours (..., 3), sRGB in [0, 1], as CIELAB: lightness in [0, 100], a and b."""
    given = _floats(rgb)
    linear, cubes = linear_light(given), []
    for row, white in zip(XYZ, WHITE, strict=True):
        share = (row[0] * linear[..., 0] + row[1] * linear[..., 1] + row[2] * linear[..., 2]) / white
        root = elementary.power(np.maximum(share, 0.008856), 1 / 3)
        cubes.append(np.where(share > 0.008856, root, 7.787 * share + 16 / 116))
    x, y, z = cubes
    return np.stack([116 * y - 16, 500 * (x - y), 200 * (y - z)], axis=-1).astype(given.dtype)
