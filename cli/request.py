"""The image and options of a command line that are not settings."""

from __future__ import annotations

from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

from warpsplat.errors import UsageError
from warpsplat.files.inputs import STANDARD, input_name


@dataclass(frozen=True)
class Request:
    """One image, and the options of its command that are not settings."""

    image: Path
    output: Path | None = None
    importance: Path | None = None
    """File of a mask."""
    overwrite: bool = False
    device: str = "auto"
    threads: int | None = None
    verbose: int = 0
    quiet: bool = False
    as_json: bool = False

    @classmethod
    def taken(cls, image: Path, given: dict[str, Any]) -> Request:
        """Take the values of the options out of those of a command."""
        names = [field.name for field in fields(cls) if field.name in given]
        return cls(image, **{name: given.pop(name) for name in names})

    @property
    def inputs(self) -> tuple[Path, ...]:
        """Return the files that are read.

        Raises:
            UsageError: more than one of them is the standard input.
        """
        if self.image == self.importance == STANDARD:
            raise UsageError("only one of image and mask can come from the standard input")
        return (self.image,) if self.importance is None else (self.image, self.importance)

    @property
    def source(self) -> dict[str, Any]:
        """Return keyword arguments for the library's functions, besides the image and the settings."""
        return {
            "name": input_name(self.image),
            "importance": self.importance,
            "device": self.device,
            "threads": self.threads,
        }

    @property
    def flags(self) -> tuple[str, ...]:
        """Return the words of an equivalent command, besides those of settings."""
        return () if self.importance is None else ("--importance", str(self.importance))
