"""What a server takes and holds at the most, and how it says that something is too much."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Limits:
    """Of a server."""

    upload: int = 50_000_000
    """Of an image's file [bytes]."""
    waiting: int = 20
    """Runs that wait for their turn."""
    runs: int = 100
    """Runs that are held, finished ones included."""
    images: int = 256 << 20
    """Of all images that are held or on their way [bytes]; two of the largest fit in any case."""
    results: int = 128 << 20
    """Of all SVGs that are held [bytes]."""
    sessions: int = 100
    """Pages whose images and results are held."""
    grace: float = 120.0
    """Time after which a page that was closed is forgotten, with its runs [s]: it may only be loaded anew."""

    @property
    def room(self) -> int:
        """For images [bytes]."""
        return max(self.images, 2 * self.upload)


class Refused(Exception):  # noqa: N818 - an answer, no fault
    """A request that is answered with an error: its status, and one line."""

    def __init__(self, status: int, text: str) -> None:
        super().__init__(text)
        self.status = status
        """Of HTTP."""
