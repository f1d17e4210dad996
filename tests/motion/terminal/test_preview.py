"""A run on a terminal: a small one that knows the sequences that are used."""

from __future__ import annotations

import io
import re
from dataclasses import replace

import numpy as np
import pytest

from tests.scenes import mixed_scene
from warpsplat.fit.progress import Progress, Snapshot
from warpsplat.motion.terminal.detect import Terminal
from warpsplat.motion.terminal.preview import SHARE, Preview
from warpsplat.scene import FloatArray

COLUMNS, LINES = 60, 12
RED, BLUE, GREEN = (255, 0, 0), (0, 0, 255), (0, 255, 0)


class Screen(io.StringIO):
    """Characters with their colours, a cursor, and lines that have scrolled away."""

    def __init__(self) -> None:
        super().__init__()
        self.cells: list[dict[int, tuple[str, str]]] = [{} for _ in range(LINES)]
        self.row = self.column = 0
        self.saved = (0, 0)
        self.style = ""
        self.gone: list[dict[int, tuple[str, str]]] = []

    def write(self, text: str) -> int:
        for escape, character in re.findall(r"(\x1b\[[\d;?]*[A-Za-z]|\x1b[78])|([\s\S])", text):
            if escape:
                self._do(escape)
            elif character == "\n":
                self._next_line()
            elif character == "\r":
                self.column = 0
            else:
                assert self.column < COLUMNS, "a line that is too long"
                self.cells[self.row][self.column] = (character, self.style)
                self.column += 1
        return len(text)

    def _next_line(self) -> None:
        self.column = 0  # as terminals' line discipline has it
        self.row += 1
        if self.row == LINES:
            self.gone.append(self.cells.pop(0))
            self.cells.append({})
            self.row -= 1

    def _do(self, escape: str) -> None:
        number = int(re.sub(r"\D", "", escape) or 1)
        if escape == "\x1b7":
            self.saved = (self.row, self.column)
        elif escape == "\x1b8":
            self.row, self.column = self.saved
        elif escape[-1] == "A":
            assert self.row >= number, "above the screen"
            self.row -= number
        elif escape[-1] == "B":
            self.row = min(self.row + number, LINES - 1)
        elif escape == "\x1b[2K":
            self.cells[self.row] = {}
        else:
            assert escape[-1] == "m", escape
            self.style = "" if escape == "\x1b[0m" else escape

    def text(self, row: int) -> str:
        return "".join(self.cells[row].get(x, (" ", ""))[0] for x in range(COLUMNS)).rstrip()

    def pictures(self) -> list[str]:
        """Of each line that has a picture in it, the colours of its beginning."""
        return [line[0][1] for line in self.gone + self.cells if line.get(0, ("", ""))[0] == "▀"]


class Clock:
    def __init__(self) -> None:
        self.now = 100.0

    def __call__(self) -> float:
        return self.now


def flat(color: tuple[int, int, int]) -> FloatArray:
    return np.full((12, 18, 3), np.array(color) / 255, np.float32)


def report(image: FloatArray) -> Progress:
    return Progress(1, 2, 20.0, 0.0, 0.5, True, 3, Snapshot(mixed_scene, lambda: image))


@pytest.fixture
def screen() -> Screen:
    return Screen()


def preview(screen: io.StringIO, clock: Clock, **others: object) -> tuple[Preview, list[Terminal]]:
    """With the terminals that it sees: the last one is the one of now."""
    terminals = [replace(Terminal("blocks", COLUMNS, LINES), **others)]
    return Preview(screen, lambda: terminals[-1], clock), terminals


def test_a_picture_is_drawn_over_the_last_one_above_the_bar(screen: Screen) -> None:
    clock = Clock()
    shown, _ = preview(screen, clock)
    screen.write("before\n")
    for color in (RED, BLUE):
        shown.report(report(flat(color)))
        screen.write(f"\rbar {color[0]:3}")
        clock.now += 10
    rows = [row for row in range(LINES) if screen.text(row).startswith("▀")]
    assert len(rows) == LINES - 4 and rows == list(range(rows[0], rows[-1] + 1))
    assert screen.text(rows[0] - 1) == "before" and screen.text(rows[-1] + 1) == "bar   0"
    assert len(screen.pictures()) == len(rows) and all("0;0;255" in style for style in screen.pictures())
    assert not screen.style, "colours do not go on"


def test_the_finished_picture_takes_its_place_beside_the_source(screen: Screen) -> None:
    clock = Clock()
    shown, _ = preview(screen, clock)
    shown.report(report(flat(RED)))
    screen.write("\rbar")
    shown.finish(flat(GREEN), flat(BLUE))
    screen.write(" done\n")
    assert len(screen.pictures()) == LINES - 4 and "0;0;255" in screen.pictures()[0]
    row = screen.cells[0]
    assert screen.text(0).startswith("▀" * 24) and "0;255;0" in row[24 + 1 + 3][1]
    assert screen.text(LINES - 4) == "bar done"


def test_lines_below_the_picture_stay(screen: Screen) -> None:
    shown, _ = preview(screen, clock := Clock())
    shown.report(report(flat(RED)))
    screen.write("\rnotice\n")
    shown.move_on()
    clock.now += 10
    shown.report(report(flat(BLUE)))
    everything = screen.gone + screen.cells
    texts = ["".join(line.get(x, (" ", ""))[0] for x in range(COLUMNS)).rstrip() for line in everything]
    assert texts[LINES - 4] == "notice" and texts[LINES - 3][0] == "▀"


def test_a_terminal_of_another_size_gets_a_new_picture(screen: Screen) -> None:
    shown, terminals = preview(screen, clock := Clock())
    shown.report(report(flat(RED)))
    clock.now += 10
    terminals.append(Terminal("blocks", 20, 10))
    shown.report(report(flat(BLUE)))
    assert sum("255;0;0" in style for style in screen.pictures()) == LINES - 4
    assert sum("0;0;255" in style for style in screen.pictures()) == 10 - 4
    terminals.append(Terminal("blocks", 5, 2))
    clock.now += 10
    before = screen.pictures()
    shown.report(report(flat(GREEN)))
    assert screen.pictures() == before, "one that is too small gets none"


def test_drawing_takes_a_small_part_of_the_time() -> None:
    """The next one waits by what the last one took; less after one that was held up, and after the first."""
    clock, drawn = Clock(), []
    shown, _ = preview(io.StringIO(), clock)
    costs = iter([2.0, 0.1, 0.1, 5.0, *[0.1] * 1000])

    def slow() -> FloatArray:
        clock.now += next(costs)
        drawn.append(clock.now)
        return flat(RED)

    began = clock.now
    now = replace(report(flat(RED)), snapshot=Snapshot(mixed_scene, slow))
    while clock.now < began + 200:
        shown.report(now)
        clock.now += 0.01
    gaps = np.diff(drawn)
    assert gaps[0] < 1.2 and gaps[1] == pytest.approx(0.1 / SHARE, abs=0.05)
    assert gaps[3] == pytest.approx(0.1 / SHARE, abs=0.05), "after the one that was held up"
    assert 90 < len(drawn) < 110


def test_a_pipe_gets_the_finished_picture_only() -> None:
    out = io.StringIO()
    shown, _ = preview(out, Clock(), live=False)
    shown.report(report(flat(RED)))
    assert not out.getvalue()
    shown.finish(flat(RED), None)
    lines = out.getvalue().split("\n")
    assert len(lines) == LINES - 4 + 1 and not lines[-1]
    assert not re.search(r"\x1b(?!\[[\d;]*m)|\r", out.getvalue()), "colours, and nothing that moves"


@pytest.mark.parametrize("protocol", ["kitty", "iterm", "sixel"])
def test_pictures_of_pixels_go_to_the_same_place(protocol: str) -> None:
    out = io.StringIO()
    shown, _ = preview(out, clock := Clock(), protocol=protocol)
    for color in (RED, BLUE):
        shown.report(report(flat(color)))
        clock.now += 10
    first, second = (part for part in out.getvalue().split("\x1b7") if "\x1b8" in part)
    rows = LINES - 4
    assert out.getvalue().startswith("\r\x1b[2K" + rows * "\n" + "\x1b7")
    assert first.startswith(f"\r\x1b[{rows}A\x1b") and second.startswith(f"\r\x1b[{rows}A\x1b")
    assert first.endswith("\x1b\\\x1b8" if protocol != "iterm" else "\x07\x1b8")
    if protocol == "kitty":
        names = re.findall(r"i=(\d+)", out.getvalue())
        assert len(names) == 2 and len(set(names)) == 1, "which replaces the picture"


def test_a_stream_that_is_closed_is_no_reason_to_fail() -> None:
    out = io.StringIO()
    shown, _ = preview(out, Clock())
    out.close()
    shown.report(report(flat(RED)))
