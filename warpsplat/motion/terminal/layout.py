"""Fit images to a terminal, and draw them."""

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
"""Maximum rows of an image."""

OTHER_LINES = 4
"""Lines of the terminal to leave free."""

LARGEST_SIDE = 800
"""Maximum side of an image of pixels [px]."""

LEAST_COLUMNS, LEAST_LINES = 8, 7
"""Minimum size of a terminal."""

GAP = 1
"""Columns between two images."""


@dataclass(frozen=True)
class Place:
    """Layout of an image."""

    columns: int
    rows: int
    cell: tuple[int, int]
    """Size of a character [pixels of the image]."""

    @property
    def pixels(self) -> tuple[int, int]:
        """Width and height of the image."""
        return self.columns * self.cell[0], self.rows * self.cell[1]


def place(terminal: Terminal, width: int, height: int) -> Place | None:
    """Return the largest layout of an image of ``width`` x ``height`` in the terminal.

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
    """Return whether a second image fits beside the first one."""
    return 2 * one.columns + GAP < terminal.columns


def resized(image: FloatArray, size: tuple[int, int]) -> npt.NDArray[np.uint8]:
    """Return an image, premultiplied if it has opacity, on white in 8 bits, at ``size`` (width, height)."""
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
    """Return two images side by side, with a black ``GAP``."""
    gap = np.zeros((left.shape[0], GAP * one.cell[0], 3), np.uint8)
    return np.concatenate([left, gap, right], axis=1)


def drawing(
    terminal: Terminal, pixels: npt.NDArray[np.uint8], one: Place, name: int, *, quick: bool = False
) -> str:
    """Return the sequence that draws an image, or two, at the cursor in the first column.

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
    """Wrap a sequence for tmux."""
    if not terminal.tmux:
        return text
    return "\x1bPtmux;" + text.replace("\x1b", "\x1b\x1b") + "\x1b\\"
