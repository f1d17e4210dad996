"""Limits of the server, and the error of a request that exceeds one."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Limits:
    """Limits of what a server accepts and keeps in memory."""

    upload: int = 50_000_000
    """Size of an image's file [bytes]."""
    waiting: int = 20
    """Runs in the queue."""
    runs: int = 100
    """Runs that are held, finished ones included."""
    images: int = 256 << 20
    """All images that are held or being uploaded [bytes]; two of the largest fit in any case."""
    results: int = 128 << 20
    """All SVGs that are held [bytes]."""
    sessions: int = 100
    """Pages whose images and results are held."""
    grace: float = 120.0
    """Time until a closed page is forgotten, with its runs [s]: it may just be being reloaded."""

    @property
    def image_capacity(self) -> int:
        """Capacity for images [bytes]."""
        return max(self.images, 2 * self.upload)


class Refused(Exception):  # noqa: N818 - an answer, not a fault
    """A request that is answered with an error: its HTTP status, and one line."""

    def __init__(self, status: int, text: str) -> None:
        super().__init__(text)
        self.status = status
