"""Check everything that needs a GPU, within eight minutes: ``python -m tests.on_gpu``.

The parts: all kernels compiled, images and gradients against the CPU's, two runs with the same bits, speed,
streams of PyTorch, memory, pictures on CPU and GPU, and the tests that take a device. Each runs in a process
of its own with a time limit; where one fails the others go on. What needs PyTorch is left out where that is
missing or cannot use the GPU. Ends with a table for docs/gpu.md. The exit status is 1 where something failed.

The day with a GPU can be rehearsed: ``python -m tests.fake_cuda -m tests.on_gpu --small`` tries all parts in
small on the test device.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from pathlib import Path

from tests import ROOT
from tests.on_gpu.parts import PARTS, Plan, Row, names

PHOTOGRAPHS = [ROOT / "docs/gallery/images/photo", ROOT / "docs/images"]
"""Folders of pictures; a source distribution has only the second."""

SUFFIXES = {".png", ".jpg", ".jpeg"}

SMALL = {
    "sizes": ((12, 64, 48), (16, 64, 64)),
    "has_goals": False,
    "side": 64,
    "curves": 8,
    "iterations": 20,
    "repeats": 1,
    "suite": ("tests/rendering/test_tiles.py", "tests/rendering/test_program.py"),
}
"""A plan that takes seconds, to try the command itself."""


def pictures_in(folder: Path, count: int) -> tuple[str, ...]:
    """Return ``count`` pictures of a folder, evenly spaced over their names."""
    found = sorted(path for path in folder.iterdir() if path.suffix.lower() in SUFFIXES)
    chosen = {len(found) * i // count for i in range(count)} if found else set()
    return tuple(str(found[i].resolve()) for i in sorted(chosen))


def rows_of(name: str, plan: Plan, limit: float) -> Iterator[Row]:
    """Run a part in a process of its own; yield its rows, and one more where it fails."""
    with tempfile.TemporaryDirectory() as folder:
        log, output = Path(folder, "rows"), Path(folder, "output")
        log.touch()
        arguments = [sys.executable, "-m", "tests.on_gpu", "--part", name, json.dumps(asdict(plan)), str(log)]
        failure = ""
        with output.open("w") as file:
            child = subprocess.Popen(
                arguments, cwd=ROOT, stdout=file, stderr=subprocess.STDOUT, start_new_session=os.name != "nt"
            )
            try:
                if child.wait(limit):
                    failure = f"exit status {child.returncode}"
            except subprocess.TimeoutExpired:
                failure = f"not done after {limit:g} s"
            finally:
                end(child)
        for line in log.read_text("utf-8").splitlines():
            yield Row(**json.loads(line))
        if failure:
            last = [line for line in output.read_text("utf-8", "replace").splitlines() if line.strip()][-1:]
            yield Row(name, ": ".join([failure, *last])[:300].replace("|", "/"), "to the end", passed=False)


def end(child: subprocess.Popen[bytes]) -> None:
    """End a process with those that it started."""
    if child.poll() is None or os.name != "nt":
        with contextlib.suppress(ProcessLookupError, PermissionError):
            os.killpg(child.pid, 9) if os.name != "nt" else child.kill()
    child.wait()


def run_part(name: str, plan: str, log: str) -> None:
    """Run a part in this process; append its rows to a file."""
    given = json.loads(plan)
    given["sizes"] = tuple(tuple(size) for size in given["sizes"])
    with Path(log).open("a", encoding="utf-8") as file:
        for row in PARTS[name][0](Plan(**given)):
            file.write(json.dumps(asdict(row)) + "\n")
            file.flush()


def table(rows: Sequence[tuple[str, Row]]) -> str:
    """Return the table of Markdown."""
    lines = ["| part | what | figure | wanted | |", "| --- | --- | --- | --- | --- |"]
    for part, row in rows:
        state = {True: "", False: "FAILED", None: "left out"}[row.passed]
        lines.append(f"| {part} | {row.what} | {row.figure} | {row.wanted} | {state} |")
    return "\n".join(lines)


def verdict(rows: Sequence[Row]) -> str:
    """Return how a part ended."""
    failed = sum(row.passed is False for row in rows)
    if failed:
        return f"FAIL: {failed} of {len(rows)}"
    return "PASS" if any(row.passed for row in rows) else "LEFT OUT"


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the parts; print their rows as they are known, then the table."""
    parser = argparse.ArgumentParser(prog="python -m tests.on_gpu", description=__doc__)
    parser.add_argument("--device", default="cuda:0")
    parser.add_argument("--pictures", metavar="FOLDER", type=Path, help="of photographs; default: of docs/")
    parser.add_argument("--count", type=int, default=3, help="pictures taken from the folder")
    parser.add_argument("--only", nargs="+", choices=PARTS, default=(), help="parts to run; default: all")
    parser.add_argument("--small", action="store_true", help="tiny sizes, to try the command without a GPU")
    parser.add_argument("--part", nargs=3, help=argparse.SUPPRESS)
    options = parser.parse_args(arguments)
    if options.part:
        run_part(*options.part)
        return 0
    # That of the suite, so that nothing is compiled twice.
    os.environ.setdefault("WARP_CACHE_PATH", str(Path(tempfile.gettempdir(), "warpsplat-test-kernels")))
    folder = options.pictures or next(folder for folder in PHOTOGRAPHS if folder.exists())
    pictures = pictures_in(folder, options.count)
    plan = Plan(options.device, pictures, **(SMALL if options.small else {}))
    begin, rows = time.monotonic(), list[tuple[str, Row]]()
    for name in names(options.only):
        first = len(rows)
        for row in rows_of(name, plan, PARTS[name][1]):
            rows.append((name, row))
            print(f"{time.monotonic() - begin:4.0f} s  {name}: {row.what}: {row.figure}", flush=True)
        ended = verdict([row for _, row in rows[first:]])
        print(f"{time.monotonic() - begin:4.0f} s  {name}: {ended}", flush=True)
    failed = sum(row.passed is False for _, row in rows)
    print(f"\n{table(rows)}\n\n{failed} of {len(rows)} failed; {time.monotonic() - begin:.0f} s")
    return int(failed > 0)


if __name__ == "__main__":
    sys.exit(main())
