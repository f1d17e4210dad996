"""The engines that are kept for the next call, and which of them serves one."""

from __future__ import annotations

import contextlib
import functools
import threading
from collections.abc import Iterator
from dataclasses import replace

import torch
import warp as wp

from warpsplat.errors import UsageError
from warpsplat.native import machine_memory
from warpsplat.rendering import memory
from warpsplat.rendering.device import start_warp
from warpsplat.rendering.device_lock import device_lock
from warpsplat.torch.cuda import is_capturing, shared_stream
from warpsplat.torch.engine import Engine, RenderSpec

KEPT = 32
"""Most engines that are kept, besides those whose forward pass a backward pass may still ask for."""

UNKNOWN_MEMORY = 2**33
"""Memory of a machine that does not say how much it has [bytes]."""

Key = tuple[object, ...]

engines: list[tuple[Key, Engine]] = []
"""All but those in CUDA graphs of torch, with the keys of their specifications; the one used last is last."""

captured: dict[Key, Engine] = {}
"""Those in CUDA graphs of torch, which replay them without a call: they do nothing else."""

_engines_lock = threading.Lock()


def clear_cache() -> None:
    """Free the renderers that are kept for further calls. They are recorded again when they are needed.

    CUDA graphs of torch that hold some must not be replayed afterwards.
    """
    with _engines_lock:
        engines.clear()
        for engine in captured.values():
            wp.synchronize_device(engine.device)  # torch may be replaying its graphs on any stream
        captured.clear()


def check_memory(spec: RenderSpec, count: int = 1) -> None:
    """Raise a ``ResourceError`` if there is no memory for ``count`` images."""
    memory.check_memory(spec.viewport, warp_device(spec.device), count)


@contextlib.contextmanager
def engine_of(spec: RenderSpec, number: int = 0) -> Iterator[Engine]:
    """Yield an engine for ``spec``, for this thread alone and in ``shared_stream``.

    ``number``: of the forward pass that is asked for; the engine has it if any has.
    """
    with device_lock(warp_device(spec.device)), shared_stream(spec.device):
        with _engines_lock:
            engine = _captured_engine(spec) if is_capturing(spec.device) else _engine_with(spec, number)
        try:
            yield engine
        finally:
            engine.lock.release()


def _engine_with(spec: RenderSpec, number: int) -> Engine:
    """Return the engine that has a forward pass, or a free one, or a new one; locked."""
    key = spec.key
    own = [engine for other, engine in reversed(engines) if other == key]
    for engine in own:
        if number and engine.number == number:
            return _taken(key, engine)
    for engine in own:
        if not engine.is_held and engine.lock.acquire(blocking=False):
            return _used(key, engine)
    _free_idle(spec.device, own[0].bytes if own else 0)
    if own and _bytes(spec.device) + own[0].bytes > _limit(spec.device):
        return _taken(key, own[-1])  # whose forward pass is made again when it is asked for
    engine = Engine(spec)
    engine.lock.acquire()
    engines.append((key, engine))
    _free_idle(spec.device, 0, besides=engine)
    return engine


def _taken(key: Key, engine: Engine) -> Engine:
    """Wait for an engine and return it. Those who have it do not need the lock that is held here."""
    engine.lock.acquire()
    return _used(key, engine)


def _used(key: Key, engine: Engine) -> Engine:
    """Return an engine, which is now the one used last."""
    engines.sort(key=lambda pair: pair[1] is engine)
    return engine


def _free_idle(device: torch.device, wanted: int, besides: Engine | None = None) -> None:
    """Drop those that have not been used for longest, while there are too many or too large ones for
    ``wanted`` more bytes.
    """
    idle = [pair for pair in engines if not pair[1].is_held]
    surplus = len(idle) - KEPT
    for pair in idle:
        if surplus <= 0 and _bytes(device) + wanted <= _limit(device):
            return
        if pair[1] is not besides:
            engines.remove(pair)
            surplus -= 1


def _bytes(device: torch.device) -> int:
    """Return the memory of all engines on a device."""
    own = warp_device(device)
    return sum(engine.bytes for _, engine in engines if engine.device == own)


@functools.cache
def _limit(device: torch.device) -> float:
    """Return the most memory of all engines on a device."""
    own = warp_device(device)
    kept_share = 0.25  # share of a device's memory that all engines may take; one is there in any case
    return kept_share * ((machine_memory() if own.is_cpu else own.total_memory) or UNKNOWN_MEMORY)


def _captured_engine(spec: RenderSpec) -> Engine:
    """Return an engine of ``captured``, or one that leaves ``engines``, as large as it is; locked."""
    engine = captured.get(spec.key)
    if engine is None:
        pair = next(pair for pair in reversed(engines) if pair[0] == spec.key)
        engines.remove(pair)
        engine = captured[spec.key] = pair[1]
    engine.lock.acquire()
    engine.freeze()
    return engine


def known(spec: RenderSpec) -> RenderSpec:
    """Return ``spec`` with the ``opaque`` of an engine that there is, preferably true: it suits all values.

    Raises:
        UsageError: there is no engine.
    """
    for opaque in (True, False):
        found = replace(spec, opaque=opaque)
        if found.key in captured or any(key == found.key for key, _ in engines):
            return found
    raise UsageError("a CUDA graph can only hold a scene of a structure and size that was rendered before")


def warp_device(device: torch.device) -> wp.Device:
    """Return Warp's device, starting Warp."""
    if device.type not in ("cpu", "cuda"):
        raise UsageError(f"tensors are on {device}, neither on the CPU nor on CUDA")
    cpu = _start()
    return cpu if device.type == "cpu" else wp.device_from_torch(device)


@functools.cache
def _start() -> wp.Device:
    """Start Warp and return its CPU."""
    start_warp()
    return wp.get_device("cpu")
