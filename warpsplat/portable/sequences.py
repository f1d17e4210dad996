"""Interpolation and convolution of sequences of numbers."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt


def interp(x: Any, places: Any, values: Any) -> npt.NDArray[np.float64]:
    """Return a piecewise linear function at ``x``, held constant beyond its ends, as ``np.interp``.

    It has ``values`` (n, ...) at ``places`` (n,), ascending. The shape is that of ``x``, any, and (...).
    """
    x, places, values = (np.asarray(part, np.float64) for part in (x, places, values))
    if len(places) == 1:
        return np.broadcast_to(values[0], x.shape + values.shape[1:]).copy()
    low = np.clip(np.searchsorted(places, x, side="right") - 1, 0, len(places) - 2)
    span = places[low + 1] - places[low]
    share = np.clip(x - places[low], 0.0, span) / np.where(span > 0, span, 1.0)
    beyond = x >= places[low + 1]
    if values.ndim > 1:
        share, beyond = (each.reshape(x.shape + (1,) * (values.ndim - 1)) for each in (share, beyond))
    between = values[low] + share * (values[low + 1] - values[low])
    return np.where(beyond, values[low + 1], between)[()]


def convolve(signal: Any, kernel: Any) -> npt.NDArray[np.float64]:
    """Return the full-overlap convolution of ``signal`` (n,) and ``kernel`` (m,), shape (n - m + 1,)."""
    signal, kernel = np.asarray(signal, np.float64), np.asarray(kernel, np.float64)
    count = len(signal) - len(kernel) + 1
    total = np.zeros(count)
    for k, weight in enumerate(kernel[::-1]):
        total += weight * signal[k : k + count]
    return total
