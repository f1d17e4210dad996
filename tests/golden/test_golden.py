"""Files are the same on every machine, whatever code libraries choose by the processor."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

import warpsplat
from tests import ROOT
from tests.golden.cases import ALL_CASES, CASES, digest_of
from tests.golden.pictures import PICTURES
from tests.golden.processors import SETTINGS, environment_of

EXPECTED = json.loads(Path(__file__).with_name("digests.json").read_text(encoding="utf-8"))


@pytest.mark.parametrize("processor", SETTINGS)
def test_the_same_files_as_on_other_processors(processor: str) -> None:
    # Where the processor lacks what is switched off, NumPy warns.
    cases = [*CASES][::3] if processor == "without AVX-512" else [*CASES]  # the others make all
    command = [sys.executable, "-W", "ignore", "-m", "tests.golden", *cases]
    environment = environment_of(processor)
    made = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, check=True)
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
    subprocess.run(command, cwd=ROOT, env=environment_of("old processor"), check=True)
    picture, given = CASES["photo closed"]
    result = warpsplat.vectorize(
        PICTURES[picture](), device="cpu", checkpoint=checkpoint, resume=True, **given
    )
    assert digest_of(result.svg) == EXPECTED["photo closed"]
