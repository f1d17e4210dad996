"""Counts copies between host and device, and measures the host's own work, of a run on the CPU."""

from __future__ import annotations

import contextlib
import functools
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import warp as wp

from warpsplat.rendering.program import Program

INNER = ("warpsplat.rendering.parameters", "warpsplat.rendering.tiles", "warpsplat.rendering.backend")
"""Modules whose callers say more about what a copy is for."""


@dataclass
class Copies:
    """Copies that one function asked for."""

    count: int = 0
    bytes: int = 0


@dataclass
class Work:
    """Calls of one function of the host."""

    count: int = 0
    seconds: float = 0.0
    """CPU time without kernels, and without other functions that are watched."""


@dataclass
class Ledger:
    """What was copied and worked, by function."""

    to_host: dict[str, Copies] = field(default_factory=dict)
    """The device is waited for each time."""
    to_device: dict[str, Copies] = field(default_factory=dict)
    work: dict[str, Work] = field(default_factory=dict)
    kernels: float = 0.0
    """CPU time of recorded launches [s]."""
    _inner: list[float] = field(default_factory=list)

    def timed(self, name: str, function: Callable[..., Any]) -> Callable[..., Any]:
        """Return ``function`` with its own work counted as ``name``."""

        @functools.wraps(function)
        def timed(*arguments: Any, **options: Any) -> Any:
            begin, kernels = time.process_time(), self.kernels
            self._inner.append(0.0)
            try:
                return function(*arguments, **options)
            finally:
                spent = time.process_time() - begin - (self.kernels - kernels)
                one = self.work.setdefault(name, Work())
                one.count += 1
                one.seconds += spent - self._inner.pop()
                if self._inner:
                    self._inner[-1] += spent

        return timed

    def launches(self, function: Callable[..., Any]) -> Callable[..., Any]:
        """Return ``function``, which only launches kernels, with its time counted as theirs."""

        @functools.wraps(function)
        def launched(*arguments: Any, **options: Any) -> Any:
            begin, before = time.process_time(), self.kernels
            try:
                return function(*arguments, **options)
            finally:
                self.kernels = before + time.process_time() - begin

        return launched


def _add(copies: dict[str, Copies], size: int) -> None:
    """Count a copy of ``size`` bytes for the function of the package that asked for it."""
    frame: Any = sys._getframe(2)
    name = ""
    while frame:
        module = frame.f_globals.get("__name__", "")
        if module.startswith("warpsplat."):
            name = f"{module.removeprefix('warpsplat.')}.{frame.f_code.co_name}"
            if module not in INNER:
                break
        frame = frame.f_back
    one = copies.setdefault(name, Copies())
    one.count += 1
    one.bytes += size


def _size(array: wp.array) -> int:
    return int(array.size * wp.types.type_size_in_bytes(array.dtype))


@contextlib.contextmanager
def counting(watched: Sequence[tuple[Any, str]] = ()) -> Iterator[Ledger]:
    """Count the copies that the block would make on a GPU, and time functions: (module or class, name)."""
    ledger = Ledger()
    numpy, assign, make = wp.array.numpy, wp.array.assign, wp.array.__init__

    def counted_numpy(self: wp.array) -> np.ndarray:
        _add(ledger.to_host, _size(self))
        return numpy(self)

    def counted_assign(self: wp.array, source: Any) -> None:
        _add(ledger.to_device, _size(self))
        assign(self, source)

    def counted_make(self: wp.array, data: Any = None, *arguments: Any, **options: Any) -> None:
        if isinstance(data, np.ndarray):
            _add(ledger.to_device, data.nbytes)
        make(self, data, *arguments, **options)

    changes: list[tuple[Any, str, Any]] = [
        (wp.array, "numpy", counted_numpy),
        (wp.array, "assign", counted_assign),
        (wp.array, "__init__", counted_make),
        (wp, "capture_launch", ledger.launches(wp.capture_launch)),
        (Program, "run", ledger.launches(Program.run)),
    ]
    changes += [(owner, name, ledger.timed(name, getattr(owner, name))) for owner, name in watched]
    originals = [getattr(owner, name) for owner, name, _ in changes]
    for owner, name, value in changes:
        setattr(owner, name, value)
    try:
        yield ledger
    finally:
        for (owner, name, _), value in zip(changes, originals, strict=True):
            setattr(owner, name, value)
