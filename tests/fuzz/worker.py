"""A warm process that runs commands of warpsplat one after the other, and its owner's handle on it.

Starting Python and its libraries takes a hundred times as long as most commands on small inputs. The process
is separate so that a crash, a hang or a flood of memory is seen and survived.
"""

from __future__ import annotations

import contextlib
import json
import os
import resource
import select
import subprocess
import sys
import tempfile
import traceback
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from tests import ROOT

MAX_SECONDS = 10.0
"""Longest run on a small input, in processor time, which other programs do not lengthen [s]."""
PATIENCE = 100.0
"""Time after which a command is ended [s]."""
MAX_MEMORY, ADDRESSES = 2 << 30, 32 << 30
"""Most memory of a run, and most that the process can allocate [bytes]."""


@dataclass(frozen=True)
class Outcome:
    """The outcome of a command."""

    code: int
    """Exit code; minus the signal's number if a signal ended the process."""
    stdout: str = ""
    stderr: str = ""
    seconds: float = 0.0
    """Processor time [s]."""
    peak: int = 0
    """Most memory that the process has used so far [bytes]."""
    timed_out: bool = False


class Worker:
    """The owner's side; the process is started when it is needed, and again after it has ended."""

    def __init__(self) -> None:
        self.process: subprocess.Popen[bytes] | None = None

    def __enter__(self) -> Worker:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """End the process."""
        if self.process:
            self.process.kill()
            self.process.communicate()
        self.process = None

    def run(self, arguments: Sequence[str], folder: Path, stdin: Path | None = None) -> Outcome:
        """Run ``warpsplat ARGUMENTS`` in ``folder``."""
        if not self.process:
            command = [sys.executable, "-m", "tests.fuzz.worker"]
            pipe, null = subprocess.PIPE, subprocess.DEVNULL
            self.process = subprocess.Popen(command, 0, cwd=ROOT, stdin=pipe, stdout=pipe, stderr=null)
        process = self.process
        assert process.stdin and process.stdout
        task = json.dumps([list(arguments), str(folder), str(stdin or os.devnull)]).encode()
        with contextlib.suppress(BrokenPipeError):  # the process has ended, see below
            process.stdin.write(task + b"\n")
        timed_out = not select.select([process.stdout], [], [], PATIENCE)[0]
        answer = b"" if timed_out else process.stdout.readline()
        if answer:
            return Outcome(**json.loads(answer))
        if not timed_out:
            process.wait()
        self.close()
        return Outcome(process.returncode, timed_out=timed_out)


def serve() -> None:
    """Run the tasks on the standard input, and answer on the standard output."""
    resource.setrlimit(resource.RLIMIT_AS, (ADDRESSES, ADDRESSES))
    tasks, answers = os.fdopen(os.dup(0)), os.fdopen(os.dup(1), "w")
    from warpsplat.cli.main import main

    for line in tasks:
        print(json.dumps(asdict(_run(main, *json.loads(line)))), file=answers, flush=True)


def _run(main: Any, arguments: list[str], folder: str, stdin: str) -> Outcome:
    os.chdir(folder)
    umask = os.umask(0o022)
    with open(stdin, "rb") as source, tempfile.TemporaryFile() as out, tempfile.TemporaryFile() as err:
        # Replace the file descriptors, and not Python's streams only: native code writes as well.
        for number, file in enumerate((source, out, err)):
            os.dup2(file.fileno(), number)
        sys.stdin, sys.stdout, sys.stderr = (
            open(number, mode, encoding="utf-8", errors="backslashreplace", closefd=False)  # noqa: SIM115
            for number, mode in enumerate("rww")
        )
        started = sum(os.times()[:4])
        code = _call(main, arguments)
        seconds = sum(os.times()[:4]) - started
        texts = []
        for stream, file in ((sys.stdout, out), (sys.stderr, err)):
            with contextlib.suppress(ValueError, OSError):
                stream.flush()
            file.seek(0)
            texts.append(file.read(1 << 20).decode("utf-8", "replace"))
    os.umask(umask)
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
    return Outcome(code, texts[0], texts[1], seconds, peak)


def _call(main: Any, arguments: list[str]) -> int:
    """Return the exit code of a command, as Python would end with it."""
    try:
        main(arguments)
    except SystemExit as end:
        if end.code is None or isinstance(end.code, int):
            return end.code or 0
        print(end.code, file=sys.stderr)
        return 1
    except BaseException:
        traceback.print_exc()
        return 1
    return 0


if __name__ == "__main__":
    serve()
