"""Make the golden files as other machines would, and compare: ``python -m tests.machines``.

Without options: with each choice of code that NumPy, OpenBLAS, OpenCV and the C library can be told to
make, and with several numbers of threads. With ``--emulate``: on other processors, by QEMU's user mode
(``qemu-user`` 10 or newer: 7.2 gathers wrong elements of strided arrays with AVX2), which takes minutes for
the first case, as the kernels are compiled there too. An aarch64 needs its own Python and packages, which
``--prepare FOLDER`` fetches (Debian, pip) and ``--aarch64 FOLDER`` uses.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, field
from importlib import metadata
from pathlib import Path

from tests import ROOT
from tests.golden.__main__ import EXPECTED
from tests.golden.cases import CASES

EMULATED_CASES = ("photo closed", "photo open", "photo splat", "drawing", "line", "pixel")
"""Cases made under emulation where none are named; all take hours."""

PACKAGES = """
python3.11-minimal libpython3.11-minimal libpython3.11-stdlib libc6 libgcc-s1 libstdc++6 zlib1g libexpat1
libffi8 libssl3 libbz2-1.0 liblzma5 libsqlite3-0 libuuid1 libncursesw6 libtinfo6 libreadline8 libdb5.3 libnsl2
libtirpc3 libcrypt1 media-types
"""
"""Debian's packages of a Python for aarch64."""

WHEELS = """
warp-lang numpy opencv-contrib-python-headless pillow click pyyaml resvg-py jinja2 markupsafe
"""
"""Python packages that warpsplat needs there."""


@dataclass(frozen=True)
class Machine:
    """A way to run Python."""

    environment: dict[str, str] = field(default_factory=dict)
    python: Sequence[str] = (sys.executable,)
    threads: int = 1
    kernels: str = "kernels"
    """Name of a folder for its compiled kernels; that of the tests by default."""
    left_out: tuple[str, ...] = ()
    """Cases that it cannot make."""


CONFIGURED = {
    "unchanged": Machine(),
    "2 threads": Machine(threads=2),
    "5 threads": Machine(threads=5),
    "NumPy without AVX-512": Machine({"NPY_DISABLE_CPU_FEATURES": "X86_V4 AVX512_ICL"}),
    "NumPy without AVX2": Machine({"NPY_DISABLE_CPU_FEATURES": "X86_V3 X86_V4 AVX512_ICL"}),
    "OpenBLAS for Nehalem": Machine({"OPENBLAS_CORETYPE": "Nehalem"}),
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
    """Return the machine that ``prepare`` made in ``folder``."""
    python = folder / "root" / "usr" / "bin" / "python3.11"
    return Machine(
        {"PYTHONPATH": str(folder / "site")},
        ("qemu-aarch64", "-L", str(folder / "root"), str(python)),
        kernels="aarch64-kernels",
        left_out=("refined",),  # starts Python for an SVG of unknown origin, which is not emulated
    )


def prepare(folder: Path) -> None:
    """Fetch a Python for aarch64 and the packages that warpsplat needs, in the versions installed here."""
    debs = folder / "debs"
    debs.mkdir(parents=True, exist_ok=True)
    subprocess.run(["dpkg", "--add-architecture", "arm64"], check=True)
    subprocess.run(["apt-get", "-qq", "update"], check=True)
    names = [f"{name}:arm64" for name in PACKAGES.split()]
    subprocess.run(["apt-get", "-qq", "download", *names], check=True, cwd=debs)
    for deb in sorted(debs.glob("*.deb")):
        subprocess.run(["dpkg", "-x", str(deb), str(folder / "root")], check=True)
    pip = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--only-binary=:all:"]
    target = ["--python-version=3.11", "--platform=manylinux2014_aarch64", f"--target={folder / 'site'}"]
    platforms = [f"--platform=manylinux_2_{minor}_aarch64" for minor in (36, 35, 34, 31, 28, 27, 17)]
    wanted = [f"{name}=={metadata.version(name)}" for name in WHEELS.split()]
    subprocess.run([*pip, *platforms, *target, *wanted], check=True)


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
    parser.add_argument("--prepare", type=Path, metavar="FOLDER", help="fetch a Python for aarch64, and stop")
    parser.add_argument("--only", metavar="NAME", help="one machine")
    given = parser.parse_args()
    if given.prepare:
        prepare(given.prepare)
        return 0
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
