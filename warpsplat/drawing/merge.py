"""One cubic in place of two (Schneider 1990, "An algorithm for automatically fitting digitized curves")."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from warpsplat.portable import linear

Floats = npt.NDArray[np.float64]

SAMPLES = 12
"""Of each of the two cubics."""

TURNS = 4
"""How often the samples' places along the cubic are found anew."""

LEAST = 1e-6
"""Length below which a way has no direction [canvas units]."""


def points_at(cubic: Floats, t: Floats) -> Floats:
    """Points of cubics, shape (..., 4, 2), at ``t``, shape (..., sample, 1)."""
    s = 1 - t
    a, b, c, d = (cubic[..., i, None, :] for i in range(4))
    return s * s * s * a + 3 * s * s * t * b + 3 * s * t * t * c + t * t * t * d


def handles_through(first: Floats, second: Floats) -> Floats:
    """Handles of the cubics that come nearest to two that follow one another.

    They begin and end where those do, in the same directions; the lengths are fitted by least squares.

    Args:
        first: cubics, shape (..., 4, 2).
        second: those that begin where ``first`` end, in the same shape.

    Returns:
        shape (..., 2, 2).
    """
    t = (np.arange(SAMPLES) + 0.5)[:, None] / SAMPLES
    samples = np.concatenate([points_at(first, t), points_at(second, t)], axis=-2)
    start, end = first[..., :1, :], second[..., 3:, :]
    ahead, back = _direction(first), _direction(second[..., ::-1, :])
    way = np.linalg.norm(np.diff(np.concatenate([start, samples, end], axis=-2), axis=-2), axis=-1)
    way = way.cumsum(axis=-1)
    u = (way[..., :-1] / np.maximum(way[..., -1:], LEAST))[..., None]
    reach = np.linalg.norm(end - start, axis=-1) / 3
    for _ in range(TURNS):
        along, against = 3 * (1 - u) ** 2 * u * ahead, 3 * (1 - u) * u**2 * back
        missing = samples - points_at(np.concatenate([start, start, end, end], axis=-2), u)
        sides = np.stack([along, against], axis=-3)
        system = (sides[..., :, None, :, :] * sides[..., None, :, :, :]).sum(axis=(-2, -1))
        right = (sides * missing[..., None, :, :]).sum(axis=(-2, -1))
        lengths = linear.product(linear.pinv(system), right[..., None])[..., 0]
        short = (lengths < 0.01 * reach).any(axis=-1, keepdims=True)
        lengths = np.where(short, reach, lengths)[..., None]
        handles = [start + lengths[..., :1, :] * ahead, end + lengths[..., 1:, :] * back]
        cubic = np.concatenate([start, *handles, end], axis=-2)
        u = _nearest(cubic, samples, u)
    return np.asarray(cubic[..., 1:3, :])


def _direction(cubic: Floats) -> Floats:
    """Unit vectors in which cubics begin; 0 for points. Shape (..., 1, 2)."""
    ways = cubic[..., 1:, :] - cubic[..., :1, :]
    lengths = np.linalg.norm(ways, axis=-1)[..., None]
    first = (lengths > LEAST).argmax(axis=-2)[..., None]
    way, length = (np.take_along_axis(x, first, axis=-2) for x in (ways, lengths))
    return np.where(length > LEAST, way / np.maximum(length, LEAST), 0.0)


def _nearest(cubic: Floats, samples: Floats, u: Floats) -> Floats:
    """A step of Newton's method towards the places where cubics are nearest to their samples."""
    slopes = 3 * np.diff(cubic, axis=-2)
    bends = 2 * np.diff(slopes, axis=-2)
    s = 1 - u
    a, b, c = (slopes[..., i, None, :] for i in range(3))
    speed = s * s * a + 2 * s * u * b + u * u * c
    turn = s * bends[..., :1, :] + u * bends[..., 1:, :]
    apart = points_at(cubic, u) - samples
    top = (apart * speed).sum(axis=-1, keepdims=True)
    bottom = (speed * speed + apart * turn).sum(axis=-1, keepdims=True)
    far = np.abs(bottom) > LEAST
    return np.clip(u - np.where(far, top / np.where(far, bottom, 1), 0), 0, 1)
