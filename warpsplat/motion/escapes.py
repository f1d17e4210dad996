"""Escape sequences that draw a picture in a terminal, from the cursor on."""

from __future__ import annotations

import base64
import io
import itertools
import re

import numpy as np
import numpy.typing as npt
from PIL import Image

from warpsplat.motion.terminal import Terminal

Pixels = npt.NDArray[np.uint8]
"""sRGB, shape (height, width, 3)."""

LARGEST_PICTURE = (1600, 800)
"""Limits of width and height if the terminal scales the picture [px]."""


def picture_escapes(terminal: Terminal, pixels: Pixels, columns: int, rows: int, number: int) -> str:
    """Return the text that draws ``pixels`` on ``columns`` x ``rows`` cells from the first column on.

    ``number``: from 1; in kitty, a picture replaces the previous one of the same number.
    """
    if terminal.protocol == "blocks":
        lines = half_blocks(pixels, true_color=terminal.true_color)
        return ("\r\x1b[1B" if terminal.live else "\n").join(lines)
    picture = Image.fromarray(pixels)
    if terminal.protocol == "sixel":
        text = sixels(picture)
    else:
        picture.thumbnail(LARGEST_PICTURE)
        text = (
            kitty(picture, columns, rows, number)
            if terminal.protocol == "kitty"
            else iterm(picture, columns, rows)
        )
    if terminal.tmux:
        text = "\x1bPtmux;" + text.replace("\x1b", "\x1b\x1b") + "\x1b\\"
    return text


# Half blocks.

HALF = "\N{UPPER HALF BLOCK}"

XTERM_COLORS = (
    *itertools.product((0, 95, 135, 175, 215, 255), repeat=3),
    *((grey,) * 3 for grey in range(8, 248, 10)),
)
"""The 6x6x6 cube and the greys of xterm's palette."""

FIRST_COLOR = 16
"""Number of the first of them; those before it differ between terminals."""


def half_blocks(pixels: Pixels, *, true_color: bool) -> list[str]:
    """Return lines of characters with two pixels each: foreground above, background below."""
    if true_color:
        names = [[f"2;{r};{g};{b}" for r, g, b in row] for row in pixels.tolist()]
    else:
        palette = Image.new("P", (1, 1))
        palette.putpalette(sum((XTERM_COLORS + XTERM_COLORS)[:256], ()))
        nearest = Image.fromarray(pixels).quantize(palette=palette, dither=Image.Dither.NONE)
        names = [
            [f"5;{FIRST_COLOR + i % len(XTERM_COLORS)}" for i in row] for row in np.asarray(nearest).tolist()
        ]
    lines = []
    for upper, lower in zip(names[::2], names[1::2], strict=True):
        styles = ["", *(f"\x1b[38;{top};48;{bottom}m" for top, bottom in zip(upper, lower, strict=True))]
        line = "".join(HALF if now == before else now + HALF for before, now in itertools.pairwise(styles))
        lines.append(f"{line}\x1b[0m")
    return lines


# Sixels: columns of six pixels (DEC, VT330/VT340 Programmer Reference, chapter 14).

SIXEL_COLORS = 256

EMPTY_SIXEL = 63
"""The character of a column without a pixel; each pixel adds a bit, the lowest one for the top row."""

REPEATED = re.compile(r"(.)\1{3,}")
"""Columns that are shorter as a count."""


def sixels(picture: Image.Image) -> str:
    """Return an RGB picture as sixels."""
    quantized = picture.quantize(SIXEL_COLORS, Image.Quantize.FASTOCTREE)
    indices = np.asarray(quantized)
    height, width = indices.shape
    percents = [round(level / 2.55) for level in quantized.getpalette() or ()]
    registers = "".join(
        f"#{i};2;{r};{g};{b}" for i, (r, g, b) in enumerate(zip(*[iter(percents)] * 3, strict=True))
    )
    bands = "-".join(_band(indices[top : top + 6]) for top in range(0, height, 6))
    return f'\x1bP0;1q"1;1;{width};{height}{registers}{bands}\x1b\\'


def _band(indices: Pixels) -> str:
    """Return up to six rows, one colour after the other, each from the left."""
    colors, rows = np.unique(indices, return_inverse=True)
    columns = np.arange(indices.shape[1])
    characters = np.full((len(colors), len(columns)), EMPTY_SIXEL, np.uint8)
    for bit, row in enumerate(rows.reshape(indices.shape)):
        characters[row, columns] += 1 << bit
    texts = (line.tobytes().decode("ascii").rstrip(chr(EMPTY_SIXEL)) for line in characters)
    return "$".join(
        f"#{color}" + REPEATED.sub(lambda run: f"!{len(run[0])}{run[1]}", text)
        for color, text in zip(colors.tolist(), texts, strict=True)
    )


# PNGs within the text.

KITTY_CHUNK = 4096
"""Most characters of base64 in one sequence."""


def kitty(picture: Image.Image, columns: int, rows: int, number: int) -> str:
    """Return the picture by kitty's graphics protocol; the cursor stays where it is."""
    text = base64.b64encode(_png(picture)).decode("ascii")
    chunks = [text[i : i + KITTY_CHUNK] for i in range(0, len(text), KITTY_CHUNK)]
    # a=T: draw at once; f=100: a PNG; C=1: leave the cursor; q=2: no answers, which would be typed input.
    first = f"a=T,f=100,i={number},p=1,c={columns},r={rows},C=1,q=2,"
    return "".join(
        f"\x1b_G{'' if i else first}m={int(i + 1 < len(chunks))};{chunk}\x1b\\"
        for i, chunk in enumerate(chunks)
    )


def iterm(picture: Image.Image, columns: int, rows: int) -> str:
    """Return the picture as an inline image of iTerm2."""
    data = _png(picture)
    size = f"size={len(data)};width={columns};height={rows}"
    return (
        f"\x1b]1337;File=inline=1;{size};preserveAspectRatio=0:{base64.b64encode(data).decode('ascii')}\x07"
    )


def _png(picture: Image.Image) -> bytes:
    packed = io.BytesIO()
    picture.save(packed, "PNG", compress_level=1)
    return packed.getvalue()
