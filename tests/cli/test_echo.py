"""Messages on standard error."""

from __future__ import annotations

import logging

import pytest

from warpsplat.cli.echo import notices
from warpsplat.native import messages_hidden


@pytest.mark.parametrize(
    ("terminal", "shown"), [(False, ""), (True, "\r\x1b[2Kwarpsplat: compiling: 3 s\r\x1b[2K")]
)
def test_temporary_messages_are_for_terminals(
    terminal: bool, shown: str, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Native code's messages are hidden meanwhile."""
    monkeypatch.setattr("sys.stderr.isatty", lambda: terminal)
    with notices(), messages_hidden():
        for text in ("compiling: 3 s", ""):
            logging.getLogger("warpsplat").info(text, extra={"passing": True})
    assert capfd.readouterr().err == shown
