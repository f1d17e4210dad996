"""A run of a page, from the queue to its file."""

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
"""Figures of ``Result.as_dict`` that the page shows."""


@dataclass(eq=False)
class Run:
    """One run. ``Store`` changes it under its lock."""

    id: str
    number: int
    """Number within its session, from 1."""
    image: str
    """Name of its image in the session."""
    picture: Picture
    values: dict[str, Any]
    """Settings as given."""
    settings: Settings
    command: str
    """The command that makes the same file."""
    state: State = "waiting"
    live: Live = field(default_factory=Live)
    stopping: threading.Event = field(default_factory=threading.Event)
    """Set to stop it with the shapes so far."""
    svg: bytes = b""
    figures: dict[str, Any] = field(default_factory=dict)
    error: str = ""

    @property
    def is_over(self) -> bool:
        """Whether it is finished."""
        return self.state not in {"waiting", "running"}

    def finish(self, result: Result) -> None:
        """Set its result."""
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
        """Return JSON values. ``place``: number of runs before it."""
        values = {
            "id": self.id,
            "number": self.number,
            "image": self.image,
            "values": self.values,
            "command": self.command,
            "state": self.state,
            "error": self.error,
        }
        if self.state == "waiting":
            values["place"] = place
        elif self.state == "running":
            values |= {"live": self.live.as_dict(), "stopping": self.stopping.is_set()}
        return values | {"figures": self.figures}
