"""Show a run's picture in the terminal: live during training, and beside its source at the end."""

from __future__ import annotations

import contextlib
import logging
import math
import os
import secrets
import shutil
import time
from collections.abc import Callable
from pathlib import Path
from typing import Literal, TextIO

import cv2
import numpy as np

from warpsplat.cli.echo import echo
from warpsplat.errors import ImageError
from warpsplat.files.sources import image_of
from warpsplat.fit.progress import Progress
from warpsplat.motion.escapes import HALF, Pixels, half_blocks, iterm, kitty
from warpsplat.run.result import Result
from warpsplat.scene import FloatArray
from warpsplat.svg.viewer import premultiplied, render_svg

Protocol = Literal["kitty", "iterm", "blocks"]
"""Kitty's graphics protocol, iTerm2's inline images, or half-block characters."""

BY_TERM_PROGRAM: dict[str, Protocol] = {
    **dict.fromkeys(("iterm.app", "wezterm", "mintty"), "iterm"),
    **dict.fromkeys(("ghostty", "kitty"), "kitty"),
}

BY_TERM: dict[str, Protocol] = dict.fromkeys(("xterm-kitty", "xterm-ghostty"), "kitty")
"""TERM is the only one of these variables that ssh passes on."""

CELLS = {"blocks": (1, 2), "iterm": (10, 20), "kitty": (10, 20)}
"""Width and height of a character [px of the picture]; terminals scale pictures of pixels to their own."""

TIME_SHARE = 0.05
"""Share of a run's time for drawing: the interval between two updates depends on how long one takes."""

SAVE_CURSOR, RESTORE_CURSOR = "\x1b7", "\x1b8"

MIN_COLUMNS, MIN_LINES = 8, 7
"""Smallest useful terminal."""


class Preview:
    """Draws on a stream; during a run, above the line with the cursor, which is the progress bar's."""

    def __init__(
        self, stream: TextIO, protocol: Protocol, clock: Callable[[], float] = time.perf_counter
    ) -> None:
        self._stream, self._protocol, self._clock = stream, protocol, clock
        self._live = stream.isatty()
        self._size: os.terminal_size | None = None
        self._rows = 0
        """Height of the picture above the cursor; 0: there is none."""
        self._next, self._cost = 0.0, math.inf
        self._number = 1 + secrets.randbelow(2**24 - 1)

    def update(self, progress: Progress) -> None:
        """Draw the current picture, unless the last update was just before."""
        begun = self._clock()
        if progress.snapshot is None or begun < self._next:
            return
        if self._live:
            self._draw(progress.snapshot.image(), None)
        now = self._clock()
        previous, self._cost = self._cost, now - begun
        wait = min(previous, self._cost) * (1 / TIME_SHARE - 1)  # a single slow update is no measure
        shortest_interval = 0.1  # between two updates [s]
        # Between the first two updates [s]: the first takes longer than the others.
        longest_first_interval = 1.0
        self._next = now + max(
            shortest_interval, wait if previous < math.inf else min(wait, longest_first_interval)
        )

    def move_on(self) -> None:
        """Leave the picture where it is: lines were written below it, so the next one goes below them."""
        self._rows = 0

    def finish(self, image: FloatArray, source: FloatArray | None) -> None:
        """Draw the finished picture in place of the last one, to the right of its source if both fit.

        Pictures have values in [0, 1] and shapes (height, width, 3), or (height, width, 4) premultiplied.
        """
        self._draw(image, source)

    def _draw(self, image: FloatArray, source: FloatArray | None) -> None:
        terminal = terminal_size(self._stream)
        if terminal != self._size:  # after a change of size, the old picture can be anywhere
            self._size, self._rows = terminal, 0
        across, down = CELLS[self._protocol]
        size = picture_size(terminal, image.shape[1], image.shape[0])
        if size is None:
            return
        columns, rows = size
        pixels = resized(image, columns * across, rows * down)
        if source is not None and 2 * columns + 1 < terminal.columns:
            gap = np.zeros((rows * down, across, 3), np.uint8)
            pixels = np.concatenate([resized(source, columns * across, rows * down), gap, pixels], axis=1)
            columns = 2 * columns + 1
        text = self._escapes(pixels, columns, rows)
        if not self._live:
            self._write(text + "\n")
            return
        begin = "" if self._rows == rows else "\r\x1b[2K" + rows * "\n"
        self._rows = rows
        self._write(f"{begin}{SAVE_CURSOR}\r\x1b[{rows}A{text}{RESTORE_CURSOR}")

    def _escapes(self, pixels: Pixels, columns: int, rows: int) -> str:
        if self._protocol == "kitty":
            return kitty(pixels, columns, rows, self._number)
        if self._protocol == "iterm":
            return iterm(pixels, columns, rows)
        lines = half_blocks(pixels, true_color=not self._live or has_true_color())
        return ("\r\x1b[1B" if self._live else "\n").join(lines)

    def _write(self, text: str) -> None:
        with contextlib.suppress(OSError, ValueError):  # a closed stream must not end the run
            self._stream.write(text)
            self._stream.flush()


def terminal_size(stream: TextIO) -> os.terminal_size:
    """Return the current columns and lines of a stream's terminal, or else of the process's."""
    with contextlib.suppress(OSError, ValueError):
        size = os.get_terminal_size(stream.fileno())
        if all(size):
            return size
    return shutil.get_terminal_size()


def picture_size(terminal: os.terminal_size, width: int, height: int) -> tuple[int, int] | None:
    """Return columns and rows of a picture: as large as fits, in its proportions.

    None if the terminal is too small.
    """
    if terminal.columns < MIN_COLUMNS or terminal.lines < MIN_LINES:
        return None
    max_rows = 32  # height of a picture
    other_lines = 4  # lines of the terminal that stay free
    rows = min(terminal.lines - other_lines, max_rows)
    columns = terminal.columns - 1  # some terminals wrap after the last one
    zoom = min(columns / width, 2 * rows / height)  # a character is twice as high as it is wide
    return min(max(1, round(width * zoom)), columns), min(max(1, round(height * zoom / 2)), rows)


def resized(image: FloatArray, width: int, height: int) -> Pixels:
    """Return a picture, which may be premultiplied RGBA, on white and with 8 bits."""
    if image.shape[2] == 4:
        image = image[..., :3] + (1 - image[..., 3:])
    method = cv2.INTER_AREA if width < image.shape[1] else cv2.INTER_CUBIC
    shown = cv2.resize(np.ascontiguousarray(image, np.float32), (width, height), interpolation=method)
    return np.round(255 * np.clip(shown, 0, 1)).astype(np.uint8)


def best_protocol() -> Protocol:
    """Return the terminal's best protocol, by the environment."""
    term, program = os.environ.get("TERM", ""), os.environ.get("TERM_PROGRAM", "").lower()
    if "TMUX" in os.environ or term.startswith(("screen", "tmux")) or os.name == "nt":
        return "blocks"
    if "KITTY_WINDOW_ID" in os.environ:
        return "kitty"
    if os.environ.get("LC_TERMINAL") == "iTerm2":  # ssh may pass it on
        return "iterm"
    return BY_TERM_PROGRAM.get(program) or BY_TERM.get(term) or "blocks"


def has_true_color() -> bool:
    """Tell whether characters can have 24-bit colours; otherwise they have xterm's 256."""
    announced = os.environ.get("COLORTERM", "").lower() in {"truecolor", "24bit"}
    return announced or "direct" in os.environ.get("TERM", "") or "WT_SESSION" in os.environ


def start_preview(stream: TextIO, protocol: Protocol | None) -> Preview | None:
    """Return a preview on ``stream`` by ``protocol``, or by the best one for the terminal.

    Returns None, after a notice that says why, if the stream cannot show pictures.
    """
    problem = ""
    if protocol is None and (not stream.isatty() or os.environ.get("TERM") == "dumb"):
        problem = "stderr is not a terminal that shows pictures; --preview=blocks prints them"
    protocol = protocol or best_protocol()
    if not problem and protocol == "blocks" and not _can_encode(stream, HALF):
        problem = f"the terminal's encoding, {stream.encoding}, has no half blocks"
    if problem:
        echo(f"warpsplat: --preview: {problem}", err=True)
        return None
    if os.name == "nt":
        os.system("")  # makes Windows consoles interpret escape sequences
    preview = Preview(stream, protocol)
    log = logging.getLogger("warpsplat")
    log.handlers = [handler for handler in log.handlers if not isinstance(handler, _NoticeHandler)]
    log.addHandler(_NoticeHandler(preview))
    return preview


def _can_encode(stream: TextIO, text: str) -> bool:
    try:
        text.encode(stream.encoding or "ascii")
    except (UnicodeEncodeError, LookupError):
        return False
    return True


class _NoticeHandler(logging.Handler):
    """Moves a preview on when a notice is printed below its picture."""

    def __init__(self, preview: Preview) -> None:
        super().__init__()
        self._preview = preview

    def emit(self, record: logging.LogRecord) -> None:
        if not getattr(record, "passing", False):
            self._preview.move_on()


def show_finished(preview: Preview, result: Result, source: bytes | Path | None) -> None:
    """Show a result, beside its ``source`` if there is one; what cannot be read is left out."""
    side = max(result.scene.canvas.width, result.scene.canvas.height)
    # Longer side at which the finished picture is rendered [px]: more than any terminal shows.
    max_finished_side = 1600
    with contextlib.suppress(ImageError):
        rendered = render_svg(result.svg, zoom=min(1.0, max_finished_side / side))
        original = None
        if source is not None:
            with contextlib.suppress(ImageError):
                original = image_of(source, factor=max(1, side // max_finished_side))
        preview.finish((premultiplied(rendered) / 255).astype(np.float32), original)
