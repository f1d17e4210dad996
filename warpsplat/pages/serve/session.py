"""A page that is open: what it gave, and what was made of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from warpsplat.pages.serve.pictures import Picture
from warpsplat.pages.serve.runs import ServedRun


@dataclass(eq=False)
class Session:
    """A page: its images and runs, oldest first."""

    id: str
    seen: float
    """When it was opened, or the last of its readers left."""
    readers: int = 0
    """Streams of events that are open."""
    begun: int = 0
    """Runs so far."""
    pictures: dict[str, Picture] = field(default_factory=dict)
    runs: dict[str, ServedRun] = field(default_factory=dict)

    def runs_of(self, image: str) -> list[ServedRun]:
        """Of one image."""
        return [run for run in self.runs.values() if run.image == image]

    def as_dict(self, places: Mapping[ServedRun, int]) -> dict[str, Any]:
        """For JSON. ``places``: of runs that wait, how many are before them."""
        return {
            "images": [{"id": name} | picture.as_dict() for name, picture in self.pictures.items()],
            "runs": [run.as_dict(places.get(run, 0)) for run in self.runs.values()],
        }
