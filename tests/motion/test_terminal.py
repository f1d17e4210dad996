"""Detection of what a terminal can show."""

from __future__ import annotations

import fcntl
import io
import os
import pty
import struct
import subprocess
import sys
import termios
import threading
from collections.abc import Callable

import pytest

from warpsplat.motion.terminal import BLOCK_CELL, DEFAULT_CELL, Protocol, Terminal, detect

Detect = Callable[..., Terminal | None]


class Tty(io.StringIO):
    def isatty(self) -> bool:
        return True


def never() -> str:
    raise AssertionError("asked")


@pytest.fixture
def found(monkeypatch: pytest.MonkeyPatch) -> Detect:
    """``detect`` with these environment variables, by default on a terminal that must not be asked."""

    def detected(
        environ: dict[str, str],
        protocol: Protocol | None = None,
        stream: io.StringIO | None = None,
        ask: Callable[[], str] = never,
    ) -> Terminal | None:
        monkeypatch.setattr(os, "environ", {"TERM": "xterm-256color"} | environ)
        return detect(stream or Tty(), protocol, ask)

    return detected


@pytest.mark.parametrize(
    ("environ", "protocol"),
    [
        ({"TERM": "xterm-kitty"}, "kitty"),
        ({"KITTY_WINDOW_ID": "1"}, "kitty"),
        ({"TERM_PROGRAM": "ghostty"}, "kitty"),
        ({"TERM_PROGRAM": "iTerm.app"}, "iterm"),
        ({"LC_TERMINAL": "iTerm2"}, "iterm"),
        ({"TERM": "tmux-256color", "TMUX": "/tmp/x", "KITTY_WINDOW_ID": "1"}, "blocks"),
        ({"TERM": "screen", "TERM_PROGRAM": "iTerm.app"}, "blocks"),
    ],
)
def test_protocol_by_environment(environ: dict[str, str], protocol: str, found: Detect) -> None:
    terminal = found(environ)
    assert terminal and terminal.protocol == protocol and terminal.live
    assert terminal.tmux == ("TMUX" in environ)


@pytest.mark.parametrize(
    ("answer", "protocol", "cell"),
    [
        ("\x1b[6;30;15t\x1b[?62;4;22c", "sixel", (15, 30)),
        ("\x1b[?4c", "sixel", DEFAULT_CELL),
        ("\x1b[6;30;15t\x1b[?64;1;2;14;41c", "blocks", BLOCK_CELL),
        ("", "blocks", BLOCK_CELL),
    ],
)
def test_protocol_by_answer(answer: str, protocol: str, cell: tuple[int, int], found: Detect) -> None:
    terminal = found({}, ask=lambda: answer)
    assert terminal and (terminal.protocol, terminal.cell) == (protocol, cell)


def test_a_given_protocol_needs_no_terminal(found: Detect) -> None:
    terminal = found({"COLUMNS": "33", "LINES": "11", "TERM": "screen"}, "blocks", io.StringIO())
    assert terminal and (terminal.columns, terminal.lines) == (33, 11)
    assert (terminal.live, terminal.true_color) == (False, True)
    assert found({"TERM": "xterm-kitty"}, stream=io.StringIO()) is None
    assert found({"TERM": "dumb"}) is None


@pytest.mark.parametrize(
    "environ", [{"COLORTERM": "truecolor"}, {"TERM": "xterm-direct"}, {"WT_SESSION": "1"}, {}]
)
def test_colors(environ: dict[str, str], found: Detect) -> None:
    terminal = found(environ, "blocks")
    assert terminal and terminal.true_color == bool(environ)


def test_current_size() -> None:
    primary, secondary = pty.openpty()
    with os.fdopen(secondary, "w") as stream, os.fdopen(primary, "rb"):
        fcntl.ioctl(primary, termios.TIOCSWINSZ, struct.pack("HHHH", 30, 100, 900, 600))
        found = detect(stream, "sixel", never)
        assert found and (found.columns, found.lines, found.cell) == (100, 30, (9, 20))
        fcntl.ioctl(primary, termios.TIOCSWINSZ, struct.pack("HHHH", 10, 50, 0, 0))
        now = found.remeasured(stream)
        assert (now.columns, now.lines, now.cell) == (50, 10, (9, 20))


ASKS = """
import os, fcntl, termios
os.setsid()
fcntl.ioctl(0, termios.TIOCSCTTY, 0)
from warpsplat.motion.terminal import answer_of_terminal
before = termios.tcgetattr(0)
found = answer_of_terminal()
assert termios.tcgetattr(0) == before, "the terminal is as it was"
print(repr(found), flush=True)
"""


@pytest.mark.slow
@pytest.mark.parametrize("answers", [True, False])
def test_asking_a_terminal(answers: bool) -> None:
    primary, secondary = pty.openpty()
    process = subprocess.Popen(
        [sys.executable, "-c", ASKS], stdin=secondary, stdout=subprocess.PIPE, text=True
    )
    os.close(secondary)
    asked = []

    def answer() -> None:
        asked.append(os.read(primary, 100))
        for part in (b"\x1b[6;20;10t\x1b[?62;4", b";22c") * answers:
            os.write(primary, part)

    thread = threading.Thread(target=answer)
    thread.start()
    out, _ = process.communicate(timeout=60)
    thread.join()
    os.close(primary)
    assert asked == [b"\x1b[16t\x1b[c"]
    assert out.strip() == repr("\x1b[6;20;10t\x1b[?62;4;22c" if answers else "")
