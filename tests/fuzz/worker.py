"""A process that runs commands of warpsplat one after the other, and its owner's handle on it.

Starting Python and its libraries takes a hundred times as long as most commands on small inputs do. The
process is one of its own so that a crash, a hang or a flood of memory is seen and outlived.
"""

from __future__ import annotations

import contextlib
import json
import os
import select
import subprocess
import sys
import tempfile
import time
import traceback
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from tests import ROOT

MAX_SECONDS = 10.0
"""No run on a small input may take longer [s of processor time, which other programs do not lengthen]."""
PATIENCE = 10.0
"""Seconds on the clock for each of those: beyond, a command waits for something that does not come."""
MAX_MEMORY = 2 << 30
"""Nor hold more [bytes]."""
DRIFT = 512 << 20
"""A worker that has grown beyond this between commands [bytes] is replaced, so that one run's memory is not
held against the next."""


@dataclass(frozen=True)
class Outcome:
    """What a command did."""

    code: int
    """Exit code; minus the signal's number where a signal ended the process."""
    stdout: str
    stderr: str
    seconds: float
    """Of processor time."""
    peak: int
    """Most memory that was held [bytes]; 0 where the system does not say."""
    ended: str = ""
    """Why the process had to be ended: "time" or "memory"."""


def _status(process: int | str, key: str) -> int:
    """A size [bytes] out of Linux' account of a process; 0 where there is none."""
    try:
        text = Path(f"/proc/{process}/status").read_text()
    except OSError:
        return 0
    return next((int(line.split()[1]) * 1024 for line in text.splitlines() if line.startswith(key)), 0)


TICKS = os.sysconf("SC_CLK_TCK") if hasattr(os, "sysconf") else 100


def _spent(process: int) -> float:
    """Processor time of a process and of the children that it has waited for [s]; 0 where nobody says."""
    try:
        fields = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
    except OSError:
        return 0.0
    return sum(map(int, fields[11:15])) / TICKS


def _children(process: int) -> list[int]:
    try:
        return [int(c) for c in Path(f"/proc/{process}/task/{process}/children").read_text().split()]
    except OSError:
        return []


class Worker:
    """Owner's side; starts the process when it is needed, and again after it has ended."""

    def __init__(self) -> None:
        self._process: subprocess.Popen[bytes] | None = None

    def __enter__(self) -> Worker:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """End the process."""
        if self._process:
            self._process.kill()
            self._process.wait()
            for pipe in (self._process.stdin, self._process.stdout):
                with contextlib.suppress(OSError):  # what is left in the pipe goes nowhere
                    assert pipe
                    pipe.close()
        self._process = None

    def run(self, arguments: list[str], folder: Path, stdin: Path | None = None) -> Outcome:
        """Run ``warpsplat ARGUMENTS`` in ``folder``."""
        if not self._process:
            # Warm, so that the first command's time is its own; the limit there only guards against hangs.
            self._start()
            outcome = self._ask(["info"], folder, None, limit=120.0)
            if not self._process:
                return outcome
        outcome = self._ask(arguments, folder, stdin, limit=MAX_SECONDS)
        if self._process and _status(self._process.pid, "VmRSS") > DRIFT:
            self.close()
        return outcome

    def _start(self) -> None:
        self._process = subprocess.Popen(
            [sys.executable, "-m", "tests.fuzz.worker"],
            cwd=ROOT,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
        )

    def _ask(self, arguments: list[str], folder: Path, stdin: Path | None, *, limit: float) -> Outcome:
        process = self._process
        assert process and process.stdin and process.stdout
        task = {"arguments": arguments, "folder": str(folder), "stdin": str(stdin or os.devnull)}
        with contextlib.suppress(BrokenPipeError):  # a process that has ended is seen below
            process.stdin.write(json.dumps(task).encode() + b"\n")
            process.stdin.flush()
        started, before, peak, ended = time.monotonic(), _spent(process.pid), 0, ""
        spent = 0.0
        while not ended and not select.select([process.stdout], [], [], 0.05)[0]:
            children = _children(process.pid)
            held = sum(_status(p, "VmRSS") for p in (process.pid, *children))
            peak = max(peak, held)
            spent = _spent(process.pid) - before + sum(map(_spent, children))
            if spent > limit or time.monotonic() - started > PATIENCE * limit:
                ended = "time"
            elif held > MAX_MEMORY:
                ended = "memory"
        if not ended:
            answer = process.stdout.readline()
            if answer:
                values: dict[str, Any] = json.loads(answer)
                values["peak"] = max(peak, values["peak"])
                return Outcome(**values)
            process.wait()
        self.close()
        return Outcome(process.returncode, "", "", spent, peak, ended)


def _serve() -> None:
    """Process' side: run what comes on the standard input, answer on the standard output."""
    tasks = os.fdopen(os.dup(0), "rb")
    answers = os.fdopen(os.dup(1), "wb")
    main: Any = None
    for line in tasks:
        task = json.loads(line)
        if main is None:
            from warpsplat.cli.main import main
        answers.write(json.dumps(asdict(_run(main, task))).encode() + b"\n")
        answers.flush()


def _run(main: Any, task: dict[str, Any]) -> Outcome:
    with contextlib.suppress(OSError):
        Path("/proc/self/clear_refs").write_text("5")  # forget the highest memory so far
    os.chdir(task["folder"])
    umask = os.umask(0o022)
    with tempfile.TemporaryFile() as out, tempfile.TemporaryFile() as err:
        # Files in the streams' places, and not Python's streams only: native code writes as well.
        source = os.open(task["stdin"], os.O_RDONLY)
        for number, handle in enumerate((source, out.fileno(), err.fileno())):
            os.dup2(handle, number)
        os.close(source)
        sys.stdin, sys.stdout, sys.stderr = (
            open(number, mode, encoding="utf-8", errors="backslashreplace", closefd=False)  # noqa: SIM115
            for number, mode in enumerate("rww")
        )
        started = sum(os.times()[:4])
        code = _call(main, task["arguments"])
        seconds = sum(os.times()[:4]) - started
        for stream in (sys.stdout, sys.stderr):
            with contextlib.suppress(ValueError, OSError):
                stream.flush()
        texts = []
        for file in (out, err):
            file.seek(0)
            texts.append(file.read(1 << 20).decode("utf-8", "replace"))
    os.umask(umask)
    peak = _status("self", "VmHWM")
    return Outcome(code, texts[0], texts[1], seconds, peak)


def _call(main: Any, arguments: list[str]) -> int:
    try:
        main(arguments)
    except SystemExit as end:
        if end.code is None or isinstance(end.code, int):
            return end.code or 0
        print(end.code, file=sys.stderr)
        return 1
    except BaseException:  # what Python would print before it ends
        traceback.print_exc()
        return 1
    return 0


if __name__ == "__main__":
    _serve()
