"""Repeated timings."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass

import warp as wp

WARM_UP = 3
"""Steps that are not counted."""


@dataclass(frozen=True)
class Spread:
    """Spread of repeated timings [ms]."""

    median: float
    low: float
    high: float

    @staticmethod
    def of(seconds: list[float]) -> Spread:
        """Return median, lowest and highest."""
        return Spread(*(round(1e3 * f(seconds), 3) for f in (statistics.median, min, max)))


def timed(device: wp.Device, work: Callable[[], object]) -> float:
    """Return how long ``work`` takes [s], including the device."""
    begin = time.perf_counter()
    work()
    wp.synchronize_device(device)
    return time.perf_counter() - begin
