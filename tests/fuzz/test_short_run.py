"""A short run of the fuzzer, and proof that it sees faults."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.forks import Forks, Outcome
from tests.fuzz.cases import TARGETS, Case, Cases, Command, judge, lay_out, run_case

pytestmark = pytest.mark.slow

SEED = 21
COUNTS = {"image": 60, "svg": 40, "yaml": 50}


@pytest.mark.parametrize("target", TARGETS)
def test_no_input_breaks_the_command_line(forks: Forks, tmp_path: Path, target: str) -> None:
    cases, codes = Cases(SEED, target), []
    for number in range(COUNTS[target]):
        for outcome, fault in run_case(forks, cases[number], tmp_path / "deep" / "down" / "case"):
            assert not fault
            codes.append(outcome.code)
    if target in ("image", "svg"):
        assert codes.count(0) > len(codes) / 20, "otherwise only the first checks are tested"


COMMAND = Command(("render", "case.svg", "-o", "out.png"), (3,), "out.png")
GOOD = Outcome(3, "", "warpsplat: case.svg: not an SVG\n", 0.1, 1000)


@pytest.mark.parametrize(
    ("change", "stray", "fault"),
    [
        ({}, "", ""),
        ({"code": -11}, "", "signal 11"),
        ({"stderr": "Traceback (most recent call last):\nValueError: x\n"}, "", "ValueError"),
        ({"stderr": "warpsplat: one\nwarpsplat: two\n"}, "", "not one line"),
        ({"seconds": 11.0}, "", "took more"),
        ({"peak": 3 << 30}, "", "2 GiB"),
        ({"code": 0, "stderr": ""}, "", "missing"),
        ({}, "out.png", "there"),
        ({}, ".warpsplat-1", "left"),
    ],
)
def test_the_judge_sees_faults(tmp_path: Path, change: dict[str, object], stray: str, fault: str) -> None:
    lay_out(Case("svg", 0, "", "case.svg", b"", (COMMAND,)), tmp_path)
    if stray:
        (tmp_path / stray).touch()
    found = judge(COMMAND, GOOD._replace(**change), tmp_path)
    assert fault in found and bool(fault) == bool(found)
