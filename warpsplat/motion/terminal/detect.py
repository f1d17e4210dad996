"""Detect what a terminal can show, from the environment and, if that is safe, by asking it."""

from __future__ import annotations

import contextlib
import os
import re
import select
import struct
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import IO, Literal

Protocol = Literal["kitty", "iterm", "sixel", "blocks"]
"""Ways to show images: kitty's graphics, iTerm2's inline images, sixels, half blocks."""

CELL = (10, 20)
"""Default size of a character [px]."""

SCREEN = (80, 24)
"""Columns and lines if the stream is no terminal."""

PROGRAMS: dict[str, Protocol] = {
    "iterm.app": "iterm",
    "wezterm": "iterm",
    "mintty": "iterm",
    "ghostty": "kitty",
    "kitty": "kitty",
}
"""Protocol by TERM_PROGRAM."""

TERMS: dict[str, Protocol] = {
    "xterm-kitty": "kitty",
    "xterm-ghostty": "kitty",
    "foot": "sixel",
    "mlterm": "sixel",
}
"""Protocol by TERM, which remote shells get too."""

MULTIPLEXERS = ("screen", "tmux")
"""Prefixes of TERM in multiplexers, which only pass characters."""


@dataclass(frozen=True)
class Terminal:
    """A terminal to draw on."""

    protocol: Protocol
    columns: int
    lines: int
    cell: tuple[int, int] = CELL
    """Size of a character [px]."""
    true_color: bool = True
    """Whether it has 24-bit colours."""
    live: bool = True
    """Whether it is a terminal, where images can replace earlier ones."""
    tmux: bool = False
    """Whether tmux is in between, which passes wrapped sequences on."""


def terminal(
    stream: IO[str],
    protocol: Protocol | None = None,
    environ: Mapping[str, str] = os.environ,
    ask: Callable[[], str] | None = None,
) -> Terminal | None:
    """Return the terminal of ``stream``, or None if it cannot show images.

    Args:
        stream: to draw on.
        protocol: the one to use, whatever it is that is drawn on; None: the best that there is.
        environ: environment of the process.
        ask: asks the terminal for its attributes and the size of a character; default: ``attributes``.
    """
    live, term = stream.isatty(), environ.get("TERM", "")
    columns, lines, *cell = _size(stream, environ)
    if protocol is None and (not live or term == "dumb"):
        return None
    answer = ""
    within = "TMUX" in environ or term.startswith(MULTIPLEXERS)
    chosen = protocol or ("blocks" if within or os.name == "nt" else _by_environment(environ))
    if (
        live
        and not within
        and os.name == "posix"
        and (chosen is None or (chosen == "sixel" and not all(cell)))
    ):
        answer = (ask or attributes)()
        chosen = chosen or ("sixel" if SIXEL.search(answer) else "blocks")
    if (size := CELL_SIZE.search(answer)) and not all(cell):
        cell = [int(size[2]), int(size[1])]
    return Terminal(
        chosen or "blocks",
        columns,
        lines,
        (cell[0], cell[1]) if all(cell) else CELL,
        _true_color(environ, term) or not live,
        live,
        "TMUX" in environ,
    )


def measured(found: Terminal, stream: IO[str], environ: Mapping[str, str] = os.environ) -> Terminal:
    """Return a terminal with its current size."""
    columns, lines, width, height = _size(stream, environ)
    return replace(
        found, columns=columns, lines=lines, cell=(width, height) if width and height else found.cell
    )


def _by_environment(environ: Mapping[str, str]) -> Protocol | None:
    term, program = environ.get("TERM", ""), environ.get("TERM_PROGRAM", "").lower()
    if "KITTY_WINDOW_ID" in environ:
        return "kitty"
    if environ.get("LC_TERMINAL") == "iTerm2":  # which ssh carries on
        return "iterm"
    return PROGRAMS.get(program) or TERMS.get(term)


def _true_color(environ: Mapping[str, str], term: str) -> bool:
    said = environ.get("COLORTERM", "").lower() in {"truecolor", "24bit"}
    return said or "direct" in term or "WT_SESSION" in environ or term in TERMS


def _size(stream: IO[str], environ: Mapping[str, str]) -> tuple[int, int, int, int]:
    """Return columns, lines, and the size of a character [px] or zeros."""
    with contextlib.suppress(OSError, ValueError, ImportError):
        import fcntl
        import termios

        packed = fcntl.ioctl(stream.fileno(), termios.TIOCGWINSZ, bytes(8))
        lines, columns, width, height = struct.unpack("HHHH", packed)
        if lines and columns:
            return columns, lines, width // columns, height // lines
    with contextlib.suppress(OSError, ValueError):
        size = os.get_terminal_size(stream.fileno())
        if size.columns and size.lines:
            return size.columns, size.lines, 0, 0
    said = [environ.get(name, "") for name in ("COLUMNS", "LINES")]
    columns, lines = (
        int(text) if text.isdecimal() and int(text) else n for text, n in zip(said, SCREEN, strict=True)
    )
    return columns, lines, 0, 0


# The terminal's own answer.

ASK = "\x1b[16t\x1b[c"
"""Queries of the character size, which some terminals answer, and of the attributes (DA1), which all do."""

ATTRIBUTES = re.compile(r"\x1b\[\?[\d;]*c")
SIXEL = re.compile(r"\x1b\[\?(?:\d+;)*4(?:;\d+)*c")
CELL_SIZE = re.compile(r"\x1b\[6;([1-9]\d{0,3});([1-9]\d{0,3})t")

PATIENCE = 1.0
"""Time to wait for the answer [s]; a later one would count as typed input."""


def attributes() -> str:
    """Return the answers of the controlling terminal; empty if there is none or it must not be asked."""
    try:
        import termios

        handle = os.open(os.ctermid(), os.O_RDWR | os.O_NOCTTY)
    except (OSError, ImportError):
        return ""
    try:
        if os.tcgetpgrp(handle) != os.getpgrp():  # a job in the background would be stopped
            return ""
        before = termios.tcgetattr(handle)
        silent = [*before[:3], before[3] & ~(termios.ICANON | termios.ECHO), *before[4:]]
        try:
            termios.tcsetattr(handle, termios.TCSADRAIN, silent)
            os.write(handle, ASK.encode())
            return _answer(handle)
        finally:
            termios.tcsetattr(handle, termios.TCSADRAIN, before)
    except (OSError, termios.error):
        return ""
    finally:
        os.close(handle)


def _answer(handle: int) -> str:
    """Return the input up to the attributes, within ``PATIENCE``."""
    text, end = "", time.monotonic() + PATIENCE
    while not ATTRIBUTES.search(text) and (left := end - time.monotonic()) > 0:
        if not select.select([handle], [], [], left)[0]:
            break
        text += os.read(handle, 1024).decode("latin-1")
    return text
