"""What becomes of words that nobody can take."""

from __future__ import annotations

import errno
import os

import click
import pytest

from warpsplat.cli import say as voice
from warpsplat.errors import OutputError


def _failing(number: int) -> None:
    raise OSError(number, os.strerror(number))


@pytest.fixture(autouse=True)
def streams_stay(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(voice, "silence", lambda stream: None)


def test_a_full_stdout_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(click, "echo", lambda *_, **__: _failing(errno.ENOSPC))
    with pytest.raises(OutputError, match=r"^standard output: could not be written: No space left"):
        voice.say("figures")
    voice.say("a notice", err=True)


def test_a_reader_that_has_gone_is_for_the_caller(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(click, "echo", lambda *_, **__: _failing(errno.EPIPE))
    with pytest.raises(BrokenPipeError):
        voice.say("figures")
