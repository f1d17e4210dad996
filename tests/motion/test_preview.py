"""Live previews on a small emulated terminal."""

from __future__ import annotations

import io
import re
from dataclasses import replace

import numpy as np
import pytest

from tests.scenes import mixed_scene
from warpsplat.fit.progress import Progress, Snapshot
from warpsplat.motion.preview import TIME_SHARE, Preview, picture_size, resized
from warpsplat.motion.terminal import BLOCK_CELL, Protocol, Terminal
from warpsplat.scene import FloatArray

COLUMNS, LINES = 60, 12
RED, BLUE, GREEN = (255, 0, 0), (0, 0, 255), (0, 255, 0)


class Screen(io.StringIO):
    """Characters with colours, a cursor, and the lines that have scrolled away."""

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
        """The characters of a row, counted from the first one ever."""
        line = (self.gone + self.cells)[row]
        return "".join(line.get(x, (" ", ""))[0] for x in range(COLUMNS)).rstrip()

    def pictures(self) -> list[str]:
        """The colours at the beginning of each row of a picture."""
        return [line[0][1] for line in self.gone + self.cells if line.get(0, ("", ""))[0] == "▀"]


class Clock:
    def __init__(self) -> None:
        self.now = 100.0

    def __call__(self) -> float:
        return self.now


def flat(color: tuple[int, int, int]) -> FloatArray:
    return np.full((12, 18, 3), np.array(color) / 255, np.float32)


def progress(image: FloatArray) -> Progress:
    return Progress(1, 2, 20.0, 0.0, 0.5, True, 3, Snapshot(mixed_scene, lambda: image))


@pytest.fixture
def screen() -> Screen:
    return Screen()


def preview(screen: io.StringIO, clock: Clock, **others: object) -> tuple[Preview, list[Terminal]]:
    """A preview, and the list whose last entry it takes for the terminal."""
    terminals = [replace(Terminal("blocks", COLUMNS, LINES, BLOCK_CELL), **others)]
    return Preview(screen, lambda: terminals[-1], clock), terminals


def test_pictures_replace_each_other_above_the_bar(screen: Screen) -> None:
    """The finished one stands beside its source."""
    clock = Clock()
    shown, _ = preview(screen, clock)
    screen.write("before\n")
    for color in (RED, BLUE):
        shown.update(progress(flat(color)))
        screen.write(f"\rbar {color[0]:3}")
        clock.now += 10
    rows = LINES - 4
    assert [screen.text(row)[:1] for row in range(1, 1 + rows)] == ["▀"] * rows
    assert screen.text(0) == "before" and screen.text(1 + rows) == "bar   0"
    assert len(screen.pictures()) == rows and all("0;0;255" in style for style in screen.pictures())
    assert not screen.style, "colours end with the line"
    shown.finish(flat(GREEN), flat(BLUE))
    screen.write(" done\n")
    assert len(screen.pictures()) == rows and "0;0;255" in screen.pictures()[0]
    assert screen.text(1).startswith("▀" * 24) and screen.text(1 + rows) == "bar   0 done"
    assert "0;255;0" in (screen.gone + screen.cells)[1][24 + 1 + 3][1]


def test_lines_below_the_picture_stay(screen: Screen) -> None:
    shown, _ = preview(screen, clock := Clock())
    shown.update(progress(flat(RED)))
    screen.write("\rnotice\n")
    shown.move_on()
    clock.now += 10
    shown.update(progress(flat(BLUE)))
    assert screen.text(LINES - 4) == "notice" and screen.text(LINES - 3)[0] == "▀"


def test_a_resized_terminal_gets_a_new_picture(screen: Screen) -> None:
    shown, terminals = preview(screen, clock := Clock())
    for terminal, color in ((terminals[0], RED), (Terminal("blocks", 20, 10, BLOCK_CELL), BLUE)):
        terminals.append(terminal)
        shown.update(progress(flat(color)))
        clock.now += 10
    assert sum("255;0;0" in style for style in screen.pictures()) == LINES - 4
    assert sum("0;0;255" in style for style in screen.pictures()) == 10 - 4
    before = screen.pictures()
    terminals.append(Terminal("blocks", 5, 2, BLOCK_CELL))
    shown.update(progress(flat(GREEN)))
    assert screen.pictures() == before, "too small for a picture"


def test_drawing_takes_a_small_part_of_the_time() -> None:
    """The interval depends on the last two costs; the first update and a single slow one do not count."""
    clock, drawn = Clock(), []
    shown, _ = preview(io.StringIO(), clock)
    costs = iter([2.0, 0.1, 0.1, 5.0, *[0.1] * 1000])

    def slow() -> FloatArray:
        clock.now += next(costs)
        drawn.append(clock.now)
        return flat(RED)

    began = clock.now
    now = replace(progress(flat(RED)), snapshot=Snapshot(mixed_scene, slow))
    while clock.now < began + 200:
        shown.update(now)
        clock.now += 0.01
    gaps = np.diff(drawn)
    assert gaps[0] < 1.2 and gaps[[1, 3]] == pytest.approx(0.1 / TIME_SHARE, abs=0.05)
    assert 90 < len(drawn) < 110


def test_a_pipe_gets_the_finished_picture_only() -> None:
    out = io.StringIO()
    shown, _ = preview(out, Clock(), live=False)
    shown.update(progress(flat(RED)))
    assert not out.getvalue()
    shown.finish(flat(RED), None)
    lines = out.getvalue().split("\n")
    assert len(lines) == LINES - 4 + 1 and not lines[-1]
    assert not re.search(r"\x1b(?!\[[\d;]*m)|\r", out.getvalue()), "colours, but no cursor movements"
    out.close()
    shown.finish(flat(RED), None)  # a closed stream is ignored


@pytest.mark.parametrize("protocol", ["kitty", "iterm", "sixel"])
def test_pixel_protocols_draw_in_the_same_place(protocol: str) -> None:
    out = io.StringIO()
    shown, _ = preview(out, clock := Clock(), protocol=protocol, cell=(10, 20))
    for color in (RED, BLUE):
        shown.update(progress(flat(color)))
        clock.now += 10
    first, second = (part for part in out.getvalue().split("\x1b7") if "\x1b8" in part)
    rows = LINES - 4
    assert out.getvalue().startswith("\r\x1b[2K" + rows * "\n" + "\x1b7")
    assert first.startswith(f"\r\x1b[{rows}A\x1b") and second.startswith(f"\r\x1b[{rows}A\x1b")
    assert first.endswith("\x1b\\\x1b8" if protocol != "iterm" else "\x07\x1b8")
    if protocol == "kitty":
        numbers = re.findall(r"i=(\d+)", out.getvalue())
        assert len(numbers) == 2 and len(set(numbers)) == 1, "so the second replaces the first"


@pytest.mark.parametrize("protocol", ["kitty", "sixel", "blocks"])
@pytest.mark.parametrize(("width", "height"), [(300, 200), (20, 400), (4000, 10)])
@pytest.mark.parametrize(("columns", "lines"), [(80, 24), (200, 60), (10, 8)])
def test_pictures_fit_in_their_proportions(
    protocol: Protocol, width: int, height: int, columns: int, lines: int
) -> None:
    cell = BLOCK_CELL if protocol == "blocks" else (9, 18)
    size = picture_size(Terminal(protocol, columns, lines, cell), width, height)
    assert size and 1 <= size[0] < columns and 1 <= size[1] <= lines - 4
    across, down = size[0] * cell[0], size[1] * cell[1]
    assert protocol != "sixel" or max(across, down) <= 800
    zoom = min(across / width, down / height)
    for side, shown, unit in ((width, across, cell[0]), (height, down, cell[1])):
        assert abs(side * zoom - shown) <= unit * (1 + side / min(width, height))


def test_transparency_is_white() -> None:
    image = np.zeros((4, 4, 4), np.float32)
    image[..., 1], image[..., 3] = 0.25, 0.5  # premultiplied
    assert np.array_equal(np.unique(resized(image, 4, 4).reshape(-1, 3), axis=0), [[128, 191, 128]])
