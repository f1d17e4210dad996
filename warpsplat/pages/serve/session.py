"""An open page, with its images and results."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from warpsplat.pages.serve.pictures import Picture
from warpsplat.pages.serve.runs import Run


@dataclass(eq=False)
class Session:
    """A page: its images and runs, oldest first."""

    id: str
    seen: float
    """Time at which it was opened or its last reader left."""
    readers: int = 0
    """Number of open event streams."""
    begun: int = 0
    """Number of runs so far."""
    pictures: dict[str, Picture] = field(default_factory=dict)
    runs: dict[str, Run] = field(default_factory=dict)

    def runs_of(self, image: str) -> list[Run]:
        """Return the runs of one image."""
        return [run for run in self.runs.values() if run.image == image]

    def as_dict(self, places: Mapping[Run, int]) -> dict[str, Any]:
        """Return JSON values. ``places``: of waiting runs, the number of runs before them."""
        return {
            "images": [{"id": name} | picture.as_dict() for name, picture in self.pictures.items()],
            "runs": [run.as_dict(places.get(run, 0)) for run in self.runs.values()],
        }
