"""Limits of a server, and the error for exceeding them."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Limits:
    """Limits of a server."""

    upload: int = 50_000_000
    """Maximum size of an image's file [bytes]."""
    waiting: int = 20
    """Maximum number of waiting runs."""
    runs: int = 100
    """Maximum number of runs, finished ones included."""
    images: int = 256 << 20
    """Maximum size of all images, stored or being uploaded [bytes]; two of the largest always fit."""
    results: int = 128 << 20
    """Maximum size of all SVGs [bytes]."""
    sessions: int = 100
    """Maximum number of sessions."""
    grace: float = 120.0
    """Time until a closed page and its runs are deleted [s]; it may just be reloading."""

    @property
    def room(self) -> int:
        """Space for images [bytes]."""
        return max(self.images, 2 * self.upload)


class Refused(Exception):  # noqa: N818 - an answer, no fault
    """An error response: a status, and one line."""

    def __init__(self, status: int, text: str) -> None:
        super().__init__(text)
        self.status = status
        """HTTP status."""
