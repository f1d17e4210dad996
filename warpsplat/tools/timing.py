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
    """Of repeated timings [ms]."""

    median: float
    low: float
    high: float

    @staticmethod
    def of(seconds: list[float]) -> Spread:
        """Median, lowest and highest."""
        return Spread(*(round(1e3 * f(seconds), 3) for f in (statistics.median, min, max)))


def timed(device: wp.Device, work: Callable[[], object]) -> float:
    """How long ``work`` takes, the device's part included [s]."""
    begin = time.perf_counter()
    work()
    wp.synchronize_device(device)
    return time.perf_counter() - begin
