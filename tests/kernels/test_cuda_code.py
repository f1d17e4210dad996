"""The CUDA code of every kernel, compiled without a GPU: Warp brings the compiler along."""

from __future__ import annotations

import sys
from pathlib import Path
from types import ModuleType

import pytest
import warp as wp

from tests.kernels.modules import kernel_modules, kernels_of


@pytest.mark.skipif(sys.platform == "darwin", reason="Warp for macOS has no CUDA compiler")
@pytest.mark.parametrize("module", kernel_modules(), ids=lambda m: m.__name__.split(".kernels.")[1])
def test_kernels_compile_for_cuda(module: ModuleType, tmp_path: Path) -> None:
    wp.compile_aot_module(module, arch=75, module_dir=tmp_path, use_ptx=True)
    (code,) = tmp_path.glob("*.ptx")
    text = code.read_text()
    for kernel in kernels_of(module):
        assert f".entry {kernel.key}_" in text
