"""A short run of the fuzzer, and proof that it sees faults."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from tests.fuzz import worker
from tests.fuzz.campaign import campaign, lay_out
from tests.fuzz.cases import TARGETS, Case, Cases, Command, judge
from tests.fuzz.worker import Outcome, Worker

pytestmark = pytest.mark.slow

SEED = 21
COUNTS = {"image": 100, "svg": 40, "yaml": 50, "options": 50, "checkpoint": 30, "manifest": 40}


@pytest.fixture(scope="module")
def shared() -> Iterator[Worker]:
    with Worker() as made:
        yield made


@pytest.mark.parametrize("target", TARGETS)
def test_no_input_breaks_the_command_line(shared: Worker, target: str) -> None:
    tally = campaign(Cases(SEED, target), range(COUNTS[target]), shared)
    assert not tally.findings, "\n".join(f.line() for f in tally.findings)
    if target in ("image", "svg", "checkpoint"):
        assert tally.accepted > tally.commands / 20, "otherwise only the first checks are tested"


def test_cases_are_a_function_of_seed_and_number() -> None:
    one, other = Cases(3, "svg"), Cases(3, "svg")
    assert [one[i] for i in (5, 2)] == [other[i] for i in (5, 2)]
    assert one[5].data != Cases(4, "svg")[5].data


def test_a_worker_survives_crashes_and_hangs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with Worker() as made:
        assert made.run(["--version"], tmp_path).stdout.startswith("warpsplat")
        assert made.process
        made.process.kill()
        made.process.wait()
        assert made.run(["--version"], tmp_path).code == -9
        assert made.run(["--version"], tmp_path).peak > 1 << 20
        monkeypatch.setattr(worker, "PATIENCE", 0.01)
        assert made.run(["bench", "--repeats", "500"], tmp_path).timed_out


COMMAND = Command(("render", "case.svg", "-o", "out.png"), (3,), "out.png")
GOOD = Outcome(3, "", "warpsplat: case.svg: not an SVG\n", 0.1, 1000)


@pytest.mark.parametrize(
    ("change", "stray", "fault"),
    [
        ({}, "", ""),
        ({"code": -11}, "", "signal 11"),
        ({"code": 1}, "", "exit code 1"),
        ({"stderr": "Traceback (most recent call last):\nValueError: x\n"}, "", "ValueError"),
        ({"stderr": "warpsplat: one\nwarpsplat: two\n"}, "", "not one line"),
        ({"stderr": "warpsplat: \x1b[2J\n"}, "", "not one line"),
        ({"stderr": ""}, "", "without a word"),
        ({"stdout": "half of"}, "", "stdout"),
        ({"seconds": 11.0}, "", "took more"),
        ({"peak": 3 << 30}, "", "2 GiB"),
        ({"timed_out": True, "code": -9}, "", "no end"),
        ({"code": 0, "stderr": ""}, "", "missing"),
        ({}, "out.png", "there"),
        ({}, ".warpsplat-1", "left"),
    ],
)
def test_the_judge_sees_faults(tmp_path: Path, change: dict[str, object], stray: str, fault: str) -> None:
    lay_out(Case("svg", 0, "", "case.svg", b"", (COMMAND,)), tmp_path)
    if stray:
        (tmp_path / stray).touch()
    found = judge(COMMAND, replace(GOOD, **change), tmp_path)
    assert fault in found and bool(fault) == bool(found)
