"""Detect how a terminal can show pictures: by the environment, or by asking it where that is safe."""

from __future__ import annotations

import contextlib
import os
import re
import select
import shutil
import struct
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import IO, Literal

Protocol = Literal["kitty", "iterm", "sixel", "blocks"]
"""Kitty's graphics protocol, iTerm2's inline images, sixels, or half-block characters."""

Cell = tuple[int, int]
"""Width and height of a character [px of the picture]."""

BLOCK_CELL, DEFAULT_CELL = (1, 2), (10, 20)
"""Cell of half blocks; and that of a terminal that does not report its own."""

BY_TERM_PROGRAM: dict[str, Protocol] = {
    **dict.fromkeys(("iterm.app", "wezterm", "mintty"), "iterm"),
    **dict.fromkeys(("ghostty", "kitty"), "kitty"),
}

BY_TERM: dict[str, Protocol] = {
    **dict.fromkeys(("xterm-kitty", "xterm-ghostty"), "kitty"),
    **dict.fromkeys(("foot", "mlterm"), "sixel"),
}
"""TERM is the only one of these variables that ssh passes on."""


@dataclass(frozen=True)
class Terminal:
    """Size and abilities of the output."""

    protocol: Protocol
    columns: int
    lines: int
    cell: Cell
    true_color: bool = True
    """Whether characters can have 24-bit colours; otherwise they have xterm's 256."""
    live: bool = True
    """Whether it is a terminal, where a picture can be drawn over the previous one."""
    tmux: bool = False
    """Whether tmux passes the output on, so that escape sequences must be wrapped for it."""

    def remeasured(self, stream: IO[str]) -> Terminal:
        """Return the terminal with its current size."""
        columns, lines, cell = _screen_size(stream)
        cell = self.cell if self.protocol == "blocks" else cell or self.cell
        return replace(self, columns=columns, lines=lines, cell=cell)


def detect(
    stream: IO[str], protocol: Protocol | None = None, ask: Callable[[], str] | None = None
) -> Terminal | None:
    """Return how pictures can be drawn on ``stream``, or None if it cannot show any.

    ``protocol``: default: the best one available; ``ask``: returns the terminal's answer to ``QUERY``,
    default: ``answer_of_terminal``.
    """
    environ, live = os.environ, stream.isatty()
    term = environ.get("TERM", "")
    if protocol is None and (not live or term == "dumb"):
        return None
    multiplexed = "TMUX" in environ or term.startswith(("screen", "tmux"))
    if protocol is None:
        protocol = "blocks" if multiplexed or os.name == "nt" else _by_environment()
    columns, lines, cell = _screen_size(stream)
    unknown = protocol is None or (protocol == "sixel" and cell is None)
    if unknown and live and not multiplexed and os.name == "posix":
        answer = (ask or answer_of_terminal)()
        protocol = protocol or ("sixel" if HAS_SIXELS.search(answer) else "blocks")
        if size := CELL_SIZE.search(answer):
            cell = cell or (int(size[2]), int(size[1]))
    return Terminal(
        protocol or "blocks",
        columns,
        lines,
        BLOCK_CELL if protocol == "blocks" else cell or DEFAULT_CELL,
        not live or _has_true_color(),
        live,
        "TMUX" in environ,
    )


def _by_environment() -> Protocol | None:
    if "KITTY_WINDOW_ID" in os.environ:
        return "kitty"
    if os.environ.get("LC_TERMINAL") == "iTerm2":  # ssh may pass it on
        return "iterm"
    program = os.environ.get("TERM_PROGRAM", "").lower()
    return BY_TERM_PROGRAM.get(program) or BY_TERM.get(os.environ.get("TERM", ""))


def _has_true_color() -> bool:
    term = os.environ.get("TERM", "")
    announced = os.environ.get("COLORTERM", "").lower() in {"truecolor", "24bit"}
    return announced or "direct" in term or "WT_SESSION" in os.environ or term in BY_TERM


def _screen_size(stream: IO[str]) -> tuple[int, int, Cell | None]:
    """Return columns, lines and the cell, if known."""
    with contextlib.suppress(OSError, ValueError, ImportError):
        import fcntl
        import termios

        packed = fcntl.ioctl(stream.fileno(), termios.TIOCGWINSZ, bytes(8))
        lines, columns, width, height = struct.unpack("HHHH", packed)
        if lines and columns:
            cell = (width // columns, height // lines)
            return columns, lines, cell if all(cell) else None
    return *shutil.get_terminal_size(), None


# The terminal's own answer.

QUERY = b"\x1b[16t\x1b[c"
"""Asks for the cell size, which some terminals report, then for the attributes (DA1), which all report."""

ATTRIBUTES = re.compile(r"\x1b\[\?[\d;]*c")
HAS_SIXELS = re.compile(r"\x1b\[\?(?:\d+;)*4(?:;\d+)*c")
CELL_SIZE = re.compile(r"\x1b\[6;([1-9]\d{0,3});([1-9]\d{0,3})t")

PATIENCE = 1.0
"""Time to wait for the answer [s]; a later one would be taken for typed input."""


def answer_of_terminal() -> str:
    """Return what the process's terminal answers to ``QUERY``; empty if it must not be asked."""
    import termios
    import tty

    try:
        with open(os.ctermid(), "r+b", buffering=0) as terminal:
            if os.tcgetpgrp(terminal.fileno()) != os.getpgrp():  # a background job would be stopped
                return ""
            before = termios.tcgetattr(terminal)
            try:
                tty.setcbreak(terminal.fileno(), termios.TCSADRAIN)
                terminal.write(QUERY)
                return _read_answer(terminal.fileno())
            finally:
                termios.tcsetattr(terminal, termios.TCSADRAIN, before)
    except (OSError, termios.error):
        return ""


def _read_answer(handle: int) -> str:
    text, end = "", time.monotonic() + PATIENCE
    while not ATTRIBUTES.search(text) and (left := end - time.monotonic()) > 0:
        if not select.select([handle], [], [], left)[0]:
            break
        text += os.read(handle, 1024).decode("latin-1")
    return text
