"""Errors that a user can cause or meet. Each message is one line that names the thing and the cause."""


class WarpsplatError(Exception):
    """Base of all errors raised on purpose; ``exit_code`` is what the command line ends with."""

    exit_code = 1


class UsageError(WarpsplatError):
    """A setting, path or device that cannot be used as given."""

    exit_code = 2


class ImageError(WarpsplatError):
    """An image (or SVG) that cannot be read or is not supported."""

    exit_code = 3


class OutputError(WarpsplatError):
    """A result that could not be written; nothing half-written is left."""

    exit_code = 4


class CapacityError(WarpsplatError):
    """A device array would have to grow past what the machine can hold."""
