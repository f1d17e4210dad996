"""Draw images with sixels, columns of six pixels (DEC, VT330/VT340 Programmer Reference, chapter 14)."""

from __future__ import annotations

import re

import numpy as np
import numpy.typing as npt
from PIL import Image

COLORS, FEW_COLORS = 256, 64
"""Colour registers of terminals, and those used for fast drawing."""

EMPTY = 63
"""Character of an empty column; a pixel adds the bit of its row, the lowest for the top one."""

RUN = re.compile(r"(.)\1{3,}")
"""Repetitions that a count shortens."""


def sixels(picture: Image.Image, *, quick: bool = False) -> str:
    """Return an RGB image drawn at the cursor, pixel for pixel."""
    number, method = (FEW_COLORS, Image.Quantize.FASTOCTREE) if quick else (COLORS, Image.Quantize.MEDIANCUT)
    drawn = picture.quantize(number, method, dither=Image.Dither.NONE)
    width, height = drawn.size
    palette = np.array(drawn.getpalette(), np.float64).reshape(-1, 3)
    indices = np.asarray(drawn)
    registers = "".join(
        f"#{i};2;" + ";".join(f"{round(100 * level / 255)}" for level in palette[i])
        for i in np.unique(indices).tolist()
    )
    bands = "-".join(_band(indices[top : top + 6]) for top in range(0, height, 6))
    return f'\x1bP0;1q"1;1;{width};{height}{registers}{bands}\x1b\\'


def _band(indices: npt.NDArray[np.uint8]) -> str:
    """Return six rows, colour by colour, each from the left."""
    used, lines = np.unique(indices, return_inverse=True)
    columns = np.arange(indices.shape[1])
    characters = np.full((len(used), len(columns)), EMPTY, np.uint8)
    for row, line in enumerate(lines.reshape(indices.shape)):
        characters[line, columns] += 1 << row
    texts = (line.tobytes().decode("ascii").rstrip(chr(EMPTY)) for line in characters)
    return "$".join(
        f"#{color}" + RUN.sub(lambda run: f"!{len(run[0])}{run[1]}", text)
        for color, text in zip(used.tolist(), texts, strict=True)
    )
