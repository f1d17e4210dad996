"""Runs cases in worker processes, judges the outcomes, and keeps the inputs of findings."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
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
        arguments = " ".join(self.command.arguments)
        return f"{self.case.target} {self.case.index} ({self.case.seed}): warpsplat {arguments}: {self.what}"


@dataclass
class Tally:
    """Counts and findings of a campaign."""

    cases: int = 0
    commands: int = 0
    accepted: int = 0
    """Commands that ended with 0: if all inputs are refused, only the first checks are tested."""
    findings: list[Finding] = field(default_factory=list)
    slowest: tuple[float, str] = (0.0, "-")
    """[s] and the command."""
    largest: tuple[int, str] = (0, "-")
    """[bytes] and the command."""

    def add(self, case: Case, command: Command, outcome: Outcome) -> None:
        self.commands += 1
        self.accepted += outcome.code == 0
        name = f"{case.target} {case.index} {command.arguments[0]}"
        self.slowest = max(self.slowest, (outcome.seconds, name))
        self.largest = max(self.largest, (outcome.peak, name))

    def line(self) -> str:
        return (
            f"{self.cases} cases, {self.commands} commands ({self.accepted} accepted), "
            f"{len(self.findings)} findings; slowest {self.slowest[0]:.2f} s ({self.slowest[1]}), "
            f"largest {self.largest[0] / 2**20:.0f} MiB ({self.largest[1]})"
        )


def lay_out(case: Case, folder: Path) -> None:
    """Make an empty folder with the case's files."""
    shutil.rmtree(folder, ignore_errors=True)
    for name, data in {**FILES, case.name: case.data}.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(data)


def run_case(worker: Worker, case: Case, folder: Path, tally: Tally | None = None) -> Finding | None:
    """Run a case's commands, up to the first that goes wrong."""
    lay_out(case, folder)
    for command in case.commands:
        stdin = folder / command.stdin if command.stdin else None
        outcome = worker.run(list(command.arguments), folder, stdin)
        if tally:
            tally.add(case, command, outcome)
        what = judge(command, outcome, folder)
        given = folder / case.name
        if command.consumes and outcome.code == 0:
            what = what or ("the input is left" if given.exists() else "")
        elif not what and given.read_bytes() != case.data:
            what = "the input was changed"
        if what:
            return Finding(case, command, what, outcome)
    return None


def keep(finding: Finding, folder: Path) -> None:
    """Store a finding's input, and a text that describes it."""
    folder.mkdir(parents=True, exist_ok=True)
    name = f"{finding.case.target}-{finding.case.index}"
    (folder / (name + Path(finding.case.name).suffix)).write_bytes(finding.case.data)
    text = f"{finding.line()}\n\n{finding.outcome.stderr}"
    (folder / f"{name}.txt").write_text(text, "utf-8", "backslashreplace")


def campaign(
    cases: Cases,
    numbers: Iterable[int],
    worker: Worker,
    kept: Path | None = None,
    echo: Callable[[str], None] = lambda _: None,
) -> Tally:
    """Run cases; a finding counts if it is seen a second time, in a new process."""
    tally = Tally()
    with tempfile.TemporaryDirectory(prefix="fuzz-") as scratch:
        folder = Path(scratch) / "deep" / "down" / "case"
        for number in numbers:
            finding = run_case(worker, cases[number], folder, tally)
            if finding:
                worker.close()
                finding = run_case(worker, finding.case, folder)
            tally.cases += 1
            if finding:
                tally.findings.append(finding)
                echo(finding.line())
                if kept:
                    keep(finding, kept)
            if tally.cases % 1000 == 0:
                echo(tally.line())
    return tally


def campaigns(
    cases: Cases, numbers: range, workers: int, kept: Path | None, echo: Callable[[str], None]
) -> list[Tally]:
    """Run cases in several processes, each of which has every so many."""

    def share(first: int) -> Tally:
        with Worker() as worker:
            return campaign(cases, numbers[first::workers], worker, kept, echo)

    with ThreadPoolExecutor(workers) as threads:
        return list(threads.map(share, range(workers)))
