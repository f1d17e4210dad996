"""The native functions of Warp that have to do with CUDA, on the streams and the memory of this process.

Names and arguments are those of ``warp/_src/context.py``; what each does is to be read in ``native/warp.cu``.
"""

from __future__ import annotations

import ctypes
import os
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from tests.fake_cuda import options
from tests.fake_cuda.memory import FREED, NEW, Block
from tests.fake_cuda.rules import report
from tests.fake_cuda.streams import (
    CAPTURE_IMPLICIT,
    CAPTURE_INVALIDATED,
    CAPTURE_UNSUPPORTED,
    ILLEGAL_ADDRESS,
    INVALID_IMAGE,
    INVALID_VALUE,
    LAUNCH_FAILURE,
    OUT_OF_MEMORY,
    Capture,
    CudaError,
    Event,
    Machine,
    Stream,
    Work,
)

CURRENT = (1 << 64) - 1
"""The handle that stands for a context's current stream."""

CONTEXT = 0xC0DE000
"""Handle of the context of device 0; those of the others follow."""

WORD = 4
"""Bytes of a number that is scanned or sorted: of int32, which the product's are."""

MARK = "test device"
"""First words of what is compiled for it."""

Touched = tuple[int, int, str]
"""Memory that work reads or writes: address, bytes and what it is called."""


class Driver:
    """One process's CUDA. ``kernels`` says which kernel of the CPU a handle stands for (``install.py``)."""

    def __init__(self, real: Any) -> None:
        self.real = real
        """Warp's native library."""
        self.machine = Machine(options.devices)
        self.current: dict[int, int] = {}  # device -> handle of its current stream
        self.events: dict[int, Event] = {}
        self.graphs: dict[int, list[Work]] = {}
        self.kernels: dict[int, Any] = {}
        self.modules: set[int] = set()
        self.after_capture: list[Block] = []
        self.launches = 0
        self.error = ""
        self.thread = threading.local()
        self.functions: dict[str, Callable[..., Any]] = {
            name: getattr(self, name) for name in dir(self) if name.startswith("wp_")
        }
        for name, answer in ANSWERS.items():
            self.functions[name] = lambda *_, answer=answer: answer

    @property
    def shift(self) -> int:
        """Offset from an address of device memory to the memory itself."""
        return self.machine.region.shift

    # Errors

    def fail(self, error: CudaError, function: str) -> Any:
        """Note and print an error; return what the function returns then."""
        self.error = f"Warp CUDA error {error.code}: {error} (in function {function}, the test device)"
        if self.real.wp_is_error_output_enabled():
            os.write(2, f"{self.error}\n".encode())
        if function == "wp_cuda_launch_kernel":
            return error.code
        return (
            None if function.startswith(("wp_alloc", "wp_cuda_load", "wp_cuda_device_get_primary")) else False
        )

    def wp_get_error_string(self) -> bytes:
        return self.error.encode()

    def check(self, function: str, *touched: Touched) -> None:
        """Refuse memory that the device cannot touch, as a real one would when it does."""
        for address, size, what in touched:
            wrong = self.machine.region.fault(address, size, self.device)
            block = self.machine.region.find(address)
            if not wrong and size and block and block.freed:
                wrong = "memory that was freed"
            if wrong:
                report(f"{function}, {what}: {wrong}")
                raise CudaError(INVALID_VALUE)

    def check_host(self, function: str, address: int) -> None:
        """Refuse device memory where memory of the host is wanted."""
        if self.machine.region.holds(address):
            report(f"{function}: device memory where the host's is wanted")
            raise CudaError(INVALID_VALUE)

    # Devices and contexts

    def wp_cuda_driver_version(self) -> int:
        return int(options.driver or self.real.wp_cuda_toolkit_version())

    def wp_cuda_device_get_count(self) -> int:
        return options.devices

    def wp_cuda_device_get_arch(self, device: int) -> int:
        return options.arch

    def wp_cuda_device_is_mempool_supported(self, device: int) -> int:
        return int(options.pools)

    def wp_cuda_device_get_uuid(self, device: int, buffer: Any) -> None:
        buffer[:] = bytes([device] * 16)

    def wp_cuda_device_get_memory_info(self, device: int, free: Any, total: Any) -> None:
        if free is not None:
            free._obj.value = max(0, options.memory - self.machine.region.used[device])
        if total is not None:
            total._obj.value = options.memory

    def wp_cuda_device_get_mempool_used_mem_current(self, device: int) -> int:
        return self.machine.region.used[device]

    def wp_cuda_device_get_primary_context(self, device: int) -> int:
        if options.fail == "context":
            raise CudaError(OUT_OF_MEMORY)
        return CONTEXT + device

    @property
    def context(self) -> int | None:
        """The context that is current in this thread."""
        return getattr(self.thread, "context", None)

    @property
    def device(self) -> int:
        """Number of its device."""
        return (self.context or CONTEXT) - CONTEXT

    def enter(self, context: int | None) -> None:
        """Make a context current, and leave it so, as ``ContextGuard`` does."""
        if context is not None:
            self.thread.context = context

    def wp_cuda_context_get_current(self) -> int | None:
        return self.context

    def wp_cuda_context_set_current(self, context: int | None) -> None:
        self.thread.context = context

    def wp_cuda_context_push_current(self, context: int) -> None:
        self.thread.stack = [*getattr(self.thread, "stack", []), self.context]
        self.thread.context = context

    def wp_cuda_context_pop_current(self) -> None:
        self.thread.context = self.thread.stack.pop()

    def wp_cuda_context_check(self, context: int) -> int:
        return self.machine.failed

    def wp_cuda_context_synchronize(self, context: int) -> bool:
        if any(stream.capture for stream in self.machine.all()):
            self.machine.invalidate(CAPTURE_UNSUPPORTED)
        self.machine.check_context()
        self.machine.finish_all(context - CONTEXT)
        self.machine.check_context()
        return True

    # Streams and events

    def stream(self, handle: int | None) -> Stream:
        """Return the stream of a handle."""
        if handle in (CURRENT, -1):
            handle = self.current.get(self.device, 0)
        return self.machine.streams[handle] if handle else self.machine.legacy[self.device]

    def wp_cuda_stream_create(self, context: int, priority: int) -> int:
        return self.machine.new_stream(context - CONTEXT).handle

    def wp_cuda_stream_destroy(self, context: int, handle: int) -> None:
        stream = self.machine.streams.get(handle)
        if stream:  # its work is done all the same
            self.machine.wait_for(stream, self.machine.now())
            del self.machine.streams[handle]

    def wp_cuda_context_set_stream(self, context: int, handle: int | None, sync: int) -> None:
        old = self.current.get(context - CONTEXT)
        self.current[context - CONTEXT] = handle or 0
        if sync and old:
            self.machine.let_wait(self.stream(handle), Event(self.stream(old), self.machine.now()))

    def wp_cuda_stream_synchronize(self, handle: int) -> bool:
        self.machine.finish(self.stream(handle))
        return True

    def wp_cuda_stream_is_capturing(self, handle: int) -> int:
        return int(self.stream(handle).capture is not None)

    def wp_cuda_stream_get_capture_id(self, handle: int) -> int:
        capture = self.stream(handle).capture
        return capture.id if capture else 0

    def wp_cuda_stream_wait_event(self, handle: int, event: int, external: bool) -> None:
        self.machine.let_wait(self.stream(handle), self.events[event])

    def wp_cuda_event_create(self, context: int, flags: int) -> int:
        handle = next(self.machine.handles)
        self.events[handle] = Event()
        return handle

    def wp_cuda_event_destroy(self, event: int) -> None:
        self.events.pop(event, None)

    def wp_cuda_event_record(self, event: int, handle: int, external: bool) -> bool:
        self.events[event] = Event(self.stream(handle), self.machine.now())
        return True

    # Memory

    def allocate(self, size: int) -> Block:
        """Return a block; work that is not done yet may free one."""
        block = self.machine.region.allocate(size, self.device)
        if block is None:
            for device in range(options.devices):
                self.machine.finish_all(device)
            block = self.machine.region.allocate(size, self.device)
        if block is None:
            raise CudaError(OUT_OF_MEMORY)
        return block

    def wp_alloc_device_default(self, context: int, size: int, tag: Any) -> int:
        self.enter(context)
        self.machine.check_context()
        if self.machine.captures:
            self.machine.invalidate(CAPTURE_UNSUPPORTED)
        return self.allocate(size).address

    def wp_alloc_device_async(self, context: int, size: int, handle: int, tag: Any) -> int:
        self.enter(context)
        self.machine.check_context()
        stream = self.stream(handle)
        self.machine.check_legacy(stream)
        block = self.allocate(size)
        if stream.capture:
            block.capture = stream.capture
            self.machine.submit(stream, lambda: self.machine.region.fill(block, NEW))
        return block.address

    def free(self, address: int, finish: bool) -> None:
        """Free a block: ``cudaFree``, which waits (``finish``), or ``cudaFreeAsync`` on the legacy stream."""
        block = self.machine.region.blocks.get(address)
        if block is None or block.freed:
            report("memory is freed that was freed, or never allocated")
            return
        block.freed = True
        if self.machine.captures:  # Warp frees what is freed in a capture when that has ended
            self.after_capture.append(block)
        elif not block.capture:  # what a graph allocates stays while there is the graph
            self.release(block, finish)

    def release(self, block: Block, finish: bool) -> None:
        """Give memory back in the order of the legacy stream.

        Streams that do not wait for that are not waited for: their work comes as late as it may, too late.
        """
        legacy = self.machine.legacy[block.device]
        legacy.queue.append((self.machine.now() + 1, lambda: self.machine.region.release(block)))
        next(self.machine.numbers)
        if finish:
            self.machine.finish_all(block.device)
        elif not all(stream.blocking for stream in self.machine.streams.values()):
            self.machine.wait_for(legacy, self.machine.now())

    def wp_free_device_async(self, context: int, address: int, node: Any = None) -> None:
        self.free(address, finish=False)

    def wp_free_device_default(self, context: int, address: int) -> None:
        self.free(address, finish=True)

    def wp_memcpy_h2d(self, context: int, to: int, source: int, size: int, handle: int) -> bool:
        self.enter(context)
        self.check("wp_memcpy_h2d", (to, size, "target"))
        self.check_host("wp_memcpy_h2d", source)
        stream = self.stream(handle)
        if stream.capture:
            report("a copy from the host in a capture: the graph keeps the host's address")
        data = ctypes.string_at(source, size)  # memory that is not pinned is copied at once
        self.machine.submit(stream, lambda: ctypes.memmove(to + self.shift, data, size))
        return True

    def wp_memcpy_d2h(self, context: int, to: int, source: int, size: int, handle: int) -> bool:
        self.enter(context)
        self.check("wp_memcpy_d2h", (source, size, "source"))
        self.check_host("wp_memcpy_d2h", to)
        stream = self.stream(handle)
        if stream.capture:
            self.machine.invalidate(CAPTURE_UNSUPPORTED)
        self.machine.submit(stream, lambda: ctypes.memmove(to, source + self.shift, size))
        self.machine.wait_for(stream, self.machine.now())  # memory that is not pinned
        self.machine.check_context()
        return True

    def wp_memset_device(self, context: int, to: int, value: int, size: int, handle: int) -> bool:
        self.enter(context)
        self.check("wp_memset_device", (to, size, "target"))
        self.machine.submit(self.stream(handle), lambda: ctypes.memset(to + self.shift, value, size))
        return True

    def wp_memtile_device(self, context: int, to: int, source: Any, size: int, count: int) -> None:
        self.enter(context)
        self.check("wp_memtile_device", (to, size * count, "target"))
        data = ctypes.string_at(ctypes.cast(source, ctypes.c_void_p), size) * count
        self.machine.submit(self.stream(CURRENT), lambda: ctypes.memmove(to + self.shift, data, len(data)))

    # Scans and sorts

    def wp_array_scan_int_device(
        self, source: int, to: int, count: int, step: int, to_step: int, length: int, inclusive: bool
    ) -> bool:
        assert step == to_step == WORD and length == 1, "the test device knows dense arrays of scalars"
        self.check("wp_array_scan", (source, count * WORD, "source"), (to, count * WORD, "target"))
        typed = self.machine.region.typed

        def work() -> None:
            sums = np.cumsum(typed(source, count, np.int32), dtype=np.int32)
            typed(to, count, np.int32)[:] = sums if inclusive else np.append(np.int32(), sums[:-1])

        self.machine.submit(self.stream(CURRENT), work)
        return True

    def wp_radix_sort_pairs_int_device(
        self, keys: int, values: int, count: int, begin: int, end: int, value_size: int = WORD
    ) -> None:
        self.check("wp_radix_sort_pairs", (keys, 2 * count * WORD, "keys"))
        self.check("wp_radix_sort_pairs", (values, 2 * count * value_size, "values"))
        typed = self.machine.region.typed

        def work() -> None:
            key, value = typed(keys, 2 * count, np.int32), typed(values, 2 * count, f"i{value_size}")
            bits = key[:count].view(np.uint32) >> np.uint32(begin) & np.uint32((1 << (end - begin)) - 1)
            order = np.argsort(bits, kind="stable")
            key[:count], value[:count] = key[:count][order], value[:count][order]
            for half in (key[count:], value[count:]):  # CUB leaves what it likes there
                half.view(np.uint32)[:] = FREED

        self.machine.submit(self.stream(CURRENT), work)

    # Modules and kernels

    def wp_cuda_compile_program(self, source: bytes, name: bytes, arch: int, *rest: Any) -> int:
        count = self.real.wp_nvrtc_supported_arch_count()
        known = (ctypes.c_int * count)()
        self.real.wp_nvrtc_supported_archs(known)
        if options.fail == "compile" or arch not in list(known):
            os.write(2, b"nvrtc: error: invalid value for --gpu-architecture (-arch)\n")
            return 5  # NVRTC_ERROR_INVALID_OPTION
        path = Path(rest[13].decode())
        path.write_text(f"{MARK} {arch}")
        return 0

    def wp_cuda_load_module(self, context: int, path: bytes) -> int:
        self.enter(context)
        file = Path(path.decode())
        text = file.read_text(errors="replace") if file.exists() else ""
        arch = int(text.removeprefix(MARK)) if text.startswith(MARK) else 0
        fits = arch <= options.arch if file.suffix == ".ptx" else arch // 10 == options.arch // 10
        if options.fail == "load" or not arch or not fits:
            raise CudaError(INVALID_IMAGE)
        if self.machine.captures and self.wp_cuda_driver_version() < 12030:
            self.machine.invalidate(CAPTURE_UNSUPPORTED)
        self.modules.add(handle := next(self.machine.handles))
        return handle

    def wp_cuda_unload_module(self, context: int, module: int) -> None:
        self.modules.discard(module)

    def wp_cuda_get_kernel(self, context: int, module: int, name: bytes) -> int:
        assert module in self.modules
        return next(self.machine.handles)

    def wp_cuda_launch_kernel(self, context: int, handle: int, *rest: Any) -> int:
        parameters, stream_handle = rest[6], rest[7]
        self.enter(context)
        self.machine.check_context()
        self.launches += 1
        fault, _, number = options.fail.partition(":")
        if number and self.launches >= int(number):
            self.machine.failed = {"launch": LAUNCH_FAILURE, "sync": ILLEGAL_ADDRESS}[fault]
            if fault == "launch":
                self.machine.check_context()
            return 0
        kernel = self.kernels[handle]
        bounds, arguments, touched = kernel.arguments(parameters)
        try:
            self.check(kernel.key, *touched)
        except CudaError:  # of a launch nobody hears before something waits for it
            self.machine.failed = ILLEGAL_ADDRESS
            return 0
        self.machine.region.show(arguments)

        def work() -> None:
            for address, size, what in touched:  # a graph may have been launched later
                wrong = self.machine.region.fault(address, size, self.device)
                if wrong:
                    report(f"{kernel.key}, {what}: {wrong}")
                    self.machine.failed = ILLEGAL_ADDRESS
                    return
            kernel.function(ctypes.byref(bounds), ctypes.byref(arguments))

        self.machine.submit(self.stream(stream_handle), work)
        return 0

    # Graphs

    def wp_cuda_graph_begin_capture(self, context: int, handle: int, external: int, mode: int) -> bool:
        self.enter(context)
        stream = self.stream(handle)
        if options.fail == "capture" or stream.handle == 0 or stream.capture:
            raise CudaError(CAPTURE_UNSUPPORTED)
        stream.capture = Capture(next(self.machine.handles))
        self.machine.captures[stream.capture.id] = stream.capture
        return True

    def wp_cuda_graph_end_capture(self, context: int, handle: int, graph: Any) -> bool:
        stream = self.stream(handle)
        capture, stream.capture = stream.capture, None
        if capture is None:
            raise CudaError(CAPTURE_IMPLICIT)
        del self.machine.captures[capture.id]
        if not self.machine.captures:
            for block in self.after_capture:
                if not block.capture:
                    self.release(block, finish=False)
            self.after_capture.clear()
        if capture.invalid:
            raise CudaError(CAPTURE_INVALIDATED)
        graph._obj.value = next(self.machine.handles)
        self.graphs[graph._obj.value] = capture.work
        return True

    def wp_cuda_graph_create_exec(self, context: int, handle: int, graph: int, made: Any) -> bool:
        if options.fail == "graph":
            raise CudaError(OUT_OF_MEMORY)
        made._obj.value = next(self.machine.handles)
        self.graphs[made._obj.value] = self.graphs[graph]
        return True

    def wp_cuda_graph_launch(self, graph: int, handle: int) -> bool:
        recorded = self.graphs[graph]

        def work() -> None:
            for each in recorded:
                each()

        self.machine.submit(self.stream(handle), work)
        return True

    def wp_cuda_graph_destroy(self, context: int, graph: int) -> bool:
        self.graphs.pop(graph, None)
        return True

    wp_cuda_graph_exec_destroy = wp_cuda_graph_destroy


ANSWERS: dict[str, Any] = {
    "wp_is_cuda_enabled": 1,
    "wp_cuda_driver_is_initialized": 1,
    "wp_cuda_device_get_name": b"Test device",
    "wp_cuda_device_get_sm_count": 132,
    "wp_cuda_device_get_max_shared_memory": 232448,
    "wp_cuda_device_is_uva": 1,
    "wp_cuda_context_is_primary": 1,
    "wp_cuda_pointer_get_memory_kind": 4,
    "wp_cuda_configure_kernel_shared_memory": True,
    "wp_cuda_stream_register": None,  # streams of other libraries are made by ``Machine.new_stream``
    "wp_cuda_stream_unregister": None,
    **dict.fromkeys(
        [
            f"wp_cuda_{name}"
            for name in (
                *("stream_get_priority", "get_kernel_static_shared_memory", "timing_begin"),
                *("is_peer_access_supported", "device_is_ipc_supported", "device_get_mempool_used_mem_high"),
                *("device_get_pci_domain_id", "device_get_pci_bus_id", "device_get_pci_device_id"),
                *("device_get_pageable_memory_access", "device_get_host_native_atomic_supported"),
                *("device_get_direct_managed_mem_access_from_host", "device_get_managed_memory_supported"),
                "device_get_concurrent_managed_access_supported",
            )
        ],
        0,
    ),
}
"""Functions whose answer is always the same."""

REAL = {"wp_cuda_toolkit_version"}
"""Functions of CUDA that need no GPU."""
