"""Conversion of the units in the table of attributes to canvas units."""

from __future__ import annotations

from dataclasses import dataclass

from warpsplat.fit.schedule import phases
from warpsplat.fit.settings import Settings
from warpsplat.scene import Canvas, Unit


@dataclass(frozen=True)
class Units:
    """Length of each unit in canvas units."""

    pixel: float
    """A pixel of the finest training size, so that learning rates do not depend on the image's size."""
    canvas: float

    @staticmethod
    def of(settings: Settings, canvas: Canvas) -> Units:
        """Return the units of a run with ``settings`` on ``canvas``."""
        finest = phases(settings, canvas.width, canvas.height)[-1]
        return Units(canvas.width / finest.width, float(max(canvas.width, canvas.height)))

    def resolve(self, value: float, unit: Unit) -> float:
        """Return ``value`` in canvas units; a value without a unit stays as it is."""
        return value * {Unit.ONE: 1.0, Unit.PIXEL: self.pixel, Unit.CANVAS: self.canvas}[unit]
