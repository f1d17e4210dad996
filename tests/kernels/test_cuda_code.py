"""The CUDA code of every kernel, compiled without a GPU: Warp brings the compiler along."""

from __future__ import annotations

import os
import re
import sys
from pathlib import Path

import pytest
import warp as wp

from tests.kernels import racing
from tests.kernels.modules import all_kernels
from warpsplat.kernels.tile import quad

ARCHITECTURE = 75

ATOMIC_FLOATS = re.compile(r"\b(atom|red)\.\S*\.b?f(16|32|64)")

MODULES = {kernel.module.name: kernel.module for kernel in all_kernels(quad)}


def cuda_code(module: wp.Module, scratch: Path) -> str:
    """PTX of a module, compiled where the kernel cache has none of the same kernels, options and Warp."""
    wp.init()  # which chooses the cache
    assert wp.config.kernel_cache_dir
    digest = module.get_module_hash().hex()
    kept = Path(wp.config.kernel_cache_dir) / "warpsplat-tests-cuda" / f"{digest}.sm{ARCHITECTURE}.ptx"
    if not kept.exists():
        wp.compile_aot_module(module, arch=ARCHITECTURE, module_dir=scratch, use_ptx=True)
        (made,) = scratch.glob("*.ptx")
        kept.parent.mkdir(exist_ok=True)
        part = kept.with_suffix(f".{os.getpid()}")
        part.write_text(made.read_text())
        part.replace(kept)  # whole or not at all
    return kept.read_text()


@pytest.mark.skipif(sys.platform == "darwin", reason="Warp for macOS has no CUDA compiler")
@pytest.mark.parametrize("name", MODULES)
def test_kernels_compile_for_cuda(name: str, tmp_path: Path) -> None:
    text = cuda_code(MODULES[name], tmp_path)
    for kernel in all_kernels(quad):
        if kernel.module.name == name:
            assert f".entry {kernel.key}_" in text
    assert not ATOMIC_FLOATS.search(text), "results would depend on the order of threads"


@pytest.mark.skipif(sys.platform == "darwin", reason="Warp for macOS has no CUDA compiler")
def test_atomic_sums_of_floats_are_found(tmp_path: Path) -> None:
    assert ATOMIC_FLOATS.search(cuda_code(racing.adds_up.module, tmp_path))
