"""Exchange rate between error and file size."""

from __future__ import annotations

from warpsplat.portable import elementary

DB_PER_DOUBLING = 1.8
"""Gain from twice the shapes, and so twice the bytes, on photographs [dB] (docs/experiments.md)."""


def byte_worth(square_error: float, size: int) -> float:
    """Return by how much the mean squared error may grow for each byte saved of a file with ``size`` bytes.

    Shapes bought with that byte would lower the error as much: -d error / d size at ``DB_PER_DOUBLING``.
    """
    return square_error * DB_PER_DOUBLING * elementary.LN10 / (10 * elementary.LN2 * size)
