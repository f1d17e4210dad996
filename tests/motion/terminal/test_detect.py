"""Which terminal is asked what, and what is made of it."""

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

import pytest

from warpsplat.motion.terminal.detect import CELL, measured, terminal


class Tty(io.StringIO):
    def isatty(self) -> bool:
        return True


def never() -> str:
    raise AssertionError("asked")


BY_ENVIRONMENT = [
    ({"TERM": "xterm-kitty"}, "kitty"),
    ({"TERM": "xterm-256color", "KITTY_WINDOW_ID": "1"}, "kitty"),
    ({"TERM": "xterm-256color", "TERM_PROGRAM": "ghostty"}, "kitty"),
    ({"TERM": "xterm-256color", "TERM_PROGRAM": "iTerm.app"}, "iterm"),
    ({"TERM": "xterm-256color", "TERM_PROGRAM": "WezTerm"}, "iterm"),
    ({"TERM": "xterm-256color", "LC_TERMINAL": "iTerm2"}, "iterm"),
    ({"TERM": "tmux-256color", "TMUX": "/tmp/x", "KITTY_WINDOW_ID": "1"}, "blocks"),
    ({"TERM": "screen", "TERM_PROGRAM": "iTerm.app"}, "blocks"),
]


@pytest.mark.parametrize(("environ", "protocol"), BY_ENVIRONMENT)
def test_by_the_environment(environ: dict[str, str], protocol: str) -> None:
    found = terminal(Tty(), None, environ, never)
    assert found and found.protocol == protocol and found.live


@pytest.mark.parametrize(
    ("answer", "protocol", "cell"),
    [
        ("\x1b[6;30;15t\x1b[?62;4;22c", "sixel", (15, 30)),
        ("\x1b[?4c", "sixel", CELL),
        ("\x1b[?64;1;2;14;41c", "blocks", CELL),
        ("\x1b[?1;2c", "blocks", CELL),
        ("", "blocks", CELL),
    ],
)
def test_by_the_answer(answer: str, protocol: str, cell: tuple[int, int]) -> None:
    found = terminal(Tty(), None, {"TERM": "xterm-256color"}, lambda: answer)
    assert found and (found.protocol, found.cell) == (protocol, cell)


def test_what_is_told_counts() -> None:
    found = terminal(Tty(), "kitty", {"TERM": "screen", "TMUX": "x"}, never)
    assert found and found.protocol == "kitty" and found.tmux
    found = terminal(io.StringIO(), "blocks", {"COLUMNS": "33", "LINES": "11"}, never)
    assert found and (found.columns, found.lines, found.live, found.true_color) == (33, 11, False, True)


def test_nothing_can_show_pictures() -> None:
    assert terminal(io.StringIO(), None, {"TERM": "xterm-kitty"}, never) is None
    assert terminal(Tty(), None, {"TERM": "dumb"}, never) is None


@pytest.mark.parametrize(
    ("environ", "true_color"),
    [
        ({"TERM": "xterm-256color", "COLORTERM": "truecolor"}, True),
        ({"TERM": "xterm-direct"}, True),
        ({"TERM": "xterm-256color", "WT_SESSION": "1"}, True),
        ({"TERM": "xterm-256color"}, False),
    ],
)
def test_colors(environ: dict[str, str], true_color: bool) -> None:
    found = terminal(Tty(), "blocks", environ, never)
    assert found and found.true_color == true_color


def test_the_size_is_that_of_now() -> None:
    primary, secondary = pty.openpty()
    with os.fdopen(secondary, "w") as stream, os.fdopen(primary, "rb"):
        fcntl.ioctl(primary, termios.TIOCSWINSZ, struct.pack("HHHH", 30, 100, 900, 600))
        found = terminal(stream, "sixel", {}, never)
        assert found and (found.columns, found.lines, found.cell) == (100, 30, (9, 20))
        fcntl.ioctl(primary, termios.TIOCSWINSZ, struct.pack("HHHH", 10, 50, 0, 0))
        now = measured(found, stream)
        assert (now.columns, now.lines, now.cell) == (50, 10, (9, 20))


ASKS = """
import os, fcntl, termios
os.setsid()
fcntl.ioctl(0, termios.TIOCSCTTY, 0)
from warpsplat.motion.terminal.detect import attributes
before = termios.tcgetattr(0)
found = attributes()
assert termios.tcgetattr(0) == before, "the terminal is as it was"
print(repr(found), flush=True)
"""


@pytest.mark.slow
@pytest.mark.parametrize("answers", [True, False])
def test_a_terminal_is_asked(answers: bool) -> None:
    primary, secondary = pty.openpty()
    process = subprocess.Popen(
        [sys.executable, "-c", ASKS], stdin=secondary, stdout=subprocess.PIPE, text=True
    )
    os.close(secondary)
    asked = []

    def answer() -> None:
        asked.append(os.read(primary, 100))
        if answers:
            os.write(primary, b"\x1b[6;20;10t\x1b[?62;4")
            os.write(primary, b";22c")

    thread = threading.Thread(target=answer)
    thread.start()
    out, _ = process.communicate(timeout=60)
    thread.join()
    os.close(primary)
    assert asked == [b"\x1b[16t\x1b[c"]
    assert out.strip() == repr("\x1b[6;20;10t\x1b[?62;4;22c" if answers else "")
