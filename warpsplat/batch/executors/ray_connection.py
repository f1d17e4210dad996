"""Connect to a Ray cluster, or start one on this machine for the time of the connection."""

from __future__ import annotations

import contextlib
import importlib
import logging
import os
import signal
import socket
from collections.abc import Iterator
from types import ModuleType
from typing import Any

from warpsplat.errors import UsageError, printable

STORE = 200_000_000
"""Memory for data between processes, in a cluster on this machine [bytes]."""

WAIT = 5.0
"""Seconds for a cluster to answer."""


@contextlib.contextmanager
def connected(ray: ModuleType, address: str) -> Iterator[None]:
    """Connect to a cluster for a block; an existing connection of this process is used and kept.

    Args:
        ray: the package.
        address: as ``RayCluster`` has it.

    Raises:
        UsageError: there is no such cluster, or it has other versions of Ray or Python.
    """
    if ray.is_initialized():
        yield
        return
    with _quiet():
        with _handlers_kept():
            _connect(ray, address)
        try:
            yield
        finally:
            with _handlers_kept():
                ray.shutdown()


def _connect(ray: ModuleType, address: str) -> None:
    named = address or os.environ.get("RAY_ADDRESS", "")
    place = _here() if named in ("", "auto") else named
    try:
        if not _answers(place):  # Ray itself would try for minutes
            raise ConnectionError
        _init(ray, place)
    except ConnectionError as error:
        if named:
            raise UsageError(f"--executor ray: no Ray cluster answers at {printable(named)}") from error
        _init(ray, "local")


def _here() -> str:
    """Return the address of the cluster that this machine belongs to, or ``auto``: Ray searches."""
    try:
        services: Any = importlib.import_module("ray._private.services")
        found: str = services.get_ray_address_from_environment("auto", None)
        return found
    except (ImportError, AttributeError, TypeError, ConnectionError):
        return "auto"


def _answers(address: str) -> bool:
    """Return whether a server listens at ``host:port``; True for other forms of addresses."""
    host, _, port = address.removeprefix("ray://").rpartition(":")
    if not host or not port.isdigit():
        return True
    try:
        socket.create_connection((host.strip("[]"), int(port)), timeout=WAIT).close()
    except (OSError, OverflowError):
        return False
    return True


def _init(ray: ModuleType, address: str) -> None:
    options: dict[str, Any] = {"configure_logging": False, "log_to_driver": False}
    if address == "local":
        options |= {"include_dashboard": False, "object_store_memory": STORE}
    try:
        ray.init(address=address, **options)
    except (RuntimeError, ValueError, ImportError) as error:
        raise UsageError(f"--executor ray: {printable(address)}: {cause_of(error)}") from error


def cause_of(error: BaseException) -> str:
    """Return the last error in the text of Ray's exception, or its first line."""
    lines = [line.strip() for line in str(error).splitlines() if line.strip()] or [type(error).__name__]
    return printable(next((line for line in reversed(lines) if "Error: " in line), lines[0]))


@contextlib.contextmanager
def _quiet() -> Iterator[None]:
    """Keep Ray from printing about lost workers to stdout, for which it has no option."""
    log = logging.getLogger("ray")
    with contextlib.ExitStack() as stack:
        stack.callback(log.setLevel, log.level)
        log.setLevel(logging.ERROR)
        with contextlib.suppress(ImportError, AttributeError):
            private: Any = importlib.import_module("ray._private.worker")
            stack.callback(setattr, private, "print_to_stdstream", private.print_to_stdstream)
            private.print_to_stdstream = lambda *given, **named: None
        yield


@contextlib.contextmanager
def _handlers_kept() -> Iterator[None]:
    """Restore the signal handlers after the block: Ray replaces SIGTERM's."""
    kept = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield
    finally:
        with contextlib.suppress(ValueError):  # not the main thread, which has none
            for number, handler in kept.items():
                signal.signal(number, handler)
