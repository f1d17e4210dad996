"""Pictures of sixels, columns of six pixels (DEC, VT330/VT340 Programmer Reference, chapter 14)."""

from __future__ import annotations

import re

import numpy as np
from PIL import Image

COLORS = 256
"""Registers that terminals have."""

EMPTY = 63
"""The character of a column without a pixel; a pixel adds the bit of its row, the lowest for the top one."""

RUN = re.compile(r"(.)\1{3,}", re.DOTALL)
"""Columns that a count makes shorter."""


def sixels(picture: Image.Image) -> str:
    """An RGB picture as a terminal draws it from the cursor on, pixel for pixel."""
    drawn = picture.quantize(COLORS, Image.Quantize.MEDIANCUT, dither=Image.Dither.NONE)
    width, height = drawn.size
    palette = np.array(drawn.getpalette(), np.float64).reshape(-1, 3)
    indices = np.asarray(drawn)
    registers = "".join(
        f"#{i};2;" + ";".join(f"{round(100 * level / 255)}" for level in palette[i])
        for i in np.unique(indices).tolist()
    )
    bands = "-".join(_band(indices[top : top + 6]) for top in range(0, height, 6))
    return f'\x1bP0;1q"1;1;{width};{height}{registers}{bands}\x1b\\'


def _band(indices: np.ndarray) -> str:
    """Six rows: colour by colour, each from the left again."""
    bits = np.left_shift(1, np.arange(len(indices)))
    lines = []
    for color in np.unique(indices).tolist():
        columns = EMPTY + bits @ (indices == color)
        text = columns.astype(np.uint8).tobytes().decode("ascii").rstrip(chr(EMPTY))
        lines.append(f"#{color}" + RUN.sub(lambda run: f"!{len(run[0])}{run[1]}", text))
    return "$".join(lines)
