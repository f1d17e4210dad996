"""Make the golden files as other machines would, and compare: ``python -m tests.machines``.

Without options: under each choice of code that NumPy, OpenBLAS, OpenCV and the C library can be told to
make, and with several numbers of threads. With ``--emulate``: on other processors, by QEMU's user mode
(``qemu-user`` of Debian's trixie), which takes minutes for the first case, as the kernels are compiled
there too. An aarch64 needs its own Python and packages, which ``--prepare FOLDER`` fetches (Debian, pip)
and ``--aarch64 FOLDER`` uses.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, field
from importlib import metadata
from pathlib import Path

from tests.golden.cases import CASES

ROOT = Path(__file__).parents[1]
EXPECTED = ROOT / "tests" / "golden" / "digests.json"

EMULATED_CASES = ("photo closed", "photo open", "photo splat", "drawing", "line", "pixel")
"""What is made under emulation where no cases are named; all take hours."""

PACKAGES = (
    *(
        "python3.11-minimal",
        "libpython3.11-minimal",
        "libpython3.11-stdlib",
        "libc6",
        "libgcc-s1",
        "libstdc++6",
    ),
    *("zlib1g", "libexpat1", "libffi8", "libssl3", "libbz2-1.0", "liblzma5", "libsqlite3-0", "libuuid1"),
    *(
        "libncursesw6",
        "libtinfo6",
        "libreadline8",
        "libdb5.3",
        "libnsl2",
        "libtirpc3",
        "libcrypt1",
        "media-types",
    ),
)
"""Debian's packages of a Python for aarch64."""

WHEELS = (
    *(
        "warp-lang",
        "numpy",
        "opencv-contrib-python-headless",
        "pillow",
        "click",
        "pyyaml",
        "resvg-py",
        "jinja2",
    ),
    "markupsafe",
)
"""What warpsplat needs there."""


@dataclass(frozen=True)
class Machine:
    """A way to run Python."""

    environment: dict[str, str] = field(default_factory=dict)
    python: Sequence[str] = (sys.executable,)
    threads: int = 1
    kernels: str = ""
    """Name of a folder for its kernels; others share that of the tests."""
    left_out: frozenset[str] = frozenset()
    """Cases that it cannot make."""


TOLD = {
    "as it is": Machine(),
    "2 threads": Machine(threads=2),
    "5 threads": Machine(threads=5),
    "NumPy without AVX-512": Machine({"NPY_DISABLE_CPU_FEATURES": "X86_V4 AVX512_ICL"}),
    "NumPy without AVX2": Machine({"NPY_DISABLE_CPU_FEATURES": "X86_V3 X86_V4 AVX512_ICL"}),
    "OpenBLAS of Nehalem": Machine({"OPENBLAS_CORETYPE": "Nehalem"}),
    "OpenBLAS of Haswell": Machine({"OPENBLAS_CORETYPE": "Haswell"}),
    "OpenBLAS of Skylake-X": Machine({"OPENBLAS_CORETYPE": "SkylakeX"}),
    "OpenCV of SSE3": Machine(
        {"OPENCV_CPU_DISABLE": "AVX512-SKX,AVX2,FP16,AVX,SSE4.2,SSE4.1", "OPENCV_IPP": "disabled"}
    ),
    "C library without FMA": Machine({"GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX512F,-AVX2,-FMA,-FMA4"}),
}
"""This machine, told to choose as others do."""

QEMU = 10
"""The version that was found right: 7.2 gathers other numbers than asked for, so that ``np.maximum`` of every
third number of an array is wrong where there is AVX2."""

X86 = {"Ivy Bridge": "IvyBridge", "Haswell": "Haswell", "all that QEMU has": "max"}
"""Emulated x86-64 processors: with AVX alone, with AVX2 and FMA, and more."""


def emulated(aarch64: Path | None) -> dict[str, Machine]:
    """Machines by QEMU; a RuntimeError says what is missing."""
    if not shutil.which("qemu-x86_64"):
        raise RuntimeError("qemu-x86_64 is missing: apt-get install qemu-user")
    version = subprocess.run(["qemu-x86_64", "--version"], capture_output=True, text=True, check=True).stdout
    if int(version.split("version ")[1].split(".")[0]) < QEMU:
        raise RuntimeError(f"{version.splitlines()[0]} gets some of AVX2 wrong: version {QEMU} is needed")
    found = {
        name: Machine(python=("qemu-x86_64", "-cpu", model, sys.executable), kernels=f"{model}-kernels")
        for name, model in X86.items()
    }
    if aarch64:
        python = aarch64 / "root" / "usr" / "bin" / "python3.11"
        if not python.exists():
            raise RuntimeError(f"{aarch64} has no Python for aarch64: run with --prepare {aarch64}")
        found["aarch64"] = Machine(
            {"PYTHONPATH": str(aarch64 / "site")},
            ("qemu-aarch64", "-L", str(aarch64 / "root"), str(python)),
            kernels="aarch64-kernels",
            left_out=frozenset(
                {"refined"}
            ),  # starts Python for an SVG of unknown origin, which is not emulated
        )
    return found


def prepare(folder: Path) -> None:
    """Fetch a Python for aarch64 and the packages that warpsplat needs, in the versions installed here."""
    debs = folder / "debs"
    debs.mkdir(parents=True, exist_ok=True)
    subprocess.run(["dpkg", "--add-architecture", "arm64"], check=True)
    subprocess.run(["apt-get", "-qq", "update"], check=True)
    subprocess.run(
        ["apt-get", "-qq", "download", *(f"{name}:arm64" for name in PACKAGES)], check=True, cwd=debs
    )
    for deb in sorted(debs.glob("*.deb")):
        subprocess.run(["dpkg", "-x", str(deb), str(folder / "root")], check=True)
    platforms = [f"--platform=manylinux_2_{minor}_aarch64" for minor in (36, 35, 34, 31, 28, 27, 17)]
    wanted = [f"{name}=={metadata.version(name)}" for name in WHEELS]
    pip = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--only-binary=:all:"]
    target = ["--python-version=3.11", "--platform=manylinux2014_aarch64", f"--target={folder / 'site'}"]
    subprocess.run([*pip, *platforms, *target, *wanted], check=True)


def made_on(machine: Machine, cases: Sequence[str]) -> dict[str, str]:
    """Digests by case, without those that a machine did not get to, whose last line is shown then."""
    environment = {**os.environ, **machine.environment}
    environment["PYTHONPATH"] = os.pathsep.join([str(ROOT), machine.environment.get("PYTHONPATH", "")])
    cache = Path(tempfile.gettempdir()) / f"warpsplat-test-{machine.kernels or 'kernels'}"
    environment["WARP_CACHE_PATH"] = str(cache)
    command = [*machine.python, "-m", "tests.golden", "--threads", str(machine.threads), *cases]
    done = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, check=False)
    if done.returncode:
        print(f"  exit code {done.returncode}: {(done.stderr.strip().splitlines() or [''])[-1]}")
    return {name: digest for line in done.stdout.splitlines() for name, digest in json.loads(line).items()}


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.machines", description=__doc__)
    parser.add_argument("cases", nargs="*", help="names of golden cases; default: all, or some if emulated")
    parser.add_argument("--emulate", action="store_true", help="other processors, by QEMU")
    parser.add_argument("--aarch64", type=Path, metavar="FOLDER", help="where a Python for aarch64 is")
    parser.add_argument("--prepare", type=Path, metavar="FOLDER", help="fetch a Python for aarch64, and stop")
    parser.add_argument("--only", metavar="NAME", help="one machine")
    given = parser.parse_args()
    if given.prepare:
        prepare(given.prepare)
        return 0
    try:
        machines = emulated(given.aarch64) if given.emulate or given.aarch64 else TOLD
    except RuntimeError as error:
        parser.error(str(error))
    cases = given.cases or (EMULATED_CASES if machines is not TOLD else tuple(CASES))
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
