"""The connection to a Ray cluster, or to one of this machine alone that lasts as long as the connection."""

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


@contextlib.contextmanager
def connected(ray: ModuleType, address: str) -> Iterator[bool]:
    """Connect to a cluster for a block; yield whether it was started for it. ``address``: see ``RayCluster``.

    Raises ``UsageError`` if there is no such cluster, or it has other versions of Ray or Python.
    """
    with _quiet():
        with _signal_handlers_kept():
            own = _connect(ray, address)
        try:
            yield own
        finally:
            with _signal_handlers_kept():
                ray.shutdown()


def _connect(ray: ModuleType, address: str) -> bool:
    """Connect to a cluster, perhaps a new one; return whether it is new."""
    named = address or os.environ.get("RAY_ADDRESS", "")
    found = _own_address() if named in ("", "auto") else named
    try:
        if not _answers(found):  # Ray itself would try for minutes
            raise ConnectionError
        _init(ray, found)
        return found == "local"
    except ConnectionError as error:
        if named:
            raise UsageError(f"--executor ray: no Ray cluster answers at {printable(named)}") from error
        _init(ray, "local")
        return True


def _own_address() -> str:
    """Return the address of the cluster that this machine belongs to, or did; ``auto``: Ray looks for one."""
    try:
        services: Any = importlib.import_module("ray._private.services")
        found: str = services.get_ray_address_from_environment("auto", None)
        return found
    except (ImportError, AttributeError, TypeError, ConnectionError):
        return "auto"


def _answers(address: str) -> bool:
    """Return whether a server listens at ``host:port``; True for an address of another form."""
    host, _, port = address.removeprefix("ray://").rpartition(":")
    if not host or not port.isdigit():
        return True
    try:
        socket.create_connection((host.strip("[]"), int(port)), timeout=5.0).close()
    except (OSError, OverflowError):
        return False
    return True


def _init(ray: ModuleType, address: str) -> None:
    options: dict[str, Any] = {"configure_logging": False, "log_to_driver": False}
    if address == "local":
        options |= {"include_dashboard": False, "object_store_memory": 200_000_000}
    try:
        ray.init(address=address, **options)
    except (RuntimeError, ValueError, ImportError) as error:
        raise UsageError(f"--executor ray: {printable(address)}: {ray_cause(error)}") from error


def ray_cause(error: BaseException) -> str:
    """Return the cause of an error of Ray in one line: the last error in its text, or the first line."""
    lines = [line.strip() for line in str(error).splitlines() if line.strip()] or [type(error).__name__]
    return printable(next((line for line in reversed(lines) if "Error: " in line), lines[0]))


@contextlib.contextmanager
def _quiet() -> Iterator[None]:
    """Keep Ray from printing about lost workers to stdout, where results may go; no option does that."""
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
def _signal_handlers_kept() -> Iterator[None]:
    """Restore signal handlers after the block: Ray replaces the one of SIGTERM."""
    kept = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield
    finally:
        with contextlib.suppress(ValueError):  # not the main thread
            for number, handler in kept.items():
                signal.signal(number, handler)
