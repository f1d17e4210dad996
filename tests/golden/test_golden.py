"""Files are the same on every machine, whatever code NumPy chooses by the processor."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

import warpsplat
from tests import ROOT
from tests.golden.cases import ALL_CASES, CASES, digest_of
from tests.golden.pictures import PICTURES

EXPECTED = json.loads(Path(__file__).with_name("digests.json").read_text(encoding="utf-8"))

LEVELS = {"native": "", "without AVX-512": "X86_V4 AVX512_ICL", "without AVX2": "X86_V3 X86_V4 AVX512_ICL"}
"""Features that NumPy must not use; it reads this when it is imported."""


def environment_of(level: str) -> dict[str, str]:
    return {**os.environ, "NPY_DISABLE_CPU_FEATURES": LEVELS[level], "PYTHONPATH": str(ROOT)}


@pytest.mark.parametrize("level", LEVELS)
def test_the_same_files_at_every_level_of_numpy(level: str) -> None:
    # Where the processor lacks what is switched off, NumPy warns.
    cases = [*CASES][::3] if level == "without AVX-512" else [*CASES]  # the levels around it make all
    command = [sys.executable, "-W", "ignore", "-m", "tests.golden", *cases]
    made = subprocess.run(
        command, cwd=ROOT, env=environment_of(level), capture_output=True, text=True, check=True
    )
    digests = {name: digest for line in made.stdout.splitlines() for name, digest in json.loads(line).items()}
    assert digests == {name: EXPECTED[name] for name in cases}


def test_every_case_is_expected() -> None:
    assert set(EXPECTED) == set(ALL_CASES)


STOPPED = """
import sys, warpsplat
from tests.golden.cases import CASES
from tests.golden.pictures import PICTURES
picture, given = CASES["photo closed"]
steps = iter(range(given["iterations"] // 2))
warpsplat.vectorize(
    PICTURES[picture](), device="cpu", checkpoint=sys.argv[1], stop=lambda: next(steps, None) is None, **given
)
"""
"""A program that stops half-way and keeps a checkpoint."""


def test_a_checkpoint_of_another_processor_ends_in_the_same_file(tmp_path: Path) -> None:
    checkpoint = tmp_path / "run.checkpoint"
    command = [sys.executable, "-W", "ignore", "-c", STOPPED, str(checkpoint)]
    subprocess.run(command, cwd=ROOT, env=environment_of("without AVX2"), check=True)
    picture, given = CASES["photo closed"]
    result = warpsplat.vectorize(
        PICTURES[picture](), device="cpu", checkpoint=checkpoint, resume=True, **given
    )
    assert digest_of(result.svg) == EXPECTED["photo closed"]
