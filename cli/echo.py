"""Print: figures to stdout, everything else to stderr, as printable lines."""

from __future__ import annotations

import contextlib
import logging
import os
import sys
from collections.abc import Iterator

import click

from warpsplat.errors import OutputError, printable
from warpsplat.native import discard_output, write_message


def open_standard_streams() -> None:
    """Open descriptors 0, 1 and 2 if they are closed, or the next file opened would get such a number."""
    for number, (name, mode) in enumerate((("stdin", "r"), ("stdout", "w"), ("stderr", "w"))):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # becomes the lowest free number, which is this one
        if getattr(sys, name) is None:
            setattr(sys, name, os.fdopen(number, mode, encoding="utf-8", closefd=False))
        reconfigure = getattr(getattr(sys, name), "reconfigure", None)
        if mode == "w" and reconfigure:  # characters that the terminal's encoding lacks are escaped
            reconfigure(errors="backslashreplace")


def echo(text: str, *, err: bool = False) -> None:
    """Print lines with control characters escaped. Errors in writing to stderr are ignored.

    Raises ``OutputError`` if stdout cannot be written, ``BrokenPipeError`` if its reader has gone.
    """
    text = "\n".join(printable(line) for line in text.split("\n"))
    try:
        click.echo(text, err=err)
    except OSError as error:
        silence(sys.stderr if err else sys.stdout)  # what is left in its buffer cannot be written either
        if err:
            return
        if isinstance(error, BrokenPipeError):
            raise
        raise OutputError(f"standard output: could not be written: {error.strerror or error}") from error


def silence(stream: object) -> None:
    """Discard what is left in a stream's buffer and all further output."""
    with contextlib.suppress(OSError, ValueError, AttributeError):
        discard_output(stream.fileno())  # type: ignore[attr-defined]


class _Notices(logging.Handler):
    """Prints the library's notices to stderr; passing ones, on terminals only, as a line that is replaced."""

    def __init__(self, *, terminal: bool) -> None:
        super().__init__()
        self._start = "\r\x1b[2K" if terminal else ""  # a progress bar may stand in the line
        self._terminal = terminal

    def emit(self, record: logging.LogRecord) -> None:
        text = printable(record.getMessage())
        with contextlib.suppress(OSError):
            if not getattr(record, "passing", False):
                click.echo(f"{self._start}warpsplat: {text}", err=True)
            elif self._terminal:
                write_message(self._start + (f"warpsplat: {text}" if text else ""))


@contextlib.contextmanager
def notices() -> Iterator[None]:
    """Print the library's warnings, and on a terminal its activity; ``set_verbosity`` changes that."""
    log = logging.getLogger("warpsplat")
    before, handler = (log.propagate, log.level), _Notices(terminal=sys.stderr.isatty())
    log.addHandler(handler)
    log.propagate = False
    log.setLevel(logging.INFO if sys.stderr.isatty() else logging.WARNING)
    try:
        yield
    finally:
        log.removeHandler(handler)
        log.propagate = before[0]
        log.setLevel(before[1])


def set_verbosity(*, quiet: bool) -> None:
    """Print errors only, or everything."""
    logging.getLogger("warpsplat").setLevel(logging.ERROR if quiet else logging.INFO)
