"""The CUDA code of every kernel, without a GPU: it compiles, and needs few registers."""

from __future__ import annotations

import re
import sys

import pytest

from tests.cuda_report import (
    ARCHITECTURES,
    Usage,
    assemble,
    assembler,
    gpu_modules,
    ptx_of,
    usages,
    usages_of,
)
from tests.kernels import racing
from tests.kernels.modules import all_kernels
from warpsplat.kernels.tile import quad

pytestmark = pytest.mark.skipif(sys.platform == "darwin", reason="Warp for macOS has no CUDA compiler")

MODULES = gpu_modules()

MOST_REGISTERS = 128
"""Of a thread: a multiprocessor then runs two blocks of 256 threads."""

EXCEPTIONS = dict.fromkeys(("chain_backward", "ramp_backward", "solve", "walk_strokes"), 168)
"""Kernels that only gradients, styled strokes and drawings need, with the registers that they may take."""

ATOMIC_FLOATS = re.compile(r"\b(atom|red)\.\S*\.b?f(16|32|64)")


def beyond_budget(used: dict[str, Usage]) -> list[str]:
    """Return the kernels that take too many registers, or keep some in memory."""
    return [
        f"{name}: {usage.registers} registers, {usage.spilled} bytes spilled"
        for name, usage in used.items()
        if usage.spilled or usage.registers > EXCEPTIONS.get(name, MOST_REGISTERS)
    ]


@pytest.mark.parametrize("name", MODULES)
def test_kernels_compile_for_cuda_and_need_few_registers(name: str) -> None:
    text = ptx_of(MODULES[name]).read_text()
    keys = {kernel.key for kernel in all_kernels(quad) if kernel.module.name == name}
    for key in keys:
        assert f".entry {key}_" in text
    assert not ATOMIC_FLOATS.search(text), "results would depend on the order of threads"
    if not assembler():
        pytest.skip("compiled, but there is no ptxas to count registers")
    for architecture, used in usages_of([MODULES[name]]).items():
        assert used.keys() >= keys
        assert not beyond_budget(used), f"sm_{architecture}"


@pytest.mark.skipif(not assembler(), reason="no ptxas")
def test_a_kernel_that_spills_is_found() -> None:
    (module,) = (module for name, module in MODULES.items() if name.startswith("composite_backward"))
    report = assemble(ptx_of(module), ARCHITECTURES[-1], "--maxrregcount=32")
    (problem,) = beyond_budget(usages(report))
    assert "composite_backward: 32 registers" in problem


def test_atomic_sums_of_floats_are_found() -> None:
    assert ATOMIC_FLOATS.search(ptx_of(racing.adds_up.module).read_text())
