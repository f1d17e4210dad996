"""A process that runs commands of warpsplat one after the other, and its owner's handle on it.

Starting Python and its libraries takes a hundred times as long as most commands on small inputs. The process
is separate so that a crash, a hang or a flood of memory is seen and survived."""

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
"""Longest run on a small input [s of processor time, which other programs do not lengthen]."""
PATIENCE = 10.0
"""Ratio of wall-clock time to that: beyond, a command waits for something that does not come."""
MAX_MEMORY = 2 << 30
"""Most memory of a run [bytes]."""
DRIFT = 512 << 20
"""Memory beyond which a worker is replaced between commands [bytes], so that the next run starts fresh."""
TICKS = os.sysconf("SC_CLK_TCK") if hasattr(os, "sysconf") else 100


@dataclass(frozen=True)
class Outcome:
    """The outcome of a command."""

    code: int
    """Exit code; minus the signal's number if a signal ended the process."""
    stdout: str
    stderr: str
    seconds: float
    """Processor time [s]."""
    peak: int
    """Most memory [bytes]; 0: unknown."""
    ended: str = ""
    """Why the process had to be ended: "time" or "memory"."""


def _proc(process: int | str, name: str) -> str:
    """Return a file of Linux's account of a process; empty if there is none."""
    try:
        return Path(f"/proc/{process}/{name}").read_text()
    except OSError:
        return ""


def _status(process: int | str, key: str) -> int:
    """Return a size [bytes] in a process's status; 0 if it is unknown."""
    lines = _proc(process, "status").splitlines()
    return next((int(line.split()[1]) * 1024 for line in lines if line.startswith(key)), 0)


def _spent(process: int) -> float:
    """Return the processor time of a process and its finished children [s]."""
    return sum(map(int, _proc(process, "stat").rpartition(")")[2].split()[11:15])) / TICKS


class Worker:
    """The owner's side; the process is started when it is needed, and again after it has ended."""

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
                with contextlib.suppress(OSError):  # unsent data in the pipe
                    assert pipe
                    pipe.close()
        self._process = None

    def run(self, arguments: list[str], folder: Path, stdin: Path | None = None) -> Outcome:
        """Run ``warpsplat ARGUMENTS`` in ``folder``."""
        if not self._process:
            self._process = subprocess.Popen(
                [sys.executable, "-m", "tests.fuzz.worker"],
                cwd=ROOT,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
            )
            # A first command, so that start-up does not count; the limit only guards against hangs.
            outcome = self._ask(["info"], folder, None, limit=120.0)
            if not self._process:
                return outcome
        outcome = self._ask(arguments, folder, stdin, limit=MAX_SECONDS)
        if self._process and _status(self._process.pid, "VmRSS") > DRIFT:
            self.close()
        return outcome

    def _ask(self, arguments: list[str], folder: Path, stdin: Path | None, *, limit: float) -> Outcome:
        process = self._process
        assert process and process.stdin and process.stdout
        task = {"arguments": arguments, "folder": str(folder), "stdin": str(stdin or os.devnull)}
        with contextlib.suppress(BrokenPipeError):  # the process has ended, see below
            process.stdin.write(json.dumps(task).encode() + b"\n")
            process.stdin.flush()
        started, before, peak, ended, spent = time.monotonic(), _spent(process.pid), 0, "", 0.0
        while not ended and not select.select([process.stdout], [], [], 0.05)[0]:
            children = list(map(int, _proc(process.pid, f"task/{process.pid}/children").split()))
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
    """Run the tasks on the standard input, and answer on the standard output."""
    tasks = os.fdopen(os.dup(0), "rb")
    answers = os.fdopen(os.dup(1), "wb")
    from warpsplat.cli.main import main

    for line in tasks:
        answers.write(json.dumps(asdict(_run(main, json.loads(line)))).encode() + b"\n")
        answers.flush()


def _run(main: Any, task: dict[str, Any]) -> Outcome:
    with contextlib.suppress(OSError):
        Path("/proc/self/clear_refs").write_text("5")  # reset the highest memory
    os.chdir(task["folder"])
    umask = os.umask(0o022)
    with tempfile.TemporaryFile() as out, tempfile.TemporaryFile() as err:
        # Replace the file descriptors, and not Python's streams only: native code writes as well.
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
    return Outcome(code, texts[0], texts[1], seconds, _status("self", "VmHWM"))


def _call(main: Any, arguments: list[str]) -> int:
    try:
        main(arguments)
    except SystemExit as end:
        if end.code is None or isinstance(end.code, int):
            return end.code or 0
        print(end.code, file=sys.stderr)
        return 1
    except BaseException:  # as Python does at the end
        traceback.print_exc()
        return 1
    return 0


if __name__ == "__main__":
    _serve()
