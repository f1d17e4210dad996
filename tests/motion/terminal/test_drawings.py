"""What is written to terminals, read again as they do."""

from __future__ import annotations

import base64
import io
import re

import numpy as np
import pytest
from PIL import Image

from warpsplat.motion.terminal.blocks import half_blocks
from warpsplat.motion.terminal.detect import Terminal
from warpsplat.motion.terminal.inline import iterm, kitty
from warpsplat.motion.terminal.layout import beside, drawing, joined, place, resized
from warpsplat.motion.terminal.sixel import sixels


def picture(width: int, height: int, *, smooth: bool = False) -> np.ndarray:
    """Of few colours, each of which is one of xterm's; or of many."""
    if smooth:
        y, x = np.mgrid[:height, :width] / max(width, height)
        return np.round(255 * np.stack([x, y, 1 - x], axis=2)).astype(np.uint8)
    rng = np.random.default_rng(1)
    return np.array([[0, 0, 0], [255, 0, 95], [175, 215, 255], [118, 118, 118]], np.uint8)[
        rng.integers(0, 4, (height, width))
    ]


def read_blocks(lines: list[str]) -> np.ndarray:
    rows = []
    for line in lines:
        colors: dict[int, list[int]] = {}
        pixels = []
        for codes, character in re.findall(r"\x1b\[([\d;]*)m|(.)", line):
            if character:
                assert character == "▀"
                pixels.append((colors[38], colors[48]))
                continue
            values = [int(code) for code in codes.split(";")]
            if values == [0]:
                colors = {}
            while len(values) > 1:
                count = 5 if values[1] == 2 else 3
                place, values, said = values[0], values[count:], values[2:count]
                colors[place] = said if count == 5 else xterm(said[0])
        assert not colors, "a line leaves nothing behind"
        rows += list(zip(*pixels, strict=True))
    return np.array(rows, np.uint8)


def xterm(number: int) -> list[int]:
    if number >= 232:
        return [8 + 10 * (number - 232)] * 3
    steps = (0, 95, 135, 175, 215, 255)
    return [steps[(number - 16) // place % 6] for place in (36, 6, 1)]


@pytest.mark.parametrize("true_color", [True, False])
def test_half_blocks(true_color: bool) -> None:
    image = picture(30, 8)
    assert np.array_equal(read_blocks(half_blocks(image, true_color=true_color)), image)


def test_256_colors_are_near() -> None:
    image = picture(40, 20, smooth=True)
    found = read_blocks(half_blocks(image, true_color=False)).astype(float)
    assert np.abs(found - image).mean() < 25


def test_a_colour_is_said_where_it_changes() -> None:
    image = np.full((2, 50, 3), 200, np.uint8)
    assert len(half_blocks(image, true_color=True)[0]) < 100


def read_sixels(text: str) -> np.ndarray:
    """As the manual has it, pixel by pixel."""
    found = re.fullmatch(r'\x1bP0;1q"1;1;(\d+);(\d+)(.*)\x1b\\', text, re.DOTALL)
    assert found
    width, height = int(found[1]), int(found[2])
    image, palette = np.full((height + 5, width, 3), -1), {}
    left = top = color = 0
    for token in re.findall(r"#\d+;2;\d+;\d+;\d+|#\d+|!\d+.|[?-~]|[$-]", found[3]):
        if token[0] == "#":
            color, *said = map(int, token[1:].split(";"))
            if said:
                palette[color] = [round(255 * share / 100) for share in said[1:]]
        elif token == "$":
            left = 0
        elif token == "-":
            left, top = 0, top + 6
        else:
            count = int(token[1:-1]) if token[0] == "!" else 1
            for row in range(6):
                if ord(token[-1]) - 63 >> row & 1:
                    image[top + row, left : left + count] = palette[color]
            left += count
    assert (image[:height] >= 0).all() and (image[height:] == -1).all(), "each pixel, and no more"
    return image[:height]


@pytest.mark.parametrize(("width", "height"), [(37, 25), (6, 6), (1, 1)])
def test_sixels(width: int, height: int) -> None:
    """Levels are percents there."""
    few = picture(width, height)
    assert np.abs(read_sixels(sixels(Image.fromarray(few))) - few).max() <= 2
    many = picture(width, height, smooth=True)
    assert np.abs(read_sixels(sixels(Image.fromarray(many))) - many).mean() < 4
    quick = sixels(Image.fromarray(many), quick=True)
    assert np.abs(read_sixels(quick) - many).mean() < 20 and len(set(re.findall(r"#(\d+);", quick))) <= 64


def test_long_runs_of_sixels_are_counted() -> None:
    assert len(sixels(Image.new("RGB", (400, 6), "red"))) < 60


def test_kitty() -> None:
    image = np.random.default_rng(0).integers(0, 256, (60, 50, 3)).astype(np.uint8)
    text = kitty(Image.fromarray(image), 10, 4, 7)
    found = re.findall(r"\x1b_G([^;]*);([^\x1b]*)\x1b\\", text)
    assert len(found) > 2 and "".join(f"\x1b_G{keys};{data}\x1b\\" for keys, data in found) == text
    assert found[0][0] == "a=T,f=100,i=7,p=1,c=10,r=4,C=1,q=2,m=1"
    assert [keys for keys, _ in found[1:]] == ["m=1"] * (len(found) - 2) + ["m=0"]
    assert all(len(data) == 4096 for _, data in found[:-1]) and len(found[-1][1]) <= 4096
    packed = base64.b64decode("".join(data for _, data in found), validate=True)
    assert np.array_equal(np.asarray(Image.open(io.BytesIO(packed))), image)


def test_iterm() -> None:
    image = picture(20, 10)
    text = iterm(Image.fromarray(image), 4, 1)
    found = re.fullmatch(r"\x1b\]1337;File=inline=1;size=(\d+);width=4;height=1;[^:]*:([^\x07]*)\x07", text)
    assert found
    packed = base64.b64decode(found[2], validate=True)
    assert len(packed) == int(found[1])
    assert np.array_equal(np.asarray(Image.open(io.BytesIO(packed))), image)


def test_tmux_lets_through_what_is_packed_for_it() -> None:
    terminal = Terminal("iterm", 20, 10, tmux=True)
    one = place(terminal, 20, 10)
    assert one
    image = resized(picture(20, 10).astype(np.float32) / 255, one.pixels)
    text = drawing(terminal, image, one, 1)
    assert text.startswith("\x1bPtmux;\x1b\x1b]1337;File=") and text.endswith("\x07\x1b\\")


@pytest.mark.parametrize("protocol", ["kitty", "iterm", "sixel", "blocks"])
@pytest.mark.parametrize(("width", "height"), [(300, 200), (20, 400), (4000, 10)])
@pytest.mark.parametrize(("columns", "lines"), [(80, 24), (200, 60), (10, 8)])
def test_pictures_keep_their_proportions_and_fit(
    protocol: str, width: int, height: int, columns: int, lines: int
) -> None:
    terminal = Terminal(protocol, columns, lines, cell=(9, 18))
    one = place(terminal, width, height)
    assert one
    assert 1 <= one.columns < columns and 1 <= one.rows <= lines - 4
    across, down = one.pixels
    zoom = min(across / width, down / height)
    for side, shown, cell in ((width, across, one.cell[0]), (height, down, one.cell[1])):
        assert abs(side * zoom - shown) <= cell * (1 + side / min(width, height))
    if protocol == "sixel":
        assert max(one.pixels) <= 800


def test_there_is_a_least_terminal() -> None:
    assert place(Terminal("blocks", 5, 24), 10, 10) is None
    assert place(Terminal("blocks", 80, 4), 10, 10) is None


def test_two_pictures_beside_each_other() -> None:
    terminal = Terminal("blocks", 80, 14)
    one = place(terminal, 30, 20)
    assert one and one.pixels == (30, 20) and beside(terminal, one)
    assert not beside(Terminal("blocks", 61, 14), one) and beside(Terminal("blocks", 62, 14), one)
    left, right = picture(30, 20), picture(30, 20, smooth=True)
    both = joined(left, right, one)
    assert (
        np.array_equal(both[:, :30], left) and np.array_equal(both[:, 31:], right) and not both[:, 30].any()
    )


def test_transparency_is_white() -> None:
    image = np.zeros((4, 4, 4), np.float32)
    image[..., 1], image[..., 3] = 0.25, 0.5  # premultiplied
    assert np.array_equal(np.unique(resized(image, (4, 4)).reshape(-1, 3), axis=0), [[128, 191, 128]])
