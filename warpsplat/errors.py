"""Errors that a user can cause or meet, and the one home of exit codes.

Each message is one line that names the thing and the cause.
"""

from __future__ import annotations

from enum import IntEnum


class ExitCode(IntEnum):
    """What the program ends with."""

    DONE = 0
    INTERNAL = 1
    """A fault of warpsplat itself."""
    USAGE = 2
    """An option, batch file, device or output that cannot be used as given."""
    INPUT = 3
    """An image or SVG that cannot be read or is not supported."""
    OUTPUT = 4
    """The result could not be written."""
    SOME_FAILED = 5
    """Some images of a batch failed, the rest are done."""
    GOAL_MISSED = 6
    """The file is written, but a goal was missed."""
    RESOURCES = 7
    """Memory, threads or the kernel cache do not suffice."""
    INTERRUPTED = 130
    """By Ctrl-C (128 + SIGINT); the best so far is written."""
    TERMINATED = 143
    """By SIGTERM (128 + SIGTERM); the best so far is written."""


class WarpsplatError(Exception):
    """Base of all errors raised on purpose; ``exit_code`` is what the command line ends with."""

    exit_code = ExitCode.INTERNAL


class UsageError(WarpsplatError):
    """A setting, path or device that cannot be used as given."""

    exit_code = ExitCode.USAGE


class ImageError(WarpsplatError):
    """An image (or SVG) that cannot be read or is not supported."""

    exit_code = ExitCode.INPUT


class OutputError(WarpsplatError):
    """A result that could not be written; nothing half-written is left."""

    exit_code = ExitCode.OUTPUT


class ResourceError(WarpsplatError):
    """Something that the machine cannot give: memory, threads, a place for compiled kernels."""

    exit_code = ExitCode.RESOURCES


class CapacityError(ResourceError):
    """A device array would have to grow past what the machine can hold."""


class Stopped(Exception):  # noqa: N818 - a wish that came true, no error
    """Work was given up because its caller's ``stop`` said so. The caller catches it; no user sees it."""
