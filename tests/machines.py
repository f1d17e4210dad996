"""Make the golden files as other machines would, and compare: ``python -m tests.machines``.

Without options: with each choice of code that NumPy, OpenBLAS, OpenCV and the C library can be told to
make, and with several numbers of threads. With ``--emulate``: on other processors, by QEMU's user mode
(``qemu-user`` 10 or newer: 7.2 gathers wrong elements of strided arrays with AVX2), which takes minutes for
the first case, as the kernels are compiled there too. ``--aarch64 FOLDER``: on an aarch64 too, whose Python
(Debian's packages, unpacked by ``dpkg -x``) is in FOLDER/root, and the packages that warpsplat needs (by
``pip install --platform manylinux2014_aarch64 --target``) in FOLDER/site.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from tests import ROOT
from tests.golden.__main__ import EXPECTED
from tests.golden.cases import CASES
from tests.golden.processors import SETTINGS

EMULATED_CASES = ("photo closed", "photo open", "photo splat", "drawing", "line", "pixel")
"""Cases made under emulation where none are named; all take hours."""


class Machine(NamedTuple):
    """A way to run Python."""

    environment: Mapping[str, str] = {}
    python: Sequence[str] = (sys.executable,)
    threads: int = 1
    kernels: str = "kernels"
    """Name of a folder for its compiled kernels; that of the tests by default."""
    left_out: tuple[str, ...] = ()
    """Cases that it cannot make."""


CONFIGURED = {
    "2 threads": Machine(threads=2),
    "5 threads": Machine(threads=5),
    **{name: Machine(environment) for name, environment in SETTINGS.items()},
    "OpenBLAS for Haswell": Machine({"OPENBLAS_CORETYPE": "Haswell"}),
    "OpenBLAS for Skylake-X": Machine({"OPENBLAS_CORETYPE": "SkylakeX"}),
    "OpenCV with SSE3": Machine(
        {"OPENCV_CPU_DISABLE": "AVX512-SKX,AVX2,FP16,AVX,SSE4.2,SSE4.1", "OPENCV_IPP": "disabled"}
    ),
    "C library without FMA": Machine({"GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX512F,-AVX2,-FMA,-FMA4"}),
}
"""This machine, told to choose as others do."""

EMULATED = {
    name: Machine(python=("qemu-x86_64", "-cpu", model, sys.executable), kernels=f"{model}-kernels")
    for name, model in {"Ivy Bridge": "IvyBridge", "Haswell": "Haswell", "all features": "max"}.items()
}
"""Emulated x86-64 processors: with AVX alone, with AVX2 and FMA, and more."""


def aarch64(folder: Path) -> Machine:
    """Return the machine whose Python is in ``folder``."""
    root = folder / "root"
    return Machine(
        {"PYTHONPATH": str(folder / "site")},
        ("qemu-aarch64", "-L", str(root), str(root / "usr" / "bin" / "python3.11")),
        kernels="aarch64-kernels",
        left_out=("refined",),  # starts Python for an SVG of unknown origin, which is not emulated
    )


def made_on(machine: Machine, cases: Sequence[str]) -> dict[str, str]:
    """Return digests by case, as far as the machine got; print the last line of its error."""
    environment = {**os.environ, **machine.environment}
    environment["PYTHONPATH"] = os.pathsep.join([str(ROOT), machine.environment.get("PYTHONPATH", "")])
    environment["WARP_CACHE_PATH"] = str(Path(tempfile.gettempdir()) / f"warpsplat-test-{machine.kernels}")
    command = [*machine.python, "-m", "tests.golden", "--threads", str(machine.threads), *cases]
    done = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, check=False)
    if done.returncode:
        print(f"  exit code {done.returncode}: {(done.stderr.strip().splitlines() or [''])[-1]}")
    return {name: digest for line in done.stdout.splitlines() for name, digest in json.loads(line).items()}


def main() -> int:
    """Compare and print; return 1 if a file differs."""
    parser = argparse.ArgumentParser(prog="python -m tests.machines", description=__doc__)
    parser.add_argument("cases", nargs="*", help="names of golden cases; default: all, or some if emulated")
    parser.add_argument("--emulate", action="store_true", help="other processors, by QEMU")
    parser.add_argument("--aarch64", type=Path, metavar="FOLDER", help="where its Python is")
    parser.add_argument("--only", metavar="NAME", help="one machine")
    given = parser.parse_args()
    machines = EMULATED if given.emulate or given.aarch64 else CONFIGURED
    if given.aarch64:
        machines = {**machines, "aarch64": aarch64(given.aarch64)}
    cases = given.cases or (EMULATED_CASES if machines is not CONFIGURED else tuple(CASES))
    expected = json.loads(EXPECTED.read_text(encoding="utf-8"))
    wrong = 0
    for name, machine in machines.items():
        if given.only not in {None, name}:
            continue
        wanted = [case for case in cases if case not in machine.left_out]
        made = made_on(machine, wanted)
        others = [case for case in wanted if made.get(case) != expected[case]]
        wrong += len(others)
        print(f"{name}: {len(wanted) - len(others)} of {len(wanted)} files are the same", flush=True)
        for case in others:
            print(f"  {case}: {'another file' if case in made else 'not made'}")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
