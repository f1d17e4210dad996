"""Runs cases in worker processes, judges them, keeps what was found."""

from __future__ import annotations

import contextlib
import queue
import shutil
import tempfile
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from tests.fuzz.cases import FILES, Case, Cases, Command, judge
from tests.fuzz.worker import Outcome, Worker


@dataclass(frozen=True)
class Finding:
    """A case in which something went wrong."""

    case: Case
    command: Command
    what: str
    outcome: Outcome

    def line(self) -> str:
        """For people."""
        arguments = " ".join(self.command.arguments)
        return f"{self.case.target} {self.case.index} ({self.case.seed}): warpsplat {arguments}: {self.what}"


@dataclass
class Report:
    """What a campaign saw."""

    cases: int = 0
    commands: int = 0
    accepted: int = 0
    """Commands that ended with 0: a corpus of which all is refused tests the doors only."""
    findings: list[Finding] = field(default_factory=list)
    slowest: tuple[float, str] = (0.0, "-")
    """[s] and the command."""
    largest: tuple[int, str] = (0, "-")
    """[bytes] and the command."""
    seconds: float = 0.0

    def add(self, case: Case, command: Command, outcome: Outcome) -> None:
        """Count a command."""
        self.commands += 1
        self.accepted += outcome.code == 0
        name = f"{case.target} {case.index} {command.arguments[0]}"
        self.slowest = max(self.slowest, (outcome.seconds, name))
        self.largest = max(self.largest, (outcome.peak, name))

    def line(self) -> str:
        """The summary."""
        return (
            f"{self.cases} cases, {self.commands} commands ({self.accepted} accepted), "
            f"{len(self.findings)} findings; "
            f"slowest {self.slowest[0]:.2f} s ({self.slowest[1]}), largest {self.largest[0] / 2**20:.0f} MiB "
            f"({self.largest[1]}); {self.seconds:.0f} s"
        )


def lay_out(case: Case, folder: Path) -> None:
    """An empty folder with the case's files."""
    shutil.rmtree(folder, ignore_errors=True)
    for name, data in {**FILES, case.name: case.data}.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(data)


def run_case(
    worker: Worker, case: Case, folder: Path, report: Callable[[Case, Command, Outcome], None] | None = None
) -> Finding | None:
    """Run a case's commands, up to the first that goes wrong."""
    lay_out(case, folder)
    for command in case.commands:
        outcome = worker.run(
            list(command.arguments), folder, folder / command.stdin if command.stdin else None
        )
        if report:
            report(case, command, outcome)
        what = judge(command, outcome, folder)
        given = folder / case.name
        if command.consumes and outcome.code == 0:
            what = what or ("the input is left" if given.exists() else "")
        elif not what and given.read_bytes() != case.data:
            what = "the input was changed"
        if what:
            return Finding(case, command, what, outcome)
    return None


def shrink(worker: Worker, finding: Finding, folder: Path, tries: int = 60) -> Finding:
    """The same finding on a smaller input: pieces are left out as long as it stays."""
    if finding.outcome.seconds > 2:
        return finding
    size = len(finding.case.data) // 2
    while size and tries:
        place = 0
        while place < len(finding.case.data) and tries:
            data = finding.case.data
            smaller = finding.case.with_data(data[:place] + data[place + size :])
            tries -= 1
            found = run_case(worker, smaller, folder)
            if found and found.what == finding.what:
                finding = found
            else:
                place += size
        size //= 2
    return finding


def keep(finding: Finding, folder: Path) -> None:
    """Store a finding's input, and beside it how to see it."""
    folder.mkdir(parents=True, exist_ok=True)
    name = f"{finding.case.target}-{finding.case.index}"
    (folder / (name + Path(finding.case.name).suffix)).write_bytes(finding.case.data)
    (folder / f"{name}.txt").write_text(
        f"{finding.line()}\n\n{finding.outcome.stderr}", "utf-8", "backslashreplace"
    )


def campaign(
    cases: Cases, count: int, *, first: int = 0, workers: int = 1, worker: Worker | None = None,
    kept: Path | None = None, say: Callable[[str], None] | None = None,
) -> Report:  # fmt: skip
    """Run ``count`` cases in ``workers`` processes, or by ``worker``, which stays open; each finding is seen
    twice before it counts.
    """
    report, lock = Report(), threading.Lock()
    todo: queue.SimpleQueue[int] = queue.SimpleQueue()
    for index in range(first, first + count):
        todo.put(index)
    started = time.monotonic()

    def serve() -> None:
        given = contextlib.nullcontext(worker) if worker else Worker()
        with given as mine, tempfile.TemporaryDirectory(prefix="fuzz-") as scratch:
            folder = Path(scratch) / "deep" / "down" / "case"
            while True:
                try:
                    index = todo.get_nowait()
                except queue.Empty:
                    return
                finding = run_case(mine, cases[index], folder, report.add)
                if finding:
                    mine.close()  # again, where no earlier case can have a part in it
                    finding = run_case(mine, finding.case, folder)
                if finding and kept:
                    finding = shrink(mine, finding, folder)
                    keep(finding, kept)
                with lock:
                    report.cases += 1
                    if finding:
                        report.findings.append(finding)
                    if say and finding:
                        say(finding.line())
                    if say and report.cases % 1000 == 0:
                        report.seconds = time.monotonic() - started
                        say(report.line())

    threads = [threading.Thread(target=serve) for _ in range(workers)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    report.seconds = time.monotonic() - started
    return report
