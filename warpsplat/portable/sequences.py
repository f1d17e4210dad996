"""Interpolation and convolution of sequences of numbers, the same bits everywhere."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt


def interp(x: Any, places: Any, values: Any) -> npt.NDArray[np.float64]:
    """Return a piecewise linear function at ``x``, held constant beyond its ends, as ``np.interp``.

    Args:
        x: Where to take it, any shape.
        places: Where its values are given, shape (n,), ascending.
        values: Its values there, shape (n,).
    """
    x, places, values = (np.asarray(part, np.float64) for part in (x, places, values))
    if len(places) == 1:
        return np.full_like(x, values[0])
    low = np.clip(np.searchsorted(places, x, side="right") - 1, 0, len(places) - 2)
    span = places[low + 1] - places[low]
    share = np.clip(x - places[low], 0.0, span) / np.where(span > 0, span, 1.0)
    between = values[low] + share * (values[low + 1] - values[low])
    return np.where(x >= places[low + 1], values[low + 1], between)[()]


def convolve(signal: Any, kernel: Any) -> npt.NDArray[np.float64]:
    """Return where ``kernel`` (m,) lies wholly on ``signal`` (n,) the sum of products, shape (n - m + 1,).

    As ``np.convolve(signal, kernel, "valid")``: the kernel is reversed.
    """
    signal, kernel = np.asarray(signal, np.float64), np.asarray(kernel, np.float64)
    count = len(signal) - len(kernel) + 1
    total = np.zeros(count)
    for k, weight in enumerate(kernel[::-1]):
        total += weight * signal[k : k + count]
    return total
