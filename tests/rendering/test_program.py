"""Launches bound by name; graphs."""

from __future__ import annotations

import gc
import weakref
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
import warp as wp

from tests import fake_cuda
from warpsplat.kernels import constants
from warpsplat.rendering.backend import view
from warpsplat.rendering.program import Program, bind

wp.set_module_options(constants.MODULE_OPTIONS)  # others would need their own precompiled headers


@wp.kernel
def affine(
    # In:
    offset: wp.int32,
    slope: wp.array[wp.float32],  # [n]
    shift: wp.array[wp.float32],  # [n], of the same type: a swap compiles
    factor: wp.float32,
    # Out:
    result: wp.array[wp.float32],  # [n]
) -> None:
    i = offset + wp.tid()
    result[i] = factor * slope[i] + shift[i]  # type: ignore[index]


@dataclass
class Buffers:
    shift: wp.array
    result: wp.array
    slope: wp.array


def floats(*values: float, device: str = "cpu") -> wp.array:
    return wp.array(values, dtype=wp.float32, device=device)


@pytest.mark.parametrize("threads", [1, 3])
def test_arguments_go_where_their_names_are(device: str, threads: int) -> None:
    """Whatever the order of fields, of sources and of keywords."""
    slope, shift, result = (floats(*x, device=device) for x in ([1, 2, 3], [10, 20, 30], [0, 0, 0]))
    for sources, values in (
        ((Buffers(shift, result, slope),), {"factor": 2.0}),
        (({"shift": shift}, {"result": result, "slope": slope}), {"factor": 2.0}),
        (({"factor": 2.0, "unused": 7},), {"result": result, "shift": shift, "slope": slope}),
    ):
        result.zero_()
        program = Program(wp.get_device(device), threads)
        program.launch(affine, 3, *sources, split=True, **values)
        program.run()
        np.testing.assert_array_equal(result.numpy(), [12, 24, 36])


@pytest.mark.parametrize("is_view", [False, True])
def test_arrays_live_as_long_as_the_program(device: str, is_view: bool) -> None:
    """Recorded launches hold their addresses only."""
    program, result = Program(wp.get_device(device)), floats(0, 0, 0, device=device)
    shift, slope = (floats(*x, device=device) for x in ([10, 20, 30], [1, 2, 3]))
    alive = weakref.ref(slope)
    given = view(slope, wp.float32, (3,)) if is_view else slope
    program.launch(affine, 3, shift=shift, slope=given, factor=2.0, result=result)
    del shift, slope, given
    assert alive()
    program.run()
    np.testing.assert_array_equal(result.numpy(), [12, 24, 36])


@pytest.mark.parametrize("threads", [1, 2])
def test_an_array_is_bound_to_other_memory(device: str, threads: int) -> None:
    own = wp.get_device(device)
    program = Program(own, threads)
    shift, slope = (floats(*x, device=device) for x in ([10, 20, 30], [1, 2, 3]))
    results = [wp.zeros(3, dtype=wp.float32, device=own) for _ in range(2)]
    placeholder = view(slope, wp.float32, (3,))
    program.launch(affine, 3, shift=shift, slope=slope, factor=2.0, result=placeholder, split=True)
    for result in (*results, results[0]):
        result.zero_()
        program.rebind("result", result.ptr)
        program.run()
        np.testing.assert_array_equal(result.numpy(), [12, 24, 36])
    np.testing.assert_array_equal(slope.numpy(), [1, 2, 3])


@pytest.mark.parametrize("runs", [True, False])
def test_arrays_are_freed_with_their_program(*, device: str, runs: bool) -> None:
    """At once: memory of a GPU that waits for the garbage collection is missing in the next run."""
    arrays = [floats(1, 2, 3, device=device) for _ in range(3)]
    program = Program(wp.get_device(device))
    program.launch(affine, 3, Buffers(*arrays), factor=2.0)
    if runs:
        program.run()
    left = [weakref.ref(each) for each in arrays]
    gc.disable()
    try:
        del arrays, program
        assert not any(each() for each in left)
    finally:
        gc.enable()


COMPLETE: dict[str, Any] = {"slope": 1, "shift": 2, "factor": 3, "result": 4}


def test_names_that_are_missing_misspelt_or_ambiguous_are_refused() -> None:
    for name in COMPLETE:
        rest = {other: value for other, value in COMPLETE.items() if other != name}
        for sources, values in (([rest], {}), ([], rest)):
            with pytest.raises(TypeError, match=f"affine.*: parameter {name} is missing"):
                bind(affine, sources, values)
    for wrong in ("slpoe", "offset"):
        with pytest.raises(TypeError, match=f"no parameter {wrong}"):
            bind(affine, [COMPLETE], {wrong: 1})
    with pytest.raises(TypeError, match="parameter shift is ambiguous"):
        bind(affine, [COMPLETE, Buffers(1, 2, 3)], {"slope": 1, "result": 1})
    assert bind(affine, [COMPLETE, {"shift": 8}], {"shift": 9}) == [1, 9, 3, 4]


GRAPHS = """
import logging, warp as wp
from tests import fake_cuda
from warpsplat.kernels import lanes
from warpsplat.rendering.device import start_warp
from warpsplat.rendering.program import Program, Replay

start_warp()
logging.basicConfig(level=logging.INFO, format="%(message)s")
device = wp.get_device("cuda:0")
by_lane = wp.array([[1, 2], [3, 4], [5, 6]], dtype=wp.float32, device=device)
for fault in ("", "capture", "graph", "graph", ""):
    fake_cuda.options.fail = fault
    sums = wp.zeros(3, dtype=wp.float32, device=device)
    program = Program(device, threads=3)
    program.launch(lanes.lane_sums, 3, by_lane=by_lane, sums=sums, split=True)
    replay = Replay(device, [program])
    for _ in range(2):
        sums.zero_()
        replay()
    print(fault or "none", *sums.numpy().tolist(), replay.graph is not None, device.is_capturing)
"""
"""Run a program as a graph while graphs fail."""


def test_a_refused_graph_falls_back_to_launches() -> None:
    """Each kernel is launched by itself then, whatever number of CPU threads was asked for, and this is said
    once for each cause."""
    done = fake_cuda.run("-c", GRAPHS)
    assert done.returncode == 0, done.stderr
    wanted = [
        f"{fault} 3.0 7.0 11.0 {fault == 'none'} False"
        for fault in ("none", "capture", "graph", "graph", "none")
    ]
    assert done.stdout.splitlines() == wanted
    told = [line for line in done.stderr.splitlines() if "without a graph" in line]
    assert len(told) == 2
    assert "not permitted" in told[0]
    assert "out of memory" in told[1]
    others = [line for line in done.stderr.splitlines() if line and "compiling kernels" not in line]
    assert others == told, "what Warp says itself is hidden"
