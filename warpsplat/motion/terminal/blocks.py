"""Draw images with half blocks: two pixels a character, as foreground and background colours."""

from __future__ import annotations

import itertools

import cv2
import numpy as np
import numpy.typing as npt

Bytes = npt.NDArray[np.uint8]

HALF = "\N{UPPER HALF BLOCK}"
RESET = "\x1b[0m"

CUBE = (0, 95, 135, 175, 215, 255)
"""Levels of the 6x6x6 colours from number 16 on, of the 256 that xterm has; those before are anything."""

GREYS = range(8, 248, 10)
"""Of the colours from number 232 on."""

FIRST = 16
"""Number of the first colour that is the same everywhere."""


def half_blocks(image: Bytes, *, true_color: bool) -> list[str]:
    """Return the lines of an image.

    Args:
        image: sRGB, shape (2 lines, columns, 3), uint8.
        true_color: whether colours have 24 bits; else they are xterm's 256.
    """
    if true_color:
        names = np.array([f"2;{r};{g};{b}" for r, g, b in image.reshape(-1, 3).tolist()])
    else:
        names = np.array([f"5;{n}" for n in _numbers(image).ravel().tolist()])
    names = names.reshape(image.shape[:2])
    return [
        _line(upper.tolist(), lower.tolist()) for upper, lower in zip(names[::2], names[1::2], strict=True)
    ]


def _line(upper: list[str], lower: list[str]) -> str:
    """Write the codes of colours where they change."""
    parts, before = [], ("", "")
    for now in zip(upper, lower, strict=True):
        said = [
            f"{place};{name}" for place, name, old in zip((38, 48), now, before, strict=True) if name != old
        ]
        parts.append(f"\x1b[{';'.join(said)}m{HALF}" if said else HALF)
        before = now
    return "".join(parts) + RESET


def _numbers(image: Bytes) -> npt.NDArray[np.int64]:
    """Return the perceptually nearest of xterm's colours for each pixel, shape (height, width).

    Without dithering, which would show as grain.
    """
    colors = np.array([*itertools.product(CUBE, repeat=3), *((grey,) * 3 for grey in GREYS)], np.uint8)
    pixels, known = _lab(image.reshape(-1, 3)), _lab(colors)
    # |p - k|^2 but for |p|^2, which is the same for all k.
    distances = (known**2).sum(axis=1) - 2 * pixels @ known.T
    return FIRST + distances.argmin(axis=1).reshape(image.shape[:2])


def _lab(colors: Bytes) -> npt.NDArray[np.float32]:
    """Convert sRGB, shape (color, 3), to CIE L*a*b*, where distances are perceptual."""
    return cv2.cvtColor(colors[None].astype(np.float32) / 255, cv2.COLOR_RGB2LAB)[0]
