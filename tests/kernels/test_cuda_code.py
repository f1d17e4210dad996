"""The CUDA code of every kernel, compiled without a GPU: Warp brings the compiler along."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from types import ModuleType

import pytest
import warp as wp

from tests.kernels.modules import kernel_modules, kernels_of

ARCHITECTURE = 75


def cuda_code(module: ModuleType, scratch: Path) -> str:
    """PTX of a module, compiled where the kernel cache has none of the same kernels, options and Warp."""
    wp.init()  # which chooses the cache
    assert wp.config.kernel_cache_dir
    digest = wp.get_module(module.__name__).get_module_hash().hex()
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
@pytest.mark.parametrize("module", kernel_modules(), ids=lambda m: m.__name__.split(".kernels.")[1])
def test_kernels_compile_for_cuda(module: ModuleType, tmp_path: Path) -> None:
    text = cuda_code(module, tmp_path)
    for kernel in kernels_of(module):
        assert f".entry {kernel.key}_" in text
