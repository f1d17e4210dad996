"""Run commands of warpsplat under limits, and with signals at chosen moments.

``Forks`` hands tasks to a process that has everything loaded and forks for each of them: a run starts at
once, and leaves nothing behind in its process.
"""

from __future__ import annotations

import contextlib
import functools
import importlib.abc
import itertools
import json
import os
import resource
import runpy
import signal
import subprocess
import sys
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, NamedTuple

from tests import ROOT, make_image

QUICK = ("--device", "cpu", "--curves", "4", "--iterations", "12")
CLOSED = "-"
"""A name for a closed stream, as by ``>&-`` in a shell."""
NOBODY = 65534
"""The number of the user "nobody"."""

MOMENTS = {
    "decoding": ("PIL", "Image", "open"),
    "loading": ("warp", "Module", "load"),
    "training": ("warp", "Launch", "launch"),
    "scoring": ("resvg_py", "svg_to_bytes"),
    "writing": ("os", "fsync"),
    "renaming": ("os", "replace"),
}
"""Stages of a run, by the library calls made there, whatever the structure of the program."""


@dataclass
class Task:
    """A command line and what happens to it."""

    arguments: list[str]
    folder: str
    stdout: str
    stderr: str
    """Files that these go to, or ``CLOSED``."""
    moment: str = ""
    """When ``signal`` comes: one of ``MOMENTS``, or "import NAME"."""
    count: int = 1
    """Number of the call at which it comes."""
    signal: int = 0
    times: int = 1
    """Number of signals."""
    ignored: bool = False
    """Ignore Ctrl-C, as ``nohup`` does."""
    file_size: int = 0
    """Largest file [bytes], as ``ulimit -f`` sets it; 0: any."""
    rights: bool = True
    """False: a superuser, whom permissions do not bind, becomes another user."""
    stdin: str = os.devnull
    memory: int = 0
    """Most memory that it can allocate [bytes]; 0: any."""
    patience: int = 0
    """Seconds after which SIGALRM ends it; 0: never."""


class Outcome(NamedTuple):
    """The outcome of a command."""

    code: int
    """Exit code; minus the signal's number if a signal ended the process."""
    stdout: str = ""
    stderr: str = ""
    seconds: float = 0.0
    """Processor time [s]."""
    peak: int = 0
    """Most memory that the process used [bytes]."""


class _ImportTrap(importlib.abc.MetaPathFinder):
    """Call ``on_import`` when ``module`` is imported."""

    def __init__(self, module: str, on_import: Callable[[], None]) -> None:
        self.module, self.on_import = module, on_import

    def find_spec(self, name: str, path: Sequence[str] | None, target: Any = None) -> None:
        """Find nothing: the next finder will."""
        if name == self.module:
            self.on_import()


def _refuse() -> None:
    """Fail: PyTorch takes seconds to import, and no command needs it."""
    raise AssertionError("a command imports torch")


def _set_trap(task: Task) -> None:
    """Have the task's signal sent to this process at the task's moment."""
    calls = itertools.count(1)

    def strike() -> None:
        if next(calls) == task.count:
            for _ in range(task.times):
                os.kill(os.getpid(), task.signal)

    if task.moment.startswith("import "):
        sys.meta_path.insert(0, _ImportTrap(task.moment.removeprefix("import "), strike))
        return
    module, *path, name = MOMENTS[task.moment]
    owner: Any = functools.reduce(getattr, path, __import__(module))
    original = getattr(owner, name)

    def struck(*arguments: Any, **named: Any) -> Any:
        strike()
        return original(*arguments, **named)

    setattr(owner, name, struck)


def run(task: Task) -> None:
    """Run a task in this process, which cannot be used for anything else afterwards."""
    os.chdir(task.folder)
    for number, stream in enumerate(("stdin", "stdout", "stderr")):
        name = getattr(task, stream)
        if name == CLOSED:
            os.close(number)
            setattr(sys, stream, None)  # as Python finds it at its start
            continue
        opened = os.open(name, os.O_WRONLY | os.O_CREAT | os.O_TRUNC if number else os.O_RDONLY)
        os.dup2(opened, number)
        if opened != number:
            os.close(opened)
    if task.ignored:
        signal.signal(signal.SIGINT, signal.SIG_IGN)
    if task.moment:
        _set_trap(task)
    if task.file_size:
        sys.dont_write_bytecode = True  # Python itself would leave half a file in the cache of a module
        resource.setrlimit(resource.RLIMIT_FSIZE, (task.file_size, task.file_size))
    if task.memory:
        resource.setrlimit(resource.RLIMIT_AS, (task.memory, task.memory))
    signal.alarm(task.patience)
    if not task.rights and os.geteuid() == 0:
        os.setgroups([])
        os.setgid(NOBODY)
        os.setuid(NOBODY)
    sys.argv[1:] = task.arguments
    runpy.run_module("warpsplat", run_name="__main__", alter_sys=True)


def _end(task: Task) -> None:
    """Run a task, then end the process as Python would, but without the clean-up of its parent."""
    code: Any = 0
    try:
        run(task)
    except SystemExit as end:
        code = end.code
    except BaseException:
        sys.excepthook(*sys.exc_info())
        code = 1
    for stream in (sys.stdout, sys.stderr):
        with contextlib.suppress(OSError, ValueError, AttributeError):
            stream.flush()
    os._exit(int(code or 0))


def serve() -> None:
    """Fork for each task on the standard input; answer with its exit code, processor time and memory."""
    from warpsplat.cli.main import main

    sys.meta_path.insert(0, _ImportTrap("torch", _refuse))
    tasks, answers = os.fdopen(os.dup(0), "r"), os.fdopen(os.dup(1), "w")
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
    for line in tasks:
        task = Task(**json.loads(line))
        if task.stderr == os.devnull:
            os.chdir(task.folder)
            with contextlib.suppress(SystemExit):
                main(task.arguments)
            answer: tuple[float, ...] = (0, 0.0, 0)
        else:
            child = os.fork()
            if not child:
                _end(task)
            _, status, used = os.wait4(child, 0)
            code = os.waitstatus_to_exitcode(status)
            answer = code, used.ru_utime + used.ru_stime, 1024 * used.ru_maxrss
        print(json.dumps(answer), file=answers, flush=True)


WARM = (
    ("vectorize", "a.png", "-o", "b.svg", *QUICK),
    ("vectorize", "a.png", "-o", "a.svg", "--open", *QUICK),
    ("refine", "b.svg", "a.png", "-o", "c.svg", "--device", "cpu", "--iterations", "2"),
    ("render", "a.svg", "-o", "b.png"),
    ("eval", "a.png", "a.svg"),
    ("batch", "jobs.yaml"),
)


class Forks:
    """A process that forks for each task."""

    def __init__(self, scratch: Path) -> None:
        self.out, self.err = str(scratch / "stdout"), str(scratch / "stderr")
        self.process = subprocess.Popen(
            [sys.executable, "-m", "tests.forks"],
            cwd=ROOT,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        make_image(scratch / "a.png")
        (scratch / "jobs.yaml").write_text(
            "jobs: [{images: a.png, device: cpu, curves: 4, iterations: 2, output: o}]"
        )
        for arguments in WARM:
            self._ask(Task(list(arguments), str(scratch), os.devnull, os.devnull))

    def close(self) -> None:
        """End the process."""
        self.process.kill()
        self.process.communicate()

    def run(self, arguments: Sequence[str], folder: Path, **how: Any) -> tuple[int, str, str]:
        """Return exit code (or minus the signal that ended it), stdout and stderr; ``how``: see ``Task``."""
        return self.outcome(arguments, folder, **how)[:3]

    def outcome(self, arguments: Sequence[str], folder: Path, **how: Any) -> Outcome:
        """Return all that is known of a run; ``how``: see ``Task``."""
        task = Task(list(arguments), str(folder), **{"stdout": self.out, "stderr": self.err, **how})
        code, seconds, peak = self._ask(task)
        out, err = (
            "" if n == CLOSED or n.startswith("/dev/") else Path(n).read_text("utf-8", "replace")
            for n in (task.stdout, task.stderr)
        )
        return Outcome(code, out, err, seconds, peak)

    def _ask(self, task: Task) -> tuple[int, float, int]:
        assert self.process.stdin and self.process.stdout
        print(json.dumps(asdict(task)), file=self.process.stdin, flush=True)
        code, seconds, peak = json.loads(self.process.stdout.readline())
        return code, seconds, peak


if __name__ == "__main__":
    if len(sys.argv) > 1:  # one task, from a cold start
        run(Task(**json.loads(sys.argv[1])))
    serve()
