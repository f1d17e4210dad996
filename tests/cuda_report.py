"""Print what each kernel takes of a GPU, without one: ``python -m tests.cuda_report [NAME ...]``.

Warp brings the compiler from kernels to PTX along; the assembler, ptxas, comes with the package
nvidia-cuda-nvcc-cu12, which is among the dependencies of the tests.
"""

from __future__ import annotations

import argparse
import functools
import importlib.metadata
import os
import re
import subprocess
import tempfile
from collections.abc import Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import warp as wp

from tests.kernels.modules import all_kernels
from warpsplat.kernels.tile import quad

ARCHITECTURES = (75, 80, 90)
"""Compute capabilities: of the oldest GPUs that Warp compiles for, an A100 and an H100."""

PTX_VERSION = "8.0"
"""Version that PTX is said to have: Warp's compiler is newer than the assembler, but uses nothing newer."""

REGISTERS = 65536
"""Of a multiprocessor."""
MOST_WARPS = {75: 32, 80: 64, 90: 64}
MOST_SHARED = {75: 64 << 10, 80: 164 << 10, 90: 228 << 10}
"""Of a multiprocessor, by architecture."""
UNIT = 256
"""Registers that a warp is given at a time."""


@dataclass(frozen=True)
class Usage:
    """What a kernel takes."""

    registers: int
    """Of a thread."""
    stack: int
    spilled: int
    """Stores of registers that did not fit [bytes]."""
    shared: int
    """Memory of a block [bytes]."""

    def occupancy(self, architecture: int, block: int) -> float:
        """Return the part of a multiprocessor's warps that run at the same time, with blocks of ``block``
        threads.
        """
        warps = -(-block // 32)
        each = -(-32 * max(self.registers, 1) // UNIT) * UNIT
        blocks = min(MOST_WARPS[architecture] // warps, REGISTERS // each // warps)
        if self.shared:
            blocks = min(blocks, MOST_SHARED[architecture] // self.shared)
        return blocks * warps / MOST_WARPS[architecture]


def gpu_modules() -> dict[str, wp.Module]:
    """Return the modules of the kernels that a GPU runs, by name."""
    return {kernel.module.name: kernel.module for kernel in all_kernels(quad)}


def ptx_of(module: wp.Module) -> Path:
    """Return the PTX of a module for the first architecture, which the others can run. It is kept with Warp's
    kernels and compiled again when these, their options or Warp change.
    """
    wp.init()  # which chooses the cache
    assert wp.config.kernel_cache_dir
    digest = module.get_module_hash().hex()
    kept = Path(wp.config.kernel_cache_dir) / "warpsplat-tests-ptx" / f"{digest}.sm{ARCHITECTURES[0]}.ptx"
    if not kept.exists():
        with tempfile.TemporaryDirectory() as scratch:
            wp.compile_aot_module(module, arch=ARCHITECTURES[0], module_dir=scratch, use_ptx=True)
            (made,) = Path(scratch).glob("*.ptx")
            text = re.sub(r"(?m)^\.version .*$", f".version {PTX_VERSION}", made.read_text().rstrip("\0"))
        write_whole(kept, text)
    return kept


def write_whole(path: Path, text: str) -> None:
    """Write a file whole or not at all."""
    path.parent.mkdir(exist_ok=True)
    part = path.with_suffix(f".{os.getpid()}")
    part.write_text(text)
    part.replace(path)


@functools.cache
def assembler() -> tuple[str, str] | None:
    """Return the path of ptxas and its version; None where the package is not installed."""
    try:
        package = importlib.metadata.distribution("nvidia-cuda-nvcc-cu12")
    except importlib.metadata.PackageNotFoundError:
        return None
    return str(package.locate_file("nvidia/cuda_nvcc/bin/ptxas")), package.version


def assemble(ptx: Path, architecture: int, *options: str) -> str:
    """Return what ptxas reports of a module."""
    found = assembler()
    assert found, "no ptxas"
    command = [found[0], "-v", f"-arch=sm_{architecture}", *options, str(ptx), "-o", os.devnull]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stderr


def usages(report: str) -> dict[str, Usage]:
    """Read a report of ptxas: the usage of each kernel, by its name in the source."""
    found = {}
    for entry in re.split(r"Compiling entry function ", report)[1:]:
        name = re.match(r"'(\w+?)_[0-9a-f]{8}_cuda_kernel_forward'", entry)
        numbers = (
            re.search(pattern, entry)
            for pattern in (
                r"Used (\d+) reg",
                r"(\d+) bytes stack",
                r"(\d+) bytes spill st",
                r"(\d+) bytes smem",
            )
        )
        assert name, entry
        found[name[1]] = Usage(*(int(number[1]) if number else 0 for number in numbers))
    return found


def usages_of(modules: Iterable[wp.Module]) -> dict[int, dict[str, Usage]]:
    """Return the usages of the kernels of modules by architecture. Reports of ptxas are kept."""

    def report(work: tuple[Path, int]) -> str:
        ptx, architecture = work
        kept = ptx.with_suffix(f".{version}.sm{architecture}.txt")
        if not kept.exists():
            write_whole(kept, assemble(ptx, architecture))
        return kept.read_text()

    version = (assembler() or ("", ""))[1]
    works = [(ptx, architecture) for ptx in map(ptx_of, modules) for architecture in ARCHITECTURES]
    found: dict[int, dict[str, Usage]] = {architecture: {} for architecture in ARCHITECTURES}
    with ThreadPoolExecutor() as pool:
        for (_, architecture), text in zip(works, pool.map(report, works), strict=True):
            found[architecture] |= usages(text)
    return found


def table(found: dict[int, dict[str, Usage]], blocks: dict[str, int]) -> Iterator[str]:
    """Yield the lines of the table, the kernel with the most registers first."""
    yield f"{'':28}" + "".join(f"{f'sm_{a}':<34}" for a in found)
    yield f"{'kernel':28}" + f"{'reg stack spill shared occupancy':<34}" * len(found)
    last = found[ARCHITECTURES[-1]]
    for name in sorted(last, key=lambda name: (-last[name].registers, name)):
        cells = []
        for architecture, kernels in found.items():
            u = kernels[name]
            part = u.occupancy(architecture, blocks[name])
            cells.append(f"{u.registers:3} {u.stack:5} {u.spilled:5} {u.shared:6} {part:8.0%} ")
        yield f"{name:28}" + "".join(f"{cell:<34}" for cell in cells).rstrip()


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m tests.cuda_report", description=__doc__)
    parser.add_argument("names", nargs="*", help="kernels to show; default: all")
    names = parser.parse_args().names
    wp.config.log_level = wp.LOG_ERROR
    if not assembler():
        parser.error("there is no ptxas: pip install nvidia-cuda-nvcc-cu12")
    kernels = {kernel.key: kernel for kernel in all_kernels(quad) if not names or kernel.key in names}
    unknown = sorted(set(names) - set(kernels))
    if unknown:
        parser.error(f"no such kernel: {', '.join(unknown)}")
    modules = {kernel.module.name: kernel.module for kernel in kernels.values()}
    found = usages_of(modules.values())
    chosen = {a: {name: u for name, u in each.items() if name in kernels} for a, each in found.items()}
    blocks = {name: int(kernel.module.options["block_dim"]) for name, kernel in kernels.items()}
    print("\n".join(table(chosen, blocks)))


if __name__ == "__main__":
    main()
