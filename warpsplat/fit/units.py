"""What the units of the table of attributes are worth in a run."""

from __future__ import annotations

from dataclasses import dataclass

from warpsplat.fit.schedule import phases
from warpsplat.fit.settings import Settings
from warpsplat.scene import Canvas, Unit


@dataclass(frozen=True)
class Units:
    """Canvas units of one of each unit."""

    pixel: float
    """A step is counted in pixels of the finest training size, whatever the size of the image."""
    canvas: float

    @staticmethod
    def of(settings: Settings, canvas: Canvas) -> Units:
        """For a run with ``settings`` on ``canvas``."""
        finest = phases(settings, canvas.width, canvas.height)[-1]
        return Units(canvas.width / finest.width, float(max(canvas.width, canvas.height)))

    def resolve(self, value: float, unit: Unit) -> float:
        """``value`` in canvas units, or as it is where it has none."""
        return value * {Unit.ONE: 1.0, Unit.PIXEL: self.pixel, Unit.CANVAS: self.canvas}[unit]
