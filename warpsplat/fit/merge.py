"""One cubic in place of two (Schneider 1990, "An algorithm for automatically fitting digitized curves")."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]

SAMPLES = 12
"""Of each of the two cubics."""

TURNS = 4
"""How often the samples' places along the cubic are found anew."""

LEAST = 1e-6
"""Length below which a way has no direction [canvas units]."""


def points_at(cubic: Floats, t: Floats) -> Floats:
    """Points of a cubic, shape (4, 2), at ``t``, shape (sample, 1)."""
    s = 1 - t
    a, b, c, d = cubic
    return s**3 * a + 3 * s * s * t * b + 3 * s * t * t * c + t**3 * d


def handles_through(first: Floats, second: Floats) -> Floats:
    """Handles of the cubic that comes nearest to two that follow one another, shape (2, 2).

    It begins and ends where they do, in the same directions; the lengths are fitted by least squares.
    """
    t = (np.arange(SAMPLES) + 0.5)[:, None] / SAMPLES
    samples = np.concatenate([points_at(first, t), points_at(second, t)])
    start, end = first[0], second[3]
    ahead, back = _direction(first), _direction(second[::-1])
    way = np.linalg.norm(np.diff(np.stack([start, *samples, end]), axis=0), axis=1).cumsum()
    u = (way[:-1] / max(way[-1], LEAST))[:, None]
    reach = np.linalg.norm(end - start) / 3
    for _ in range(TURNS):
        along, against = 3 * (1 - u) ** 2 * u * ahead, 3 * (1 - u) * u**2 * back
        missing = samples - points_at(np.stack([start, start, end, end]), u)
        system = np.array(
            [
                [(along * along).sum(), (along * against).sum()],
                [(along * against).sum(), (against * against).sum()],
            ]
        )
        right = np.array([(along * missing).sum(), (against * missing).sum()])
        lengths = np.linalg.lstsq(system, right, rcond=None)[0]
        if (lengths < 0.01 * reach).any():
            lengths = np.full(2, reach)
        cubic = np.stack([start, start + lengths[0] * ahead, end + lengths[1] * back, end])
        u = _nearest(cubic, samples, u)
    return cubic[1:3]


def _direction(cubic: Floats) -> Floats:
    """Unit vector in which a cubic begins; 0 for a point."""
    ways = cubic[1:] - cubic[0]
    lengths = np.linalg.norm(ways, axis=1)
    far = np.flatnonzero(lengths > LEAST)
    return ways[far[0]] / lengths[far[0]] if len(far) else np.zeros(2)


def _nearest(cubic: Floats, samples: Floats, u: Floats) -> Floats:
    """A step of Newton's method towards the places where the cubic is nearest to the samples."""
    slopes = 3 * np.diff(cubic, axis=0)
    bends = 2 * np.diff(slopes, axis=0)
    s = 1 - u
    speed = s * s * slopes[0] + 2 * s * u * slopes[1] + u * u * slopes[2]
    turn = s * bends[0] + u * bends[1]
    apart = points_at(cubic, u) - samples
    top = (apart * speed).sum(axis=1, keepdims=True)
    bottom = (speed * speed + apart * turn).sum(axis=1, keepdims=True)
    moved = u - np.where(np.abs(bottom) > LEAST, top / np.where(np.abs(bottom) > LEAST, bottom, 1), 0)
    return np.clip(moved, 0, 1)
