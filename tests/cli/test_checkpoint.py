"""``--checkpoint`` and ``--resume`` of the commands."""

from __future__ import annotations

import os
import signal
from pathlib import Path
from typing import Any

import pytest

from tests.cli.helpers import QUICK, Cli, run
from warpsplat.fit.step import Step

pytestmark = pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")

RUN = (*QUICK, "--subject", "photo", "-q", "--checkpoint", "a.checkpoint")


@pytest.fixture(autouse=True)
def here(image: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(image.parent)


@pytest.fixture
def struck(monkeypatch: pytest.MonkeyPatch) -> None:
    """SIGTERM comes in the sixth step."""
    advance, steps = Step.advance, []

    def strike(step: Step) -> None:
        steps.append(step)
        if len(steps) == 6:
            os.kill(os.getpid(), signal.SIGTERM)
        advance(step)

    monkeypatch.setattr(Step, "advance", strike)


@pytest.mark.usefixtures("struck")
@pytest.mark.parametrize("command", ["vectorize", "refine"])
def test_sigterm_leaves_a_checkpoint_and_the_next_run_goes_on(command: str, cli: Cli) -> None:
    given: tuple[Any, ...] = ("vectorize", "photo.png", *RUN)
    if command == "refine":
        assert run("vectorize", "photo.png", "-o", "base.svg", *QUICK, "--iterations", 3) == 0
        given = ("refine", "base.svg", "photo.png", "--iterations", 12, "-q", "--checkpoint", "a.checkpoint")
    assert run(*given, "-o", "a.svg") == 143
    assert Path("a.checkpoint").exists() and Path("a.svg").exists()
    assert "a checkpoint exists; --resume continues from it" in cli(*given, "-o", "a.svg", code=2).line
    assert run(*given, "-o", "a.svg", "--resume") == 0
    assert not Path("a.checkpoint").exists()
    assert run(*given, "-o", "b.svg", "--resume") == 0
    assert Path("a.svg").read_bytes() == Path("b.svg").read_bytes()
