"""Runs recorded launches on the CPU with kernels whose every access to memory is seen (``trace.h``).

Warp compiles each module once more, with ``trace.h`` in front of it, which takes a quarter of a second.
"""

from __future__ import annotations

import contextlib
import ctypes
import functools
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import warp as wp
from warp._src import context

from warpsplat.rendering import program as programs
from warpsplat.rendering.program import Launch, Program

WORD = 4
"""Bytes that are followed each."""

TRACED = {
    "extra_build_options": wp.ModuleBuildOptions(
        extra_cpu_preamble=Path(__file__).with_name("trace.h").read_text("utf-8")
    ),
    "optimization_level": 0,
    "cpu_compiler_flags": "-ffp-contract=off",  # so that the bits are the usual ones
}
"""Options of traced modules."""

KINDS = (
    "written by two threads",
    "written by two threads, with the same bits",
    "read by one thread and written by another",
    "a sum or extremum of floats by an atomic operation",
)


class _Region(ctypes.Structure):
    """As in ``trace.h``."""

    _fields_ = [
        *((name, ctypes.c_void_p) for name in ("begin", "end", "writer", "reader")),
        *((name, ctypes.c_uint64) for name in ("bytes_read", "bytes_written")),
        ("races", ctypes.c_uint64 * len(KINDS)),
        ("word", ctypes.c_uint64),
    ]


class _Trace(ctypes.Structure):
    """As in ``trace.h``."""

    _fields_ = [
        ("order", ctypes.c_void_p),
        ("regions", ctypes.POINTER(_Region)),
        *(
            (name, ctypes.c_uint64)
            for name in ("count", "outside", "simple", "slow", "thread", "loads", "longest", "last")
        ),
    ]


@dataclass(frozen=True)
class Race:
    """What threads of one launch do to each other."""

    kernel: str
    arrays: str
    """Parameters that name the memory."""
    kind: str
    """One of ``KINDS``."""
    words: int
    """How many."""


@dataclass
class Tracer:
    """Collects what launches do; made by ``tracing``."""

    rng: np.random.Generator | None = None
    """Shuffles the threads of each launch; without, they run in their order."""
    races: list[Race] = field(default_factory=list)
    outside: set[str] = field(default_factory=set)
    """Kernels that touched memory of none of their arrays."""
    kernels: set[str] = field(default_factory=set)
    """Names of all that were launched."""

    def run(self, command: wp.Launch) -> None:
        """Launch ``command`` and look at what it does."""
        kernel = command.kernel
        threads = int(command.params[0].size)
        memory = _Regions(_arrays(kernel, command.params[1:]))
        trace = _Trace(regions=memory.regions, count=len(memory.names))
        order = None if self.rng is None else self.rng.permutation(threads).astype(np.uint32)
        trace.order = None if order is None else order.ctypes.data
        _entry(kernel)(ctypes.byref(trace))
        command.launch()
        assert trace.thread, f"{kernel.key} asks for its thread in a way that trace.h does not know"
        self.kernels.add(kernel.key)
        self.races += memory.races(kernel.key)
        if trace.outside:
            self.outside.add(kernel.key)


class _Regions:
    """Memory of a launch's arrays, those that overlap as one, and what is known of each of its words."""

    def __init__(self, arrays: list[tuple[str, int, int]]) -> None:
        """``arrays``: names, first addresses, ends."""
        merged: list[tuple[list[str], int, int]] = []
        for name, begin, end in sorted(arrays, key=lambda one: one[1:]):
            if merged and begin < merged[-1][2]:
                names, first, last = merged.pop()
                merged.append(([*names, name], first, max(last, end)))
            else:
                merged.append(([name], begin, end))
        self.names = [", ".join(names) for names, _, _ in merged]
        self.regions = (_Region * len(merged))()
        self._touched: list[tuple[npt.NDArray[np.uint32], npt.NDArray[np.uint32]]] = []  # kept for C
        for region, (_, begin, end) in zip(self.regions, merged, strict=True):
            words = -(-(end - begin) // WORD)
            writer, reader = np.zeros(words, np.uint32), np.zeros(words, np.uint32)
            self._touched.append((writer, reader))
            region.begin, region.end = begin, end
            region.writer, region.reader = writer.ctypes.data, reader.ctypes.data

    def races(self, kernel: str) -> list[Race]:
        """Return what threads did to each other."""
        return [
            Race(kernel, name, kind, count)
            for name, region in zip(self.names, self.regions, strict=True)
            for kind, count in zip(KINDS, region.races, strict=True)
            if count
        ]


def _arrays(kernel: wp.Kernel, values: list[Any]) -> list[tuple[str, int, int]]:
    """Return names, first addresses and ends of a launch's arrays, those in structs too."""
    found: list[tuple[str, int, int]] = []

    def walk(name: str, value: Any) -> None:
        if hasattr(value, "strides") and hasattr(value, "data"):
            if value.data and value.shape[0]:
                found.append((name, value.data, value.data + value.shape[0] * value.strides[0]))
        elif isinstance(value, ctypes.Structure):
            for label, *_ in value._fields_:
                walk(label, getattr(value, label))

    for argument, value in zip(kernel.adj.args, values, strict=True):
        walk(argument.label, value)
    return found


def _entry(kernel: wp.Kernel) -> Any:
    """Return the function of a loaded, traced module that takes the ``_Trace`` of the next launch."""
    return _entry_of(kernel.module.execs[None, 1].handle)


@functools.cache
def _entry_of(handle: str) -> Any:
    runtime: Any = context.runtime
    address = runtime.llvm.wp_lookup(handle.encode(), b"warpsplat_trace")
    return ctypes.CFUNCTYPE(None, ctypes.c_void_p)(address)


@contextlib.contextmanager
def tracing(tracer: Tracer) -> Iterator[Tracer]:
    """Trace all launches that are recorded within the block, also where they are replayed after it.

    Steps made for two threads are not captured as graphs; their launches are not split here.
    """
    before: dict[wp.Module, dict[str, Any]] = {}
    original = Program.launch

    def launch(self: Program, kernel: wp.Kernel, dim: Any, *sources: object, **values: Any) -> None:
        _compile_traced(kernel.module, before)
        count = len(self.launches)
        original(self, kernel, dim, *sources, **{**values, "split": False})
        if len(self.launches) > count:
            command, _ = self._commands[-1]
            self.launches[-1] = Launch(self.stage, kernel.key, (lambda: tracer.run(command),))

    programs.Program.launch = launch  # type: ignore[method-assign]
    try:
        yield tracer
    finally:
        programs.Program.launch = original  # type: ignore[method-assign]
        for module, options in before.items():
            module.options.clear()
            module.options.update(options)
            module.mark_modified()


def _compile_traced(module: wp.Module, before: dict[wp.Module, dict[str, Any]]) -> None:
    """Have Warp compile ``module`` with tracing when it is next loaded."""
    if module not in before:
        before[module] = dict(module.options)
        module.options.update(TRACED)
        module.mark_modified()
