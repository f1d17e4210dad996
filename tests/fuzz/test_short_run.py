"""A run of the fuzzer, and proof that it sees faults."""

from __future__ import annotations

import itertools
import os
from pathlib import Path

import pytest

from tests.forks import Forks, Outcome
from tests.fuzz.cases import TARGETS, Case, Command, cases_of, judge, lay_out, run_case

pytestmark = pytest.mark.slow

SEED = os.environ.get("FUZZ_SEED", "21")
COUNTS = {
    target: int(os.environ.get("FUZZ", count)) for target, count in (("image", 60), ("svg", 40), ("yaml", 50))
}
"""Cases of each kind; ``FUZZ``: of a longer run."""


@pytest.mark.parametrize("target", TARGETS)
def test_no_input_breaks_the_command_line(forks: Forks, tmp_path: Path, target: str) -> None:
    """The first 20 faults are shown; the input of each is kept beside its number."""
    codes, faults = list[int](), list[str]()
    for case in itertools.islice(cases_of(target, SEED), COUNTS[target]):
        for outcome, fault in run_case(forks, case, tmp_path / "deep" / "down" / "case"):
            codes.append(outcome.code)
            if fault:
                faults.append(fault)
                (tmp_path / f"{case.index}-{case.name}").write_bytes(case.data)
        if len(faults) >= 20:
            break
    assert not faults, "\n".join(map(ascii, faults))
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
