"""The test device finds what breaks a rule of CUDA, and nothing else."""

from __future__ import annotations

import json
import signal

import pytest

from tests import fake_cuda
from tests.fake_cuda.controls import CONTROLS


@pytest.fixture(scope="module")
def found() -> dict[str, list[str]]:
    done = fake_cuda.run("-m", "tests.fake_cuda.controls", check=False)
    assert done.returncode == 0, done.stderr
    answer: dict[str, list[str]] = json.loads(done.stdout)
    return answer


@pytest.mark.parametrize("name", CONTROLS)
def test_what_is_wrong_is_found(found: dict[str, list[str]], name: str) -> None:
    assert found[f"{name}, wrong"]


@pytest.mark.parametrize("name", CONTROLS)
def test_what_is_right_is_let_pass(found: dict[str, list[str]], name: str) -> None:
    assert not found[f"{name}, right"]


def test_a_host_cannot_read_device_memory() -> None:
    done = fake_cuda.run("-m", "tests.fake_cuda.controls", "host", check=False)
    assert done.returncode == -signal.SIGSEGV
    assert "host_reads_device_memory" in done.stderr


def test_rules_that_were_broken_fail_the_run() -> None:
    program = "from tests.fake_cuda.rules import report; report('a rule')"
    with pytest.raises(AssertionError, match="a rule"):
        fake_cuda.run("-c", program)
