"""One cubic in place of two (Schneider 1990, "An algorithm for automatically fitting digitized curves")."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from warpsplat.drawing.trace.beziers import distance_derivatives, points_at
from warpsplat.portable import linear

Floats = npt.NDArray[np.float64]

SAMPLES_PER_CUBIC = 12  # of each of the two cubics
FITTING_ROUNDS = 4  # of fitting handles and finding the samples' places along the cubic
LEAST_LENGTH = 1e-6  # [canvas units] length below which a vector has no direction


def handles_through(first: Floats, second: Floats) -> Floats:
    """Return the handles of the cubics nearest to two that follow one another, shape (..., 2, 2).

    They begin and end where those do, in the same directions; the lengths are fitted by least squares.

    ``first`` and ``second``, which begins where ``first`` ends, have shape (..., 4, 2).
    """
    t = (np.arange(SAMPLES_PER_CUBIC) + 0.5) / SAMPLES_PER_CUBIC
    samples = np.concatenate([points_at(first, t), points_at(second, t)], axis=-2)
    start, end = first[..., :1, :], second[..., 3:, :]
    ahead, back = _direction(first), _direction(second[..., ::-1, :])
    travelled = np.linalg.norm(np.diff(np.concatenate([start, samples, end], axis=-2), axis=-2), axis=-1)
    travelled = travelled.cumsum(axis=-1)
    u = travelled[..., :-1] / np.maximum(travelled[..., -1:], LEAST_LENGTH)
    reach = np.linalg.norm(end - start, axis=-1) / 3
    for _ in range(FITTING_ROUNDS):
        along, against = 3 * (1 - u) ** 2 * u, 3 * (1 - u) * u**2
        missing = samples - points_at(np.concatenate([start, start, end, end], axis=-2), u)
        sides = np.stack([along[..., None] * ahead, against[..., None] * back], axis=-3)
        system = (sides[..., :, None, :, :] * sides[..., None, :, :, :]).sum(axis=(-2, -1))
        right = (sides * missing[..., None, :, :]).sum(axis=(-2, -1))
        lengths = linear.product(linear.pinv(system), right[..., None])[..., 0]
        short = (lengths < 0.01 * reach).any(axis=-1, keepdims=True)
        lengths = np.where(short, reach, lengths)[..., None]
        handles = [start + lengths[..., :1, :] * ahead, end + lengths[..., 1:, :] * back]
        cubic = np.concatenate([start, *handles, end], axis=-2)
        # A step of Newton's method towards the nearest places.
        slope, bend = distance_derivatives(cubic, samples, u)
        is_bent = np.abs(bend) > LEAST_LENGTH
        u = np.clip(u - np.where(is_bent, slope / np.where(is_bent, bend, 1), 0), 0, 1)
    return np.asarray(cubic[..., 1:3, :])


def _direction(cubic: Floats) -> Floats:
    """Return unit vectors in which cubics begin; 0 for cubics without extent. Shape (..., 1, 2)."""
    offsets = cubic[..., 1:, :] - cubic[..., :1, :]
    lengths = np.linalg.norm(offsets, axis=-1)[..., None]
    first = (lengths > LEAST_LENGTH).argmax(axis=-2)[..., None]
    offset, length = (np.take_along_axis(x, first, axis=-2) for x in (offsets, lengths))
    return np.where(length > LEAST_LENGTH, offset / np.maximum(length, LEAST_LENGTH), 0.0)
