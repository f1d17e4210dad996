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

import pytest

from warpsplat.motion.terminal import BLOCK_CELL, DEFAULT_CELL, detect


class Tty(io.StringIO):
    def isatty(self) -> bool:
        return True


def never() -> str:
    raise AssertionError("asked")


@pytest.mark.parametrize(
    ("environ", "protocol"),
    [
        ({"TERM": "xterm-kitty"}, "kitty"),
        ({"KITTY_WINDOW_ID": "1"}, "kitty"),
        ({"TERM_PROGRAM": "ghostty"}, "kitty"),
        ({"TERM_PROGRAM": "iTerm.app"}, "iterm"),
        ({"TERM_PROGRAM": "WezTerm"}, "iterm"),
        ({"LC_TERMINAL": "iTerm2"}, "iterm"),
        ({"TERM": "tmux-256color", "TMUX": "/tmp/x", "KITTY_WINDOW_ID": "1"}, "blocks"),
        ({"TERM": "screen", "TERM_PROGRAM": "iTerm.app"}, "blocks"),
    ],
)
def test_protocol_by_environment(environ: dict[str, str], protocol: str) -> None:
    found = detect(Tty(), None, {"TERM": "xterm-256color"} | environ, never)
    assert found and found.protocol == protocol and found.live and found.tmux == ("TMUX" in environ)


@pytest.mark.parametrize(
    ("answer", "protocol", "cell"),
    [
        ("\x1b[6;30;15t\x1b[?62;4;22c", "sixel", (15, 30)),
        ("\x1b[?4c", "sixel", DEFAULT_CELL),
        ("\x1b[6;30;15t\x1b[?64;1;2;14;41c", "blocks", BLOCK_CELL),
        ("", "blocks", BLOCK_CELL),
    ],
)
def test_protocol_by_answer(answer: str, protocol: str, cell: tuple[int, int]) -> None:
    found = detect(Tty(), None, {"TERM": "xterm-256color"}, lambda: answer)
    assert found and (found.protocol, found.cell) == (protocol, cell)


def test_a_given_protocol_needs_no_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "33")
    monkeypatch.setenv("LINES", "11")
    found = detect(io.StringIO(), "blocks", {"TERM": "screen"}, never)
    assert found and (found.columns, found.lines, found.live, found.true_color) == (33, 11, False, True)
    assert detect(io.StringIO(), None, {"TERM": "xterm-kitty"}, never) is None
    assert detect(Tty(), None, {"TERM": "dumb"}, never) is None


@pytest.mark.parametrize(
    ("environ", "true_color"),
    [
        ({"COLORTERM": "truecolor"}, True),
        ({"TERM": "xterm-direct"}, True),
        ({"WT_SESSION": "1"}, True),
        ({}, False),
    ],
)
def test_colors(environ: dict[str, str], true_color: bool) -> None:
    found = detect(Tty(), "blocks", {"TERM": "xterm-256color"} | environ, never)
    assert found and found.true_color == true_color


def test_current_size() -> None:
    primary, secondary = pty.openpty()
    with os.fdopen(secondary, "w") as stream, os.fdopen(primary, "rb"):
        fcntl.ioctl(primary, termios.TIOCSWINSZ, struct.pack("HHHH", 30, 100, 900, 600))
        found = detect(stream, "sixel", {}, never)
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
