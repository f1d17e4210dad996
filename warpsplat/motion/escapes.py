"""Escape sequences that draw a picture in a terminal, from the cursor on."""

from __future__ import annotations

import base64
import io
import itertools

import numpy as np
import numpy.typing as npt
from PIL import Image

Pixels = npt.NDArray[np.uint8]
"""sRGB, shape (height, width, 3)."""

HALF = "\N{UPPER HALF BLOCK}"

CUBE = (48, 115, 155, 195, 235)
"""Levels between those of xterm's 6x6x6 cube of colours, which are 0, 95, 135, 175, 215 and 255."""


def half_blocks(pixels: Pixels, *, true_color: bool) -> list[str]:
    """Return lines of characters with two pixels each: foreground above, background below."""
    first_color = 16  # number of the cube's first colour; those before it differ between terminals
    if true_color:
        names = [[f"2;{r};{g};{b}" for r, g, b in row] for row in pixels.tolist()]
    else:
        red, green, blue = np.moveaxis(np.digitize(pixels, CUBE), 2, 0)
        names = [[f"5;{color}" for color in row] for row in first_color + 36 * red + 6 * green + blue]
    lines = []
    for upper, lower in zip(names[::2], names[1::2], strict=True):
        styles = ["", *(f"\x1b[38;{top};48;{bottom}m" for top, bottom in zip(upper, lower, strict=True))]
        line = "".join(HALF if now == before else now + HALF for before, now in itertools.pairwise(styles))
        lines.append(f"{line}\x1b[0m")
    return lines


def kitty(pixels: Pixels, columns: int, rows: int, number: int) -> str:
    """Return the picture by kitty's graphics protocol; the cursor stays where it is.

    ``number``: from 1; a picture replaces the previous one of the same number.
    """
    text = base64.b64encode(_png(pixels)).decode("ascii")
    kitty_chunk = 4096  # most characters of base64 in one sequence
    chunks = [text[i : i + kitty_chunk] for i in range(0, len(text), kitty_chunk)]
    # a=T: draw at once; f=100: a PNG; C=1: leave the cursor; q=2: no answers, which would be typed input.
    first = f"a=T,f=100,i={number},p=1,c={columns},r={rows},C=1,q=2,"
    return "".join(
        f"\x1b_G{'' if i else first}m={int(i + 1 < len(chunks))};{chunk}\x1b\\"
        for i, chunk in enumerate(chunks)
    )


def iterm(pixels: Pixels, columns: int, rows: int) -> str:
    """Return the picture as an inline image of iTerm2."""
    data = _png(pixels)
    size = f"size={len(data)};width={columns};height={rows}"
    return (
        f"\x1b]1337;File=inline=1;{size};preserveAspectRatio=0:{base64.b64encode(data).decode('ascii')}\x07"
    )


def _png(pixels: Pixels) -> bytes:
    packed = io.BytesIO()
    Image.fromarray(pixels).save(packed, "PNG", compress_level=1)
    return packed.getvalue()
