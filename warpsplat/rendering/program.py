"""A fixed list of kernel launches, recorded once and replayed every step."""

from __future__ import annotations

import contextlib
import copy
import ctypes
import functools
import itertools
import logging
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import warp as wp
from warp._src.codegen import Struct

from warpsplat.errors import cause_of
from warpsplat.native import messages_hidden
from warpsplat.rendering.device_lock import exclusive
from warpsplat.rendering.helpers import shared
from warpsplat.rendering.kernel_cache import expect, load

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Launch:
    """One kernel or host function, as the pieces that may run at the same time."""

    stage: str
    name: str
    """Name of the kernel or function."""
    pieces: tuple[Callable[[], None], ...]


class Program:
    """Launches in order. On a CPU with several threads, a split launch runs as pieces of its range.

    They are recorded when the first of them is needed, so that the kernels of all programs that have been
    prepared by then are compiled side by side.

    Warp runs a CPU launch on one thread but releases the interpreter lock, and every kernel here takes the
    index of its first thread and writes only its own elements, so pieces may run at the same time and the
    result does not depend on how many there are. Not copied: arrays are those given when recorded.
    """

    def __init__(self, device: wp.Device, threads: int = 1, stage: str = "") -> None:
        """``threads``: of a CPU. Where no thread can be started, the caller's does the work."""
        self.device = device
        self.threads = threads if device.is_cpu else 1
        self.stage = stage
        """Name of the launches that are added from now on, for ``run_timed``."""
        self._launches: list[Launch] = []
        self._added: list[Callable[[Program], Launch]] = []
        """Recording of the launches that were added since."""
        # Recorded launches hold addresses only.
        self._arrays: list[Sequence[Any]] = []
        self._commands: list[tuple[wp.Launch, ctypes.Structure | None]] = []
        self._places: dict[str, list[Any]] = {}
        """Where the launches recorded so far have an array, by its name; see ``rebind``."""

    def launch(
        self,
        kernel: wp.Kernel,
        dim: int | tuple[int, ...],
        *sources: object,
        split: bool = False,
        **values: Any,
    ) -> None:
        """Append a launch, whose kernel may be compiled meanwhile. An empty range is left out.

        Args:
            kernel: its first parameter is the index of a piece's first thread.
            dim: threads.
            sources: mappings and objects in which the other parameters are looked up by their names.
            split: whether pieces of the range may run on several threads.
            values: parameters by name, over the sources.

        Raises:
            TypeError: a parameter is missing or stands in two sources, or a value is no parameter.
        """
        shape = (dim,) if isinstance(dim, int) else tuple(dim)
        if min(shape) == 0:
            return
        arguments = bind(kernel, sources, values)
        self._arrays.append(arguments)
        expect(kernel, self.device)
        # A split launch is cut finer than there are threads, so that uneven pieces balance.
        pieces_per_thread = 4
        count = min(self.threads * pieces_per_thread, shape[0]) if split and self.threads > 1 else 1
        stage = self.stage
        self._added.append(lambda program: program._record(stage, kernel, shape, arguments, count))

    def _record(
        self, stage: str, kernel: wp.Kernel, shape: tuple[int, ...], arguments: list[Any], count: int
    ) -> Launch:
        """Return a launch in ``count`` pieces."""
        load(kernel, self.device)
        whole = wp.launch(kernel, dim=shape, inputs=[0, *arguments], device=self.device, record_cmd=True)
        assert whole is not None
        if count == 1:
            commands: list[tuple[wp.Launch, ctypes.Structure | None]] = [(whole, None)]
        else:
            borders = [shape[0] * i // count for i in range(count + 1)]
            parts = (
                part(whole, start, (stop - start, *shape[1:])) for start, stop in itertools.pairwise(borders)
            )
            commands = [(command, pack(command)) for command in parts]
        self._commands += commands
        return Launch(stage, kernel.key, tuple(itertools.starmap(replay, commands)))

    def record(self) -> None:
        """Load the kernels of the launches that were added, and record these."""
        while self._added:
            self._launches.append(self._added[0](self))
            del self._added[0]

    @property
    def launches(self) -> list[Launch]:
        """All launches, recorded."""
        self.record()
        return self._launches

    def rebind(self, name: str, pointer: int) -> None:
        """Give the array ``name``, which only this program has, other memory: in all its launches. The caller
        keeps that alive.
        """
        self.record()
        if name not in self._places:
            self._places[name] = [
                place
                for command, packed in self._commands
                for index, argument in enumerate(command.kernel.adj.args)
                if argument.label == name
                for place in (command.params[1 + index], *([getattr(packed, name)] if packed else []))
            ]
        for place in self._places[name]:
            place.data = pointer

    def memory(self) -> dict[int, int]:
        """Return the bytes of the arrays of all launches, by address."""
        arrays = (array for arguments in self._arrays for array in _arrays(arguments))
        return {array.ptr: array.capacity for array in arrays if array.ptr}

    def call(self, function: Callable[..., None], *arguments: Any) -> None:
        """Append a host function that launches device work (a scan, a sort)."""
        launch = Launch(self.stage, function.__name__, (lambda: function(*arguments),))
        self._added.append(lambda _: launch)

    def run(self) -> None:
        """Replay all launches."""
        for launch in self.launches:
            shared(launch.pieces, self.threads)

    def run_timed(self) -> dict[tuple[str, str], float]:
        """Replay all launches, waiting for the device after each; seconds by stage and name."""
        seconds: dict[tuple[str, str], float] = {}
        for launch in self.launches:
            begin = time.perf_counter()
            shared(launch.pieces, self.threads)
            wp.synchronize_device(self.device)
            spent = time.perf_counter() - begin
            key = (launch.stage, launch.name)
            seconds[key] = seconds.get(key, 0.0) + spent
        return seconds


def launch_on_host(kernel: wp.Kernel, count: int, *sources: object, **values: Any) -> None:
    """Run ``count`` threads of a kernel on NumPy arrays, on the CPU; what it writes are whole arrays.

    ``sources`` and ``values`` as of ``Program.launch``.
    """
    program = Program(wp.get_device("cpu"))
    program.launch(kernel, count, *sources, **values)
    program.run()


class Replay:
    """Programs in order: as one graph, without Python in between, where there can be one."""

    def __init__(self, device: wp.Device, programs: Sequence[Program], *, captured: bool = True) -> None:
        """``captured``: whether a graph may be made, which runs nothing on the host."""
        self._device, self._programs = device, programs
        self.graph = capture(device, programs) if captured else None

    def __call__(self) -> None:
        """Run the programs."""
        if not (self.graph and self._launch(self.graph)):
            for program in self._programs:
                program.run()

    def _launch(self, graph: wp.Graph) -> bool:
        """Launch the graph; return whether it could be instantiated, which its first launch does."""
        try:
            with contextlib.nullcontext() if graph.graph_exec else _quiet(self._device):
                wp.capture_launch(graph)
            return True
        except RuntimeError as error:
            if self._device.is_cpu or graph.graph_exec:
                raise
            self.graph = None
            _do_without_graph(self._device, error)
            return False


def capture(device: wp.Device, programs: Sequence[Program]) -> wp.Graph | None:
    """Capture a graph that replays ``programs``; None where that is not possible.

    A CPU graph runs on one thread, so it is not used instead of several threads; nor is one captured while
    other threads work (``device_lock``), whose launches would become part of it. A GPU needs its memory pool,
    as scans and sorts take their scratch memory from it.
    """
    if device.is_cpu:
        if any(program.threads > 1 for program in programs):
            return None
    elif not wp.is_mempool_enabled(device):
        return None
    for program in programs:
        program.record()
    with exclusive() as alone:
        if not alone and device.is_cpu:
            return None
        try:
            with _quiet(device), wp.ScopedCapture(device) as captured:
                for program in programs:
                    program.run()
        except RuntimeError as error:  # what else is wrong with a launch shows without a graph as well
            _do_without_graph(device, error)
            return None
        return captured.graph


def _quiet(device: wp.Device) -> contextlib.AbstractContextManager[object]:
    """Hide what Warp prints about calls that CUDA refuses."""
    return messages_hidden() if device.is_cuda else contextlib.nullcontext()


def _do_without_graph(device: wp.Device, error: RuntimeError) -> None:
    """Go on after a graph that could not be made; what was recorded of it is freed with it."""
    _announce_launches(str(device), cause_of(error))
    if device.is_cuda:
        # CUDA keeps the error of a call for whoever asks next, and CUB asks after each of its launches.
        with _quiet(device):
            device.runtime.core.wp_cuda_context_check(device.context)


@functools.cache
def _announce_launches(device: str, cause: str) -> None:
    """Log, once per process, why a GPU is slower than it could be."""
    log.info("%s: kernels are launched one by one, without a graph: %s", device, cause)


def part(whole: wp.Launch, start: int, shape: tuple[int, ...]) -> wp.Launch:
    """Return a recorded launch whose threads start at ``start``, in a fraction of the time to record it."""
    command = copy.copy(whole)
    command.params, command.fwd_args = list(whole.params), list(whole.fwd_args or ())
    command.set_dim(shape)
    command.set_param_at_index(0, start)
    return command


QUICK_VERSIONS = ("1.19.",)
"""Versions of Warp whose CPU kernels can be called as ``replay`` does."""


def pack(command: wp.Launch) -> ctypes.Structure | None:
    """Return the arguments of a launch on a CPU as its kernel takes them; None where that is unknown.

    Packing takes 7 us a piece, in which it holds the interpreter lock that other threads wait for: up to a
    tenth of a step.
    """
    if not wp.__version__.startswith(QUICK_VERSIONS):
        return None
    labels = (argument.label for argument in command.kernel.adj.args)
    return _layout(tuple(zip(labels, map(type, command.params[1:]), strict=True)))(*command.params[1:])


def replay(command: wp.Launch, packed: ctypes.Structure | None) -> Callable[[], None]:
    """Return a function that launches ``command`` with the arguments of ``pack``."""
    if packed is None:
        return command.launch
    return functools.partial(command.hooks.forward, ctypes.byref(command.params[0]), ctypes.byref(packed))


@functools.cache
def _layout(fields: tuple[tuple[str, Any], ...]) -> type[ctypes.Structure]:
    """The C structure of a kernel's arguments."""
    return type("Arguments", (ctypes.Structure,), {"_fields_": list(fields)})


def bind(kernel: wp.Kernel, sources: Sequence[object], values: Mapping[str, Any]) -> list[Any]:
    """Return the arguments of ``kernel`` but the first, found by name, structs by their fields; see
    ``Program.launch``.

    Raises:
        TypeError: a parameter is missing or stands in two sources, or a value is no parameter.
    """
    used: set[str] = set()
    try:
        found = [_value(each.label, each.type, sources, values, used) for each in kernel.adj.args[1:]]
    except LookupError as error:
        raise TypeError(f"{kernel.key}: {error.args[0]}") from None
    if unknown := values.keys() - used:
        raise TypeError(f"{kernel.key} has no parameter {', '.join(sorted(unknown))}")
    return found


def _value(name: str, kind: Any, sources: Sequence[object], values: Mapping[str, Any], used: set[str]) -> Any:
    """Return the argument for a parameter, and add to ``used`` the names of which it is made.

    No closure, which would be a cycle that keeps the arrays until garbage is collected.
    """
    if isinstance(kind, Struct):
        made = kind()
        for field, variable in kind.vars.items():
            setattr(made, field, _value(field, variable.type, sources, values, used))
        return made
    used.add(name)
    fitting = [values[name]] if name in values else _lookup(name, sources)
    if len(fitting) != 1:
        raise LookupError(f"parameter {name} is {'missing' if not fitting else 'ambiguous'}")
    return fitting[0]


def _arrays(values: Iterable[Any]) -> Iterator[wp.array]:
    """Yield the arrays among arguments, those in structs too."""
    for value in values:
        if isinstance(value, wp.array):
            yield value
        elif hasattr(value, "__ctype__"):
            yield from _arrays(vars(value).values())


def _lookup(name: str, sources: Sequence[object]) -> list[Any]:
    """Return the values of ``name`` in the sources."""
    found = []
    for source in sources:
        if isinstance(source, Mapping):
            found += [source[name]] if name in source else []
        elif hasattr(source, name):
            found.append(getattr(source, name))
    return found
