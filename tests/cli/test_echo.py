"""Messages to streams that are full, closed or no terminal."""

from __future__ import annotations

import errno
import logging
import os

import click
import pytest

from warpsplat.cli import echo as echo_module
from warpsplat.cli.echo import _Notices
from warpsplat.errors import OutputError
from warpsplat.native import messages_hidden


def _failing(number: int) -> None:
    raise OSError(number, os.strerror(number))


@pytest.fixture(autouse=True)
def streams_stay(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(echo_module, "silence", lambda stream: None)


def test_a_full_stdout_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(click, "echo", lambda *_, **__: _failing(errno.ENOSPC))
    with pytest.raises(OutputError, match=r"^standard output: could not be written: No space left"):
        echo_module.echo("figures")
    echo_module.echo("a notice", err=True)


def test_a_reader_that_has_gone_is_for_the_caller(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(click, "echo", lambda *_, **__: _failing(errno.EPIPE))
    with pytest.raises(BrokenPipeError):
        echo_module.echo("figures")


class Passing(logging.LogRecord):
    """A message for the meantime, which the next one replaces."""

    def __init__(self, text: str) -> None:
        super().__init__("warpsplat", logging.INFO, "", 0, text, (), None)
        self.passing = True


def test_temporary_messages_are_for_terminals(capfd: pytest.CaptureFixture[str]) -> None:
    """Native code's messages are hidden meanwhile."""
    for terminal, said in ((False, ""), (True, "\r\x1b[2Kwarpsplat: compiling: 3 s\r\x1b[2K")):
        handler = _Notices(terminal=terminal)
        with messages_hidden():
            handler.emit(Passing("compiling: 3 s"))
            handler.emit(Passing(""))
        assert capfd.readouterr().err == said
