"""How large a picture is on a terminal, and what draws it there."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt
from PIL import Image

from warpsplat.motion.terminal.blocks import half_blocks
from warpsplat.motion.terminal.detect import Terminal
from warpsplat.motion.terminal.inline import iterm, kitty
from warpsplat.motion.terminal.sixel import sixels
from warpsplat.scene import FloatArray

MOST_ROWS = 32
"""Of a picture."""

OTHER_LINES = 4
"""Of the terminal, that stay free of it."""

LARGEST_SIDE = 800
"""Of a picture of pixels [px]."""

LEAST_COLUMNS, LEAST_LINES = 8, 7
"""Of a terminal on which a picture shows anything."""

GAP = 1
"""Columns between two pictures."""


@dataclass(frozen=True)
class Place:
    """Of one picture on a terminal."""

    columns: int
    rows: int
    cell: tuple[int, int]
    """Of a character, in pixels of the picture."""

    @property
    def pixels(self) -> tuple[int, int]:
        """Width and height of the picture."""
        return self.columns * self.cell[0], self.rows * self.cell[1]


def place(terminal: Terminal, width: int, height: int) -> Place | None:
    """Where a picture of ``width`` x ``height`` goes: as large as the terminal allows, in its proportions.

    None on a terminal that is too small.
    """
    if terminal.columns < LEAST_COLUMNS or terminal.lines < LEAST_LINES:
        return None
    across, down = terminal.cell
    if terminal.protocol == "blocks":
        across, down = 1, 2
    rows = min(terminal.lines - OTHER_LINES, MOST_ROWS)
    columns = terminal.columns - 1  # in the last one some terminals begin a new line
    if terminal.protocol == "sixel":
        rows, columns = min(rows, LARGEST_SIDE // down), min(columns, LARGEST_SIDE // across)
    zoom = min(columns * across / width, rows * down / height)
    size = (round(width * zoom / across), round(height * zoom / down))
    return Place(max(1, min(size[0], columns)), max(1, min(size[1], rows)), (across, down))


def beside(terminal: Terminal, one: Place) -> bool:
    """Whether a second picture fits beside the first one."""
    return 2 * one.columns + GAP < terminal.columns


def resized(image: FloatArray, size: tuple[int, int]) -> npt.NDArray[np.uint8]:
    """A picture, premultiplied where it has opacity, on white, of ``size`` (width, height) and 8 bits."""
    if image.shape[2] == 4:
        image = image[..., :3] + (1 - image[..., 3:])
    smaller = size[0] < image.shape[1]
    shown = cv2.resize(
        np.ascontiguousarray(image, np.float32),
        size,
        interpolation=cv2.INTER_AREA if smaller else cv2.INTER_CUBIC,
    )
    return np.round(255 * np.clip(shown, 0, 1)).astype(np.uint8)


def joined(left: npt.NDArray[np.uint8], right: npt.NDArray[np.uint8], one: Place) -> npt.NDArray[np.uint8]:
    """Two pictures side by side, with a black ``GAP`` between them."""
    gap = np.zeros((left.shape[0], GAP * one.cell[0], 3), np.uint8)
    return np.concatenate([left, gap, right], axis=1)


def drawing(
    terminal: Terminal, pixels: npt.NDArray[np.uint8], one: Place, name: int, *, quick: bool = False
) -> str:
    """What draws a picture, or two, from the cursor on, whose column is the first one.

    Args:
        terminal: to draw on.
        pixels: what ``resized`` and ``joined`` make.
        one: place of the picture, or of the first one.
        name: see ``kitty``.
        quick: rather than well.
    """
    if terminal.protocol == "blocks":
        lines = half_blocks(pixels, true_color=terminal.true_color)
        return ("\r\x1b[1B" if terminal.live else "\n").join(lines)
    picture = Image.fromarray(pixels)
    if terminal.protocol == "sixel":
        return _packed(terminal, sixels(picture, quick=quick))
    columns = picture.width // one.cell[0]
    picture.thumbnail((2 * LARGEST_SIDE, LARGEST_SIDE))
    if terminal.protocol == "kitty":
        return _packed(terminal, kitty(picture, columns, one.rows, name))
    return _packed(terminal, iterm(picture, columns, one.rows))


def _packed(terminal: Terminal, text: str) -> str:
    """As tmux lets it through."""
    if not terminal.tmux:
        return text
    return "\x1bPtmux;" + text.replace("\x1b", "\x1b\x1b") + "\x1b\\"
