"""Programs that break a rule of CUDA, each beside one that does not: ``python -m tests.fake_cuda.controls``.

Prints, as JSON, what the test device found of each.
"""

from __future__ import annotations

import ctypes
import json
import sys
from collections.abc import Callable
from functools import partial

import numpy as np
import warp as wp

from tests.fake_cuda import install, options, rules
from tests.fake_cuda.driver import CONTEXT

DEVICE = "cuda:0"
COUNT = 10


@wp.kernel
def double(values: wp.array[wp.float32], result: wp.array[wp.float32]) -> None:
    i = wp.tid()
    result[i] = 2.0 * values[i]  # type: ignore[index]


def launch(values: wp.array, result: wp.array, stream: wp.Stream | None = None) -> None:
    """Launch the kernel."""
    wp.launch(double, COUNT, inputs=[values, result], device=DEVICE, stream=stream)


def ones() -> wp.array:
    """Return an array on the device."""
    return wp.array(np.ones(COUNT, np.float32), device=DEVICE)


def of_the_host(right: bool) -> None:
    host = wp.array(np.ones(COUNT, np.float32), device="cpu")
    wrong = wp.array(ptr=host.ptr, shape=COUNT, dtype=wp.float32, device=DEVICE)
    launch(ones() if right else wrong, ones())


def beyond_its_block(right: bool) -> None:
    values = ones()
    launch(wp.array(ptr=values.ptr + (0 if right else 8), shape=COUNT, dtype=float, device=DEVICE), ones())


def freed(right: bool) -> None:
    values = ones()
    same = wp.array(ptr=values.ptr, shape=COUNT, dtype=float, device=DEVICE)
    if not right:
        del values
    launch(same, ones())


def freed_twice(right: bool) -> None:
    address = install.driver().wp_alloc_device_async(CONTEXT, 8, 0, None)
    for _ in range(1 if right else 2):
        install.driver().wp_free_device_async(CONTEXT, address)


def freed_before_its_graph_runs(right: bool) -> None:
    values, result = ones(), ones()
    with wp.ScopedCapture(DEVICE) as captured:
        launch(values, result)
    if not right:
        del values
    wp.capture_launch(captured.graph)
    wp.synchronize_device(DEVICE)


def waits(right: bool) -> None:
    """Without a wait the second stream doubles what the first has not written yet."""
    first, second = wp.Stream(DEVICE), wp.Stream(DEVICE)
    values, between, result = ones(), wp.empty(COUNT, dtype=float, device=DEVICE), ones()
    wp.synchronize_device(DEVICE)
    launch(values, between, stream=first)
    if right:
        second.wait_event(first.record_event())
    launch(between, result, stream=second)
    wp.synchronize_stream(second)
    if not (result.numpy() == 4).all():
        rules.report("the second stream came too early")


def freed_while_another_stream_works(right: bool) -> None:
    """Warp frees on the legacy stream, for which streams that do not block do not wait, nor it for them."""
    machine = install.driver().machine
    side = machine.new_stream(0, blocking=False)
    stream = wp.Stream(DEVICE, cuda_stream=side.handle)
    values, result = ones(), ones()
    wp.synchronize_device(DEVICE)
    launch(values, result, stream=stream)
    if right:
        wp.synchronize_stream(stream)
    del values
    wp.synchronize_stream(stream)
    del machine.streams[side.handle], stream
    machine.failed = 0


def initialised(right: bool) -> None:
    result = ones()
    launch(ones() if right else wp.empty(COUNT, dtype=float, device=DEVICE), result)
    if not np.isfinite(result.numpy()).all():
        rules.report("memory was read that nobody wrote")


def allocation_in_a_capture_without_a_pool(right: bool) -> None:
    wp.set_mempool_enabled(DEVICE, right)
    try:
        in_a_capture(lambda _: wp.empty(COUNT, dtype=float, device=DEVICE), right=False)
    finally:
        wp.set_mempool_enabled(DEVICE, True)


def in_a_capture(act: Callable[[wp.array], object], right: bool) -> None:
    """Do in a capture what is refused there."""
    values = ones()
    with wp.ScopedCapture(DEVICE):
        launch(values, values)
        if not right:
            act(values)


REFUSED_IN_A_CAPTURE: dict[str, Callable[[wp.array], object]] = {
    "a read": lambda values: values.numpy(),
    "a wait": lambda values: wp.synchronize_device(DEVICE),
    "a copy from the host": lambda values: values.assign(np.ones(COUNT, np.float32)),
    "the legacy stream": lambda values: launch(values, values, wp.get_device(DEVICE).null_stream),
}


def memory_for_all(right: bool) -> None:
    wp.empty(options.memory // 4 // (2 if right else 1) + 1, dtype=float, device=DEVICE)


def host_reads_device_memory() -> None:
    """Ends the process."""
    ctypes.string_at(ones().ptr, 4)


CONTROLS: dict[str, Callable[[bool], None]] = {
    control.__name__: control
    for control in (
        of_the_host,
        beyond_its_block,
        freed,
        freed_twice,
        freed_before_its_graph_runs,
        waits,
        freed_while_another_stream_works,
        initialised,
        allocation_in_a_capture_without_a_pool,
        memory_for_all,
    )
}
CONTROLS |= {f"{name} in a capture": partial(in_a_capture, act) for name, act in REFUSED_IN_A_CAPTURE.items()}


def main() -> None:
    """Run all; with an argument, the one that ends the process."""
    wp.config.log_level = wp.LOG_ERROR
    if len(sys.argv) > 1:
        host_reads_device_memory()
    found = {}
    for name, control in CONTROLS.items():
        for right in (True, False):
            del rules.broken[:]
            try:
                control(right)
            except RuntimeError as error:
                rules.report(str(error))
            install.finish()
            install.driver().machine.failed = 0
            found[f"{name}, {'right' if right else 'wrong'}"] = rules.broken[:]
    print(json.dumps(found))


if __name__ == "__main__":
    main()
