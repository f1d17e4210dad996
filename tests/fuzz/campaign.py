"""Run cases in a worker process and judge the outcomes."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from pathlib import Path

from tests.fuzz.cases import FILES, Case, Cases, Command, judge
from tests.fuzz.worker import Outcome, Worker


@dataclass(frozen=True)
class Finding:
    """A case in which something went wrong."""

    case: Case
    command: Command
    fault: str
    outcome: Outcome

    def line(self) -> str:
        case, arguments = self.case, " ".join(self.command.arguments)
        return f"{case.target} {case.index} ({case.seed}): warpsplat {arguments}: {self.fault}"

    def save(self, folder: Path) -> None:
        """Store the input, and a text that describes the finding."""
        folder.mkdir(parents=True, exist_ok=True)
        path = folder / f"{self.case.target}-{self.case.index}{Path(self.case.name).suffix}"
        path.write_bytes(self.case.data)
        text = f"{self.line()}\n\n{self.outcome.stderr}"
        path.with_suffix(".txt").write_text(text, "utf-8", "backslashreplace")


@dataclass
class Tally:
    """Counts and findings of a campaign."""

    commands: int = 0
    accepted: int = 0
    """Commands that ended with 0: if all inputs are refused, only the first checks are tested."""
    findings: list[Finding] = field(default_factory=list)
    slowest: tuple[float, str] = (0.0, "-")
    """Processor time [s] and the case."""

    def line(self) -> str:
        return (
            f"{self.commands} commands ({self.accepted} accepted), {len(self.findings)} findings; "
            f"slowest {self.slowest[0]:.2f} s ({self.slowest[1]})"
        )


def lay_out(case: Case, folder: Path) -> None:
    """Make an empty folder with the case's files."""
    shutil.rmtree(folder, ignore_errors=True)
    for name, data in {**FILES, case.name: case.data}.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(data)


def run_case(worker: Worker, case: Case, folder: Path, tally: Tally) -> Finding | None:
    """Run a case's commands, up to the first that goes wrong."""
    lay_out(case, folder)
    for command in case.commands:
        outcome = worker.run(command.arguments, folder, folder / command.stdin if command.stdin else None)
        tally.commands += 1
        tally.accepted += outcome.code == 0
        tally.slowest = max(tally.slowest, (outcome.seconds, f"{case.target} {case.index}"))
        fault = judge(command, outcome, folder)
        given = folder / case.name
        if command.consumes and outcome.code == 0:
            fault = fault or ("the input is left" if given.exists() else "")
        elif not fault and given.read_bytes() != case.data:
            fault = "the input was changed"
        if fault:
            return Finding(case, command, fault, outcome)
    return None


def campaign(
    cases: Cases,
    numbers: Iterable[int],
    worker: Worker,
    on_finding: Callable[[Finding], None] = lambda _: None,
) -> Tally:
    """Run cases; a finding counts if it is seen a second time, in a new process."""
    tally = Tally()
    with tempfile.TemporaryDirectory(prefix="fuzz-") as scratch:
        folder = Path(scratch) / "deep" / "down" / "case"
        for number in numbers:
            finding = run_case(worker, cases[number], folder, tally)
            if finding:
                worker.close()
                finding = run_case(worker, finding.case, folder, tally)
            if finding:
                tally.findings.append(finding)
                on_finding(finding)
    return tally
