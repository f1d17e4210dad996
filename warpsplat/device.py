"""Choosing a device."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator

import warp as wp

from warpsplat.errors import UsageError


@contextlib.contextmanager
def _native_messages_hidden() -> Iterator[None]:
    """Send the process's standard error to nowhere: native code writes there behind Python's back."""
    try:
        saved = os.dup(2)
        nowhere = os.open(os.devnull, os.O_WRONLY)
    except OSError:
        yield
        return
    try:
        os.dup2(nowhere, 2)
        yield
    finally:
        os.dup2(saved, 2)
        os.close(saved)
        os.close(nowhere)


def start_warp() -> None:
    """Start Warp without its greeting and without a warning where there is no GPU."""
    wp.config.log_level = wp.LOG_WARNING
    with _native_messages_hidden():
        wp.init()


def choose_device(name: str = "auto") -> wp.Device:
    """``auto`` (the first GPU, else the CPU), ``cpu``, ``cuda`` or ``cuda:N``.

    Raises:
        UsageError: there is no such device here.
    """
    if name == "auto":
        return wp.get_device("cuda:0" if wp.is_cuda_available() else "cpu")
    try:
        with _native_messages_hidden():
            return wp.get_device(name)
    except Exception as error:
        found = ", ".join(str(d) for d in wp.get_devices())
        raise UsageError(f"unknown device {name!r}; here there are: {found}") from error
