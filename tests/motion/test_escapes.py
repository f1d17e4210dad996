"""Escape sequences of pictures, decoded again as terminals do."""

from __future__ import annotations

import base64
import io
import re

import numpy as np
import pytest
from PIL import Image

from warpsplat.motion.escapes import half_blocks, iterm, kitty


def picture(width: int, height: int, *, smooth: bool = False) -> np.ndarray:
    """A gradient, or four of xterm's colours."""
    if smooth:
        y, x = np.mgrid[:height, :width] / max(width, height)
        return np.round(255 * np.stack([x, y, 1 - x], axis=2)).astype(np.uint8)
    rng = np.random.default_rng(1)
    colors = np.array([[0, 0, 0], [255, 0, 95], [175, 215, 255], [135, 135, 135]], np.uint8)
    return colors[rng.integers(0, 4, (height, width))]


def read_blocks(lines: list[str]) -> np.ndarray:
    rows = []
    for line in lines:
        assert line.endswith("▀\x1b[0m")
        upper, lower, now = [], [], ("", "")
        for top, bottom, character in re.findall(r"\x1b\[38;([\d;]*);48;([\d;]*)m|(▀)", line):
            if character:
                upper.append(xterm(now[0]))
                lower.append(xterm(now[1]))
            else:
                now = (top, bottom)
        rows += [upper, lower]
    return np.array(rows, np.uint8)


def xterm(color: str) -> list[int]:
    kind, *values = map(int, color.split(";"))
    if kind == 2:
        return values
    steps = (0, 95, 135, 175, 215, 255)
    return [steps[(values[0] - 16) // place % 6] for place in (36, 6, 1)]


@pytest.mark.parametrize("true_color", [True, False])
def test_half_blocks(true_color: bool) -> None:
    image = picture(30, 8)
    assert np.array_equal(read_blocks(half_blocks(image, true_color=true_color)), image)
    smooth = picture(40, 20, smooth=True)
    shown = read_blocks(half_blocks(smooth, true_color=true_color)).astype(float)
    assert np.abs(shown - smooth).mean() < (1e-9 if true_color else 25)
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
