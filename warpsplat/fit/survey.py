"""How good a picture gets with how many shapes: by a short fit whose shapes grow from few to many."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import cv2
import numpy as np
import numpy.typing as npt

from warpsplat.alpha import squares
from warpsplat.fit.costs import Course
from warpsplat.fit.export import export
from warpsplat.fit.loop import fit
from warpsplat.fit.place import simple_curves
from warpsplat.fit.rounding import USUAL_GRID, finest
from warpsplat.fit.schedule import Phase, phases
from warpsplat.fit.settings import Density, Settings
from warpsplat.fit.state import Past
from warpsplat.fit.work import Meter, Progress, Report
from warpsplat.rendering.backend import Backend
from warpsplat.scene import FloatArray, Scene

FEWEST, MOST = 16, 1024
"""Shapes between which it is measured: fewer make no likeness, more a file that is larger than many a
JPEG of the same photograph.
"""

STEPS, INTERVAL = 400, 20
"""Of the fit; and between two times that shapes come."""

SETTLED = 2.0
"""Shapes over ``FEWEST`` from which on the fit says something: the first ones have just been placed."""

PROBED = 256
"""Shapes with which it is measured what that misses: the reduced image lacks details."""

PROBE = 30
"""Steps of that, at the finest size ..."""

PROBE_RUN = 200
"""... as the last ones of a run of so many: small ones."""

GAIN_AT, GAIN_DOUBLES = 25.0, 4.3
"""A run of the default effort gains a decibel over a probe of so many [dB], and twice as much over one that
has so much more [dB]: what is easily drawn gains most (docs/experiments.md).
"""

MOST_GAIN, HARD = 5.0, 4.0
"""Most of this gain [dB], and most of its product with what the probe lacks of the decibels that the reduced
image has [dB squared]: where that is much, there are details that shapes are too few for.
"""

SMALL, LARGE = 0.5, 3.5
"""Share of that gain where the image is so small that it was not reduced, as the survey has seen all of it;
and from how many times fewer pixels on it is all of the gain.
"""

LATER_BYTES = 0.92
"""Bytes of a run's shapes over those of the survey's: they lose points and opacities."""


@dataclass(frozen=True)
class Worth:
    """Quality and size by the number of shapes, from ``fewest`` to ``most``.

    On the reduced image decibels are a parabola over the logarithm of the number. A run's squared error is
    that of the reduced image times ``factor``, and what is left of its ``detail``. Bytes are a power of the
    number.
    """

    fewest: int
    most: int
    parabola: tuple[float, float, float]
    """Coefficients for log2(shapes), the highest power first [dB]."""
    power: tuple[float, float]
    """Of log2(bytes), likewise."""
    misfit: float
    """Root of the mean squared distance of the measured decibels from the parabola [dB]."""
    factor: float = 1.0
    detail: float = 0.0

    def reduced(self, shapes: float | npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
        """Mean squared error on the reduced image."""
        return np.asarray(10 ** (-np.polyval(self.parabola, np.log2(shapes)) / 10))

    def psnr(self, shapes: float | npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
        """What a run of the default effort is expected to have with so many shapes [dB]."""
        return np.asarray(-10 * np.log10(self.factor * self.reduced(shapes) + self.detail))

    def size(self, shapes: float | npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
        """Bytes that its file is expected to have."""
        return np.asarray(2 ** np.polyval(self.power, np.log2(shapes)))

    def through(self, shapes: int, psnr: float, lost: float) -> Worth:
        """What is expected where a run with ``shapes`` has ``psnr`` at the finest size [dB]; of the error
        ``lost`` is what this size lacks of the image, squared.
        """
        error, before = 10 ** (-psnr / 10), float(self.reduced(shapes))
        if error < before:
            return replace(self, factor=error / before, detail=lost)
        return replace(self, factor=1.0, detail=error - before + lost)


@dataclass
class _Seen:
    """What is noted of the fit."""

    shapes: list[int] = field(default_factory=list)
    decibels: list[float] = field(default_factory=list)
    sizes: list[int] = field(default_factory=list)
    probed: tuple[Scene, Past] | None = None


def survey(
    image: FloatArray,
    settings: Settings,
    backend: Backend,
    *,
    importance: FloatArray | None = None,
    report: Report | None = None,
    stop: Callable[[], bool] | None = None,
) -> Worth | None:
    """What numbers of shapes are worth on an image; None where it was stopped. See ``fit`` for arguments."""
    most = max(FEWEST, min(MOST, simple_curves(image)))
    growing = _growing(settings, most)
    probing = _probing(settings, min(PROBED, most))
    height, width = image.shape[:2]
    costs = [
        Course.of(each, width, height, backend, begin=begin, finish=False).cost()
        for each, begin in ((growing, 0), (probing, PROBE_RUN - PROBE))
    ]
    meter, seen = Meter(report), _Seen()
    told = meter.stage(costs[0], costs[1])

    def note(now: Progress) -> None:
        if now.step % INTERVAL == 0 and now.snapshot and now.shapes >= min(SETTLED * FEWEST, most):
            scene = now.snapshot.scene()
            seen.shapes.append(now.shapes)
            seen.decibels.append(now.psnr)
            seen.sizes.append(len(export(scene, growing, min(USUAL_GRID, finest(growing)))))
            if now.snapshot.past and not seen.probed and now.shapes >= min(PROBED, most):
                seen.probed = scene, now.snapshot.past()
        if told:
            told(now)

    made = fit(image, growing, backend, finish=False, importance=importance, report=note, stop=stop)
    if made.interrupted or seen.probed is None:
        return None
    worth = worth_by(seen.shapes, seen.decibels, seen.sizes, most)
    scene, past = seen.probed
    probe = fit(
        image,
        replace(probing, curves=len(scene)),
        backend,
        scene=scene,
        past=past,
        begin=PROBE_RUN - PROBE,
        finish=False,
        importance=importance,
        report=meter.stage(costs[1], 0),
        stop=stop,
    )
    if probe.interrupted:
        return None
    psnr = probe.render_psnr
    gain = expected_gain(psnr, -10 * math.log10(float(worth.reduced(len(scene)))) - psnr)
    psnr += gain * share_of_gain(phases(growing, width, height))
    return worth.through(len(scene), psnr, lost_detail(image, probing))


def expected_gain(psnr: float, lacking: float) -> float:
    """What a run of the default effort has over a probe with ``psnr`` [dB], which lacks so many of the
    decibels of the reduced image.
    """
    most = HARD / lacking if lacking > 0 else MOST_GAIN
    return float(min(2 ** ((psnr - GAIN_AT) / GAIN_DOUBLES), most, MOST_GAIN))


def share_of_gain(plan: Sequence[Phase]) -> float:
    """How much of the gain there is by ``plan``: of the first size is the survey, of the last the run."""
    first, last = (phase.width * phase.height for phase in (plan[0], plan[-1]))
    return SMALL + (1 - SMALL) * min(math.log(last / first) / math.log(LARGE), 1.0)


def _growing(settings: Settings, most: int) -> Settings:
    """A fit on the reduced image whose shapes grow all the way, geometrically, without a surplus."""
    all_the_way = dict.fromkeys(("surplus", "grown", "thin", "stop"), 1.0)
    density = replace(settings.density, start=FEWEST / most, interval=INTERVAL)
    density = Density(**{**vars(density), **all_the_way})
    return replace(settings, curves=most, simplify=False, iterations=STEPS, coarse=1.0, density=density)


def _probing(settings: Settings, shapes: int) -> Settings:
    """A fit at the finest size whose shapes stay."""
    density = replace(settings.density, interval=0)
    return replace(settings, curves=shapes, simplify=False, iterations=PROBE_RUN, coarse=0.0, density=density)


def worth_by(
    shapes: list[int], decibels: list[float], sizes: list[int], most: int, fewest: int = FEWEST
) -> Worth:
    """What fits best what was measured on the reduced image, shape (measurement,) each."""
    x = np.log2(np.array(shapes, np.float64))
    degree = min(2, len(set(shapes)) - 1)
    parabola = [0.0] * (2 - degree) + np.polyfit(x, decibels, degree).tolist()
    degree = min(1, degree)
    power = [0.0] * (1 - degree) + np.polyfit(x, np.log2(LATER_BYTES * np.array(sizes)), degree).tolist()
    misfit = float(np.sqrt(np.mean((np.polyval(parabola, x) - decibels) ** 2)))
    a, b, c = parabola
    return Worth(fewest, most, (a, b, c), (power[0], power[1]), misfit)


def lost_detail(image: FloatArray, settings: Settings) -> float:
    """Mean squared difference of an image and what its finest size in a fit has of it."""
    height, width = image.shape[:2]
    phase = phases(settings, width, height)[-1]
    if (phase.width, phase.height) == (width, height):
        return 0.0
    small = cv2.resize(image, (phase.width, phase.height), interpolation=cv2.INTER_AREA)
    whole = cv2.resize(small, (width, height), interpolation=cv2.INTER_CUBIC)
    return float(squares(whole - image).mean(dtype="float64")) / 3
