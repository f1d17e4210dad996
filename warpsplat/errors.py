"""Errors that users may meet, and all exit codes.

Each message is one line that names the thing and the cause.
"""

from __future__ import annotations

import contextlib
import errno
import reprlib
from collections.abc import Iterator
from enum import IntEnum
from typing import Any


class ExitCode(IntEnum):
    """Exit codes of the program."""

    DONE = 0
    INTERNAL = 1
    """A bug in warpsplat."""
    USAGE = 2
    """An option, batch file, device or output that cannot be used as given."""
    INPUT = 3
    """An image, SVG or checkpoint that cannot be read or is not supported."""
    OUTPUT = 4
    """The result could not be written."""
    SOME_FAILED = 5
    """Some images of a batch failed, the rest are done."""
    GOAL_MISSED = 6
    """The file is written, but a goal was missed."""
    RESOURCES = 7
    """Memory, threads or the kernel cache do not suffice, or a device cannot be used."""
    INTERRUPTED = 130
    """By Ctrl-C (128 + SIGINT); the best so far is written."""
    TERMINATED = 143
    """By SIGTERM (128 + SIGTERM); the best so far is written."""


class WarpsplatError(Exception):
    """Base of all errors raised on purpose; ``exit_code`` is the program's."""

    exit_code = ExitCode.INTERNAL


class UsageError(WarpsplatError):
    """A setting, path or device that cannot be used."""

    exit_code = ExitCode.USAGE


class ImageError(WarpsplatError):
    """An image or SVG that cannot be read or is not supported."""

    exit_code = ExitCode.INPUT


class CheckpointError(WarpsplatError):
    """A checkpoint that cannot be read, or is damaged."""

    exit_code = ExitCode.INPUT


class OutputError(WarpsplatError):
    """A result that could not be written; no partial file is left."""

    exit_code = ExitCode.OUTPUT


class ResourceError(WarpsplatError):
    """A lack of memory, threads, or space for compiled kernels; a device that cannot be used."""

    exit_code = ExitCode.RESOURCES


class DeviceError(ResourceError):
    """A GPU that cannot be used, a device that failed, or whose memory does not suffice."""

    result: Any = None
    """The ``Result`` that a run had by then; None: there was none."""
    is_lost: bool = False
    """Whether this process cannot use the device any more."""


class CapacityError(ResourceError):
    """A device array would have to grow past what the machine can hold."""


class Stopped(Exception):  # noqa: N818 - not an error
    """Raised when the caller's ``stop`` returns true; the caller catches it."""


LONGEST_MESSAGE = 1000
"""Most characters of a message: a hostile value in it must not fill the terminal."""

NO_MEMORY = (
    *("failed to allocate", "out of memory", "insufficient memory", "bad_alloc"),
    "can't start new thread",
)
"""Messages of Warp, CUDA, OpenCV, C++ and Python about a lack of resources, in lower case."""

NO_RESOURCES = {errno.ENOMEM, errno.EAGAIN, errno.EMFILE, errno.ENFILE}


@contextlib.contextmanager
def naming(name: str) -> Iterator[None]:
    """Begin the messages of ``ImageError`` with a name."""
    try:
        yield
    except ImageError as error:
        raise ImageError(f"{name}: {error}") from error


def shown(value: object) -> str:
    """Return the ``repr`` of a refused value, shortened for a message."""
    try:
        # The beginning of a list: with YAML's aliases a short text can have billions of values.
        words = reprlib.repr(value) if isinstance(value, (list, tuple, dict)) else repr(value)
    except ValueError:  # a number of thousands of digits
        words = f"a {type(value).__name__} of very many digits"
    return cut(words)


def cut(text: str, most: int = 80) -> str:
    """Return a text, shortened to ``most`` characters."""
    return text if len(text) <= most else f"{text[:most]} ..."


def cause_of(error: BaseException) -> str:
    """Return an error's cause in one line: what the system says, its message's first line, or its class."""
    if isinstance(error, OSError) and error.strerror:
        return error.strerror
    return next(iter(str(error).strip().splitlines()), type(error).__name__)


def counted(number: int, word: str) -> str:
    """Return ``1 path``, ``2 paths`` or ``2,000 paths``."""
    return f"{number:,} {word}" if number == 1 else f"{number:,} {word}s"


def printable(text: str) -> str:
    """Return ``text`` on one line, with control characters and undecodable bytes of names escaped."""
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode("ascii") for c in text)


def explain(error: BaseException) -> tuple[str, ExitCode]:
    """Return a message of one line about anything that was raised, and the exit code.

    Errors of libraries may mean a lack of memory, a panic of resvg's Rust code, or a file that the system
    refuses; any other is a bug in warpsplat.
    """
    cause = (str(error).strip().splitlines() or [""])[0]
    kind = type(error).__name__
    if isinstance(error, WarpsplatError):
        message, code = str(error), error.exit_code
    elif isinstance(error, MemoryError) or any(sign in cause.lower() for sign in NO_MEMORY):
        message, code = f"not enough memory: {cause}" if cause else "not enough memory", ExitCode.RESOURCES
    elif isinstance(error, OSError) and error.errno in NO_RESOURCES:
        message, code = f"{error.filename or 'system'}: {error.strerror}", ExitCode.RESOURCES
    elif kind == "PanicException":  # pyo3's; it derives from BaseException and cannot be imported
        message, code = f"the SVG renderer gave up: {cause}", ExitCode.INPUT
    elif isinstance(error, OSError):
        message, code = f"{error.filename or 'output'}: {error.strerror or cause or kind}", ExitCode.OUTPUT
    else:
        hint = "set WARPSPLAT_TRACEBACK=1 for the traceback"
        message, code = f"internal error: {kind}: {cause} ({hint})", ExitCode.INTERNAL
    return printable(cut(message, LONGEST_MESSAGE)), code
