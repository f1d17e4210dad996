"""The CUDA code of every kernel, compiled without a GPU: Warp brings the compiler along."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest
import warp as wp

from warpsplat.kernels import adam, composite, fill, flatten, gaussian, loss, sample, splat, stroke
from warpsplat.kernels import bin as binning

MODULES = (adam, binning, composite, fill, flatten, gaussian, loss, sample, splat, stroke)


@pytest.mark.skipif(sys.platform == "darwin", reason="Warp for macOS has no CUDA compiler")
@pytest.mark.parametrize("module", MODULES, ids=lambda m: m.__name__.rsplit(".", 1)[-1])
def test_kernels_compile_for_cuda(module: object, tmp_path: Path) -> None:
    wp.compile_aot_module(module, arch=75, module_dir=tmp_path, use_ptx=True)
    (code,) = tmp_path.glob("*.ptx")
    assert code.read_text().count(".entry") > 0
