"""Pictures in terminals: previews on a small emulated one, and their escape sequences."""

from __future__ import annotations

import base64
import io
import os
import re
import shutil
import struct

import numpy as np
import pytest
from PIL import Image

from tests.scenes import mixed_scene
from warpsplat.fit.progress import Progress, Snapshot
from warpsplat.motion import preview
from warpsplat.motion.escapes import half_blocks, iterm, kitty
from warpsplat.motion.preview import (
    Preview,
    Protocol,
    best_protocol,
    has_true_color,
    terminal_size,
)
from warpsplat.scene import FloatArray

COLUMNS, LINES = 60, 12
ROWS = LINES - 4
RED, BLUE, GREEN = (255, 0, 0), (0, 0, 255), (0, 255, 0)


class Tty(io.StringIO):
    def isatty(self) -> bool:
        return True


class Screen(Tty):
    """Rows of characters with their colours, of which the last ``LINES`` are visible; and a cursor."""

    def __init__(self) -> None:
        super().__init__()
        self.cells: list[dict[int, tuple[str, str]]] = [{} for _ in range(LINES)]
        self.row = self.column = 0
        self.saved = (0, 0)
        self.style = ""

    def write(self, text: str) -> int:
        for escape, character in re.findall(r"(\x1b\[[\d;?]*[A-Za-z]|\x1b[78])|([\s\S])", text):
            if escape:
                self._do(escape)
            elif character == "\n":
                self.row, self.column = self.row + 1, 0  # as terminals' line discipline has it
                self.cells += [{}] * (self.row == len(self.cells))
            elif character == "\r":
                self.column = 0
            else:
                assert self.column < COLUMNS, "a line that is too long"
                self.cells[self.row] = self.cells[self.row] | {self.column: (character, self.style)}
                self.column += 1
        return len(text)

    def _do(self, escape: str) -> None:
        number = int(re.sub(r"\D", "", escape) or 1)
        if escape == "\x1b7":
            self.saved = (self.row, self.column)
        elif escape == "\x1b8":
            self.row, self.column = self.saved
        elif escape[-1] == "A":
            self.row -= number
            assert self.row >= len(self.cells) - LINES, "above the screen"
        elif escape[-1] == "B":
            self.row = min(self.row + number, len(self.cells) - 1)
        elif escape == "\x1b[2K":
            self.cells[self.row] = {}
        else:
            assert escape[-1] == "m", escape
            self.style = "" if escape == "\x1b[0m" else escape

    def text(self, row: int) -> str:
        """Return the characters of a row, counted from the first one ever."""
        return "".join(self.cells[row].get(x, (" ", ""))[0] for x in range(COLUMNS)).rstrip()

    def pictures(self) -> list[str]:
        """Return the colours at the beginning of each row of a picture."""
        return [line[0][1] for line in self.cells if line.get(0, ("", ""))[0] == "▀"]


def flat(color: tuple[int, int, int]) -> FloatArray:
    return np.full((12, 18, 3), np.array(color) / 255, np.float32)


class Shown:
    """A preview on ``screen`` with a clock that tests set."""

    def __init__(self, screen: io.StringIO, protocol: Protocol = "blocks") -> None:
        self.now = 100.0
        self.preview = Preview(screen, protocol, lambda: self.now)

    def update(self, color: tuple[int, int, int], seconds: float = 10.0, draws: float = 0.0) -> None:
        """Update; then ``seconds`` pass, and ``draws`` within."""

        def image() -> FloatArray:
            self.now += draws
            return flat(color)

        self.preview.update(Progress(1, 2, 20.0, 0.0, 0.5, True, 3, Snapshot(mixed_scene, image)))
        self.now += seconds


@pytest.fixture(autouse=True)
def size(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """The size of terminals, which tests set."""
    now = [COLUMNS, LINES]
    monkeypatch.setattr(preview, "terminal_size", lambda stream: os.terminal_size(now))
    monkeypatch.setenv("COLORTERM", "truecolor")
    return now


@pytest.fixture
def screen() -> Screen:
    return Screen()


def test_pictures_replace_each_other_above_the_bar(screen: Screen) -> None:
    """The finished one stands beside its source."""
    shown = Shown(screen)
    screen.write("before\n")
    for color in (RED, BLUE):
        shown.update(color)
        screen.write(f"\rbar {color[0]:3}")
    assert [screen.text(row)[:1] for row in range(1, 1 + ROWS)] == ["▀"] * ROWS
    assert screen.text(0) == "before" and screen.text(1 + ROWS) == "bar   0"
    assert len(screen.pictures()) == ROWS and all("0;0;255" in style for style in screen.pictures())
    assert not screen.style, "colours end with the line"
    shown.preview.finish(flat(GREEN), flat(BLUE))
    screen.write(" done\n")
    assert len(screen.pictures()) == ROWS and "0;0;255" in screen.pictures()[0]
    assert screen.text(1).startswith("▀" * 24) and screen.text(1 + ROWS) == "bar   0 done"
    assert "0;255;0" in screen.cells[1][24 + 1 + 3][1]


def test_lines_below_the_picture_stay(screen: Screen) -> None:
    shown = Shown(screen)
    shown.update(RED)
    screen.write("\rnotice\n")
    shown.preview.move_on()
    shown.update(BLUE)
    assert screen.text(ROWS) == "notice" and screen.text(ROWS + 1)[0] == "▀"


def test_a_pipe_gets_the_finished_picture_only() -> None:
    out = io.StringIO()
    shown = Shown(out)
    shown.update(RED)
    assert not out.getvalue()
    shown.preview.finish(flat(RED), None)
    lines = out.getvalue().split("\n")
    assert len(lines) == ROWS + 1 and not lines[-1]
    assert not re.search(r"\x1b(?!\[[\d;]*m)|\r", out.getvalue()), "colours, but no cursor movements"
    out.close()
    shown.preview.finish(flat(RED), None)  # a closed stream is ignored


@pytest.mark.parametrize(("protocol", "end"), [("kitty", "\x1b\\"), ("iterm", "\x07")])
def test_pixel_protocols_draw_in_the_same_place(protocol: Protocol, end: str) -> None:
    out = Tty()
    shown = Shown(out, protocol)
    shown.update(RED)
    shown.update(BLUE)
    begin, *pictures = out.getvalue().split("\x1b7")
    assert begin == "\r\x1b[2K" + ROWS * "\n" and len(pictures) == 2
    for picture in pictures:
        assert picture.startswith(f"\r\x1b[{ROWS}A\x1b") and picture.endswith(f"{end}\x1b8")
    if protocol == "kitty":
        numbers = re.findall(r"i=(\d+)", out.getvalue())
        assert len(numbers) == 2 and len(set(numbers)) == 1, "so the second replaces the first"


@pytest.mark.parametrize(
    ("environ", "protocol", "true_color"),
    [
        ({"TERM": "xterm-kitty"}, "kitty", False),
        ({"KITTY_WINDOW_ID": "1"}, "kitty", False),
        ({"TERM_PROGRAM": "ghostty", "COLORTERM": "24bit"}, "kitty", True),
        ({"TERM_PROGRAM": "iTerm.app"}, "iterm", False),
        ({"LC_TERMINAL": "iTerm2"}, "iterm", False),
        ({"TERM": "tmux-256color", "TMUX": "/tmp/x", "KITTY_WINDOW_ID": "1"}, "blocks", False),
        ({"TERM": "screen", "TERM_PROGRAM": "iTerm.app"}, "blocks", False),
        ({"TERM": "xterm-direct"}, "blocks", True),
        ({"WT_SESSION": "1"}, "blocks", True),
        ({}, "blocks", False),
    ],
)
def test_abilities_by_environment(
    environ: dict[str, str], protocol: str, true_color: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(os, "environ", {"TERM": "xterm-256color"} | environ)
    assert (best_protocol(), has_true_color()) == (protocol, true_color)


def test_current_size() -> None:
    """That of the stream's own terminal; without one, that of the process's."""
    fcntl, pty, termios = (pytest.importorskip(name) for name in ("fcntl", "pty", "termios"))
    primary, secondary = pty.openpty()
    with os.fdopen(secondary, "w") as stream, os.fdopen(primary, "rb"):
        for lines, columns in ((30, 100), (10, 50)):
            fcntl.ioctl(primary, termios.TIOCSWINSZ, struct.pack("HHHH", lines, columns, 0, 0))
            assert terminal_size(stream) == (columns, lines)
    assert terminal_size(io.StringIO()) == shutil.get_terminal_size()


def picture(width: int, height: int) -> np.ndarray:
    """Random colours of those that all terminals have."""
    steps = np.array([0, 95, 135, 175, 215, 255], np.uint8)
    return steps[np.random.default_rng(1).integers(0, 6, (height, width, 3))]


@pytest.mark.parametrize("true_color", [True, False])
def test_half_blocks(true_color: bool) -> None:
    """The upper half of each has the colour of the text, the lower one that of the ground."""
    image, steps = picture(30, 2), [0, 95, 135, 175, 215, 255]
    (line,) = half_blocks(image, true_color=true_color)
    assert line.count("▀") == 30 and line.endswith("▀\x1b[0m")
    if true_color:
        found = [[*map(int, color.split(";"))] for color in re.findall(r"[34]8;2;(\d+;\d+;\d+)", line)]
    else:
        codes = [int(code) - 16 for code in re.findall(r"[34]8;5;(\d+)", line)]
        found = [[steps[code // place % 6] for place in (36, 6, 1)] for code in codes]
    assert np.array_equal(found, image.transpose(1, 0, 2).reshape(-1, 3))
    uniform = np.full((2, 50, 3), 200, np.uint8)
    assert len(half_blocks(uniform, true_color=true_color)[0]) < 100, "a style only where it changes"


def test_kitty() -> None:
    image = np.random.default_rng(0).integers(0, 256, (60, 50, 3)).astype(np.uint8)
    text = kitty(image, 10, 4, 7)
    found = re.findall(r"\x1b_G([^;]*);([^\x1b]*)\x1b\\", text)
    assert len(found) > 2 and "".join(f"\x1b_G{keys};{data}\x1b\\" for keys, data in found) == text
    assert found[0][0] == "a=T,f=100,i=7,p=1,c=10,r=4,C=1,q=2,m=1"
    assert [keys for keys, _ in found[1:]] == ["m=1"] * (len(found) - 2) + ["m=0"]
    assert all(len(data) == 4096 for _, data in found[:-1]) and len(found[-1][1]) <= 4096
    packed = base64.b64decode("".join(data for _, data in found), validate=True)
    assert np.array_equal(np.asarray(Image.open(io.BytesIO(packed))), image)


def test_iterm() -> None:
    image = picture(20, 10)
    text = iterm(image, 4, 1)
    found = re.fullmatch(r"\x1b\]1337;File=inline=1;size=(\d+);width=4;height=1;[^:]*:([^\x07]*)\x07", text)
    assert found
    packed = base64.b64decode(found[2], validate=True)
    assert len(packed) == int(found[1])
    assert np.array_equal(np.asarray(Image.open(io.BytesIO(packed))), image)
