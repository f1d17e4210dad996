"""A short run of the fuzzer, and proof that it sees what it looks for."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.fuzz.campaign import campaign, lay_out
from tests.fuzz.cases import TARGETS, Case, Cases, Command, judge
from tests.fuzz.worker import Outcome, Worker

pytestmark = pytest.mark.slow

SEED = 21
COUNTS = {"image": 120, "svg": 60, "yaml": 50, "options": 50, "checkpoint": 40, "manifest": 40}


@pytest.fixture(scope="module")
def worker() -> Iterator[Worker]:
    with Worker() as made:
        yield made


@pytest.mark.parametrize("target", TARGETS)
def test_no_input_breaks_the_command_line(worker: Worker, target: str) -> None:
    tally = campaign(Cases(SEED, target), range(COUNTS[target]), worker)
    assert not tally.findings, "\n".join(f.line() for f in tally.findings)
    assert tally.cases == COUNTS[target]
    if target in ("image", "svg", "checkpoint"):
        assert tally.accepted > tally.commands / 20, (
            "if all inputs are refused, only the first checks are tested"
        )


def test_cases_are_a_function_of_seed_and_number() -> None:
    one, other = Cases(3), Cases(3)
    assert [one[i] for i in (5, 2)] == [other[i] for i in (5, 2)]
    assert one[5].data != Cases(4)[5].data


def test_a_worker_outlives_crashes(worker: Worker, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert worker.run(["--version"], tmp_path).stdout.startswith("warpsplat")
    process = worker._process
    assert process
    process.kill()
    process.wait()
    assert worker.run(["--version"], tmp_path).code == -9
    assert worker.run(["--version"], tmp_path).code == 0
    monkeypatch.setattr("tests.fuzz.worker.MAX_SECONDS", 0.01)
    assert worker.run(["bench", "--repeats", "500"], tmp_path).ended == "time"


def test_a_worker_measures_memory(worker: Worker, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert worker.run(["--version"], tmp_path).code == 0
    monkeypatch.setattr("tests.fuzz.worker.MAX_MEMORY", 1 << 20)
    outcome = worker.run(["bench", "--repeats", "500"], tmp_path)
    if outcome.peak:  # the system says
        assert outcome.ended == "memory"


COMMAND = Command(("render", "case.svg", "-o", "out.png"), (3,), "out.png")
GOOD = Outcome(3, "", "warpsplat: case.svg: not an SVG\n", 0.1, 1000)


@pytest.mark.parametrize(
    ("change", "word"),
    [
        ({}, ""),
        ({"code": -11}, "signal 11"),
        ({"code": 1}, "exit code 1"),
        ({"stderr": "Traceback (most recent call last):\nValueError: x\n"}, "ValueError"),
        ({"stderr": "warpsplat: one\nwarpsplat: two\n"}, "not one line"),
        ({"stderr": "thread '<unnamed>' panicked\n"}, "not one line"),
        ({"stderr": "warpsplat: \x1b[2J\n"}, "not one line"),
        ({"stderr": ""}, "without a word"),
        ({"stdout": "half of"}, "stdout"),
        ({"seconds": 11.0}, "took more"),
        ({"peak": 3 << 30}, "2 GiB"),
        ({"ended": "time", "code": -9}, "no end"),
        ({"code": 0, "stderr": ""}, "missing"),
    ],
)
def test_the_judge_sees_faults(tmp_path: Path, change: dict[str, object], word: str) -> None:
    lay_out(Case("svg", 0, "", "case.svg", b"", (COMMAND,)), tmp_path)
    outcome = Outcome(**{**GOOD.__dict__, **change})
    assert word in (found := judge(COMMAND, outcome, tmp_path)) and bool(word) == bool(found)


def test_the_judge_sees_unexpected_files(tmp_path: Path) -> None:
    lay_out(Case("svg", 0, "", "case.svg", b"", (COMMAND,)), tmp_path)
    (tmp_path / "out.png").write_bytes(b"")
    assert "there" in judge(COMMAND, GOOD, tmp_path)
    (tmp_path / "out.png").unlink()
    (tmp_path / ".warpsplat-1").touch()
    assert "left" in judge(COMMAND, GOOD, tmp_path)
