"""A run that a page asked for, from its place in the queue to its file."""

from __future__ import annotations

import threading
from dataclasses import dataclass, field
from typing import Any, Literal

from warpsplat.fit.settings import Settings
from warpsplat.pages.serve.live import Live
from warpsplat.pages.serve.pictures import Picture
from warpsplat.run.result import Result

State = Literal["waiting", "running", "done", "stopped", "failed"]

FIGURES = (
    "psnr",
    "ssim",
    "ssimulacra2",
    "bytes",
    "gzip_bytes",
    "shapes",
    "seconds",
    "subject",
    "why",
    "reduced",
)
"""Of a result, as ``Result.as_dict`` names them: what the page shows."""


@dataclass(eq=False)
class ServedRun:
    """One run. ``Store`` changes it under its lock."""

    id: str
    number: int
    """Of its session's runs, from 1."""
    image: str
    """By which its session knows the picture."""
    picture: Picture
    values: dict[str, Any]
    """Settings, as they were given."""
    settings: Settings
    command: str
    """What makes the same file in a shell."""
    state: State = "waiting"
    live: Live = field(default_factory=Live)
    stopping: threading.Event = field(default_factory=threading.Event)
    """Set once it shall end with the shapes as they are."""
    svg: bytes = b""
    figures: dict[str, Any] = field(default_factory=dict)
    error: str = ""

    @property
    def is_over(self) -> bool:
        """Whether nothing of it is to come."""
        return self.state not in {"waiting", "running"}

    def finish(self, result: Result) -> None:
        """Take what it made."""
        figures = result.as_dict()
        self.svg = result.svg.encode()
        self.figures = {name: figures[name] for name in FIGURES if name in figures}
        self.state = "stopped" if result.stopped else "done"
        self.live.picture = b""

    def fail(self, error: str) -> None:
        """End without a file."""
        self.error, self.state = error, "failed"
        self.live.picture = b""

    def as_dict(self, place: int) -> dict[str, Any]:
        """For JSON. ``place``: runs that are before it."""
        told = {
            "id": self.id,
            "number": self.number,
            "image": self.image,
            "values": self.values,
            "command": self.command,
            "state": self.state,
            "error": self.error,
        }
        if self.state == "waiting":
            told["place"] = place
        elif self.state == "running":
            told |= {"live": self.live.as_dict(), "stopping": self.stopping.is_set()}
        return told | {"figures": self.figures}
