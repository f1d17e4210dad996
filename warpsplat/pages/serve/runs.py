"""A run that the page asked for, and the limits of what a server holds."""

from __future__ import annotations

import secrets
import threading
from dataclasses import dataclass, field
from typing import Any, Literal

from warpsplat.fit.settings import Settings
from warpsplat.pages.serve.live import LiveRun
from warpsplat.pages.serve.uploads import Upload
from warpsplat.run.result import Result

State = Literal["waiting", "running", "done", "stopped", "failed"]

FIGURES = ("psnr", "exact", "ssim", "bytes", "shapes", "seconds", "subject", "why", "notes", "reduced")
"""Keys of ``Result.as_dict`` that the page shows."""


@dataclass(frozen=True)
class Limits:
    """Limits of what a server accepts and keeps in memory."""

    upload: int = 50_000_000
    """Size of an image's file [bytes]."""
    runs: int = 100
    """Runs that are held, finished ones included."""
    images: int = 256 << 20
    """All images that are held or being uploaded [bytes]; two of the largest fit in any case."""
    results: int = 128 << 20
    """All SVGs that are held [bytes]."""
    grace: float = 120.0
    """Time until everything is forgotten once the page is closed [s]: it may just be being reloaded."""

    @property
    def image_capacity(self) -> int:
        """Capacity for images [bytes]."""
        return max(self.images, 2 * self.upload)


class Refused(Exception):  # noqa: N818 - an answer, not a fault
    """A request that is answered with an error: its HTTP status, and one line."""

    def __init__(self, status: int, text: str) -> None:
        super().__init__(text)
        self.status = status


@dataclass(frozen=True)
class Order:
    """An order for a run: the values of the form, and the settings that follow from them."""

    values: dict[str, Any]
    """Values of the form's controls, as they were given."""
    settings: Settings
    draft: Settings | None
    """Settings of the draft that is shown first; None: the settings are a draft's."""
    command: str
    """Shell command that makes the same file."""


@dataclass(eq=False)
class QueuedRun:
    """A run that the page asked for. ``Store`` changes it under its lock."""

    number: int
    """Number among all runs, from 1."""
    image: str
    """Name of the upload."""
    upload: Upload
    order: Order
    id: str = field(default_factory=lambda: secrets.token_urlsafe(8))
    state: State = "waiting"
    live: LiveRun = field(default_factory=LiveRun)
    stopping: threading.Event = field(default_factory=threading.Event)
    """Set to end the run with its current shapes."""
    result: Result | None = None
    svg: bytes = b""
    figures: dict[str, Any] = field(default_factory=dict)
    error: str = ""

    @property
    def is_over(self) -> bool:
        """Whether it is done, stopped or failed."""
        return self.state not in {"waiting", "running"}

    def finish(self, outcome: Result | str) -> None:
        """Take the result, or the error."""
        if isinstance(outcome, str):
            self.error, self.state = outcome, "failed"
        else:
            figures = outcome.as_dict()
            self.result, self.svg = outcome, outcome.svg.encode()
            self.figures = {name: figures[name] for name in FIGURES if name in figures}
            self.state = "stopped" if outcome.stopped else "done"
        self.live.picture = b""

    def as_dict(self, place: int) -> dict[str, Any]:
        """Return the state for JSON; ``place``: the number of runs before it."""
        names = ("id", "number", "image", "state", "error", "figures")
        found = {name: getattr(self, name) for name in names}
        found |= {"values": self.order.values, "command": self.order.command}
        if self.state == "waiting":
            found["place"] = place
        elif self.state == "running":
            found |= {"live": self.live.as_dict(), "stopping": self.stopping.is_set()}
        return found
