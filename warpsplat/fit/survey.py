"""How good a picture gets with how many shapes: by a short fit whose shapes grow from few to many."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import cv2
import numpy as np
import numpy.typing as npt

from warpsplat.alpha import squares
from warpsplat.fit.export import export
from warpsplat.fit.loop import fit
from warpsplat.fit.place import simple_curves
from warpsplat.fit.rounding import USUAL_GRID, finest
from warpsplat.fit.schedule import phases
from warpsplat.fit.settings import Settings
from warpsplat.fit.work import Progress, Report
from warpsplat.rendering.backend import Backend
from warpsplat.scene import FloatArray

FEWEST, MOST = 16, 1024
"""Shapes between which the knee is looked for: below is no likeness, above a file is seldom smaller than a
photograph's JPEG.
"""

STEPS, INTERVAL = 400, 20
"""Of the fit; and between two times that shapes come."""

SETTLED = 2.0
"""Shapes over ``FEWEST`` from which on the fit says something: the first ones have just been placed."""

LATER_ERROR = 0.93
"""Squared error of a run of the default effort over that of the survey's fit with as many shapes."""

DETAIL = 0.55
"""Share of the details that the reduced image lacks which runs at the full size do not show either."""

LATER_BYTES = 0.92
"""Bytes of a run's shapes over those of the survey's: they lose points and opacities."""


@dataclass(frozen=True)
class Curve:
    """Quality and size as functions of the number of shapes, from ``fewest`` to ``most``.

    The error falls as a power of the number of shapes, whose exponent changes slowly: decibels are a parabola
    over the logarithm of the number. Bytes are a power of it.
    """

    fewest: int
    most: int
    parabola: tuple[float, float, float]
    """Decibels of the reduced picture: coefficients of log2(shapes), the highest power first."""
    detail: float
    """Squared error that is left of details in any case."""
    power: tuple[float, float]
    """Of the bytes: coefficients of log2(shapes) for log2(bytes)."""
    misfit: float
    """Root of the mean squared distance of the measured decibels from the parabola [dB]."""

    def psnr(self, shapes: float | npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
        """What a run of the default effort is expected to have with so many shapes [dB]."""
        reduced = 10 ** (-np.polyval(self.parabola, np.log2(shapes)) / 10)
        return np.asarray(-10 * np.log10(LATER_ERROR * reduced + self.detail))

    def size(self, shapes: float | npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
        """Bytes that its file is expected to have."""
        return np.asarray(2 ** np.polyval(self.power, np.log2(shapes)))


def survey(
    image: FloatArray,
    settings: Settings,
    backend: Backend,
    *,
    importance: FloatArray | None = None,
    report: Report | None = None,
    stop: Callable[[], bool] | None = None,
) -> Curve | None:
    """Measure the curve of an image; None where it was stopped. Arguments are those of ``fit``."""
    most = max(FEWEST, min(MOST, simple_curves(image)))
    chosen = _surveying(settings, most)
    seen: list[tuple[int, float, int]] = []

    def told(now: Progress) -> None:
        if now.step % INTERVAL == 0 and now.snapshot and now.shapes >= min(SETTLED * FEWEST, most):
            size = len(export(now.snapshot.scene(), chosen, min(USUAL_GRID, finest(chosen))))
            seen.append((now.shapes, now.psnr, size))
        if report:
            report(now)

    made = fit(image, chosen, backend, finish=False, importance=importance, report=told, stop=stop)
    if made.interrupted:
        return None
    return curve_through(seen, FEWEST, most, detail_of(image, chosen))


def _surveying(settings: Settings, most: int) -> Settings:
    """A fit on the reduced image whose shapes grow all the way, geometrically, without a surplus."""
    density = replace(
        settings.density,
        start=FEWEST / most,
        surplus=1.0,
        grown=1.0,
        thin=1.0,
        stop=1.0,
        interval=INTERVAL,
    )
    return replace(settings, curves=most, simplify=False, iterations=STEPS, coarse=1.0, density=density)


def curve_through(seen: list[tuple[int, float, int]], fewest: int, most: int, detail: float) -> Curve:
    """The curve that fits measured shapes, decibels and bytes best; see ``Curve``."""
    shapes, decibels, sizes = (np.array(column, np.float64) for column in zip(*seen, strict=True))
    x = np.log2(shapes)
    degree = min(2, len(np.unique(x)) - 1)
    found = np.polyfit(x, decibels, degree)
    parabola = np.concatenate([np.zeros(2 - degree), found])
    power = np.polyfit(x, np.log2(LATER_BYTES * sizes), 1) if degree else np.array([0.0, math.log2(sizes[0])])
    misfit = float(np.sqrt(np.mean((np.polyval(parabola, x) - decibels) ** 2)))
    a, b, c = map(float, parabola)
    return Curve(fewest, most, (a, b, c), DETAIL * detail, (float(power[0]), float(power[1])), misfit)


def detail_of(image: FloatArray, settings: Settings) -> float:
    """Mean squared difference of an image and what its reduced size, which ``settings`` say, has of it."""
    height, width = image.shape[:2]
    phase = phases(settings, width, height)[0]
    if (phase.width, phase.height) == (width, height):
        return 0.0
    small = cv2.resize(image, (phase.width, phase.height), interpolation=cv2.INTER_AREA)
    whole = cv2.resize(small, (width, height), interpolation=cv2.INTER_CUBIC)
    return float(squares(whole - image).mean(dtype="float64")) / 3
