"""How good a picture gets with how many shapes: by a short run whose shapes grow from few to many."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from warpsplat.alpha import squares
from warpsplat.fit.costs import Course
from warpsplat.fit.export import export
from warpsplat.fit.loop import fit
from warpsplat.fit.place import simple_curves
from warpsplat.fit.rounding import USUAL_GRID, finest
from warpsplat.fit.schedule import Phase, phases
from warpsplat.fit.settings import Settings
from warpsplat.fit.state import Past
from warpsplat.fit.work import Meter, Progress, Report
from warpsplat.portable import elementary, filters
from warpsplat.rendering.backend import Backend
from warpsplat.scene import FloatArray, Scene

FEWEST, MOST = 16, 1024
"""Shapes between which it is looked at: fewer make no likeness, more a file that is larger than many a
JPEG of the same photograph.
"""

MEASURED = 256
"""Shapes of the short run, at the most: about as many as are suggested for photographs."""

STEPS, COARSE, INTERVAL = 400, 0.9, 20
"""Of the short run: its steps, the share of them on the reduced image, and those between two turns."""

FEWER = 4
"""Times fewer shapes of the probe, by which it is seen how much quality depends on their number ..."""

PROBE, PROBE_RUN = 30, 200
"""... in so many steps at the finest size, the last ones of a run of so many: small ones."""

GAIN, GAIN_FROM, GAIN_WHOLE = 0.42, 22.0, 27.0
"""What a run of the default effort has over the short one [dB] where that has ``GAIN_WHOLE`` or more; none up
to ``GAIN_FROM`` [dB], and in between a part of it. What is hard to draw gains little (docs/experiments.md).
"""

GAIN_SIZES = 4.0, 16.0
"""Pixels of the finest size over those of the reduced image up to which there is all of that gain, and from
which on there is none: most steps see the reduced one.
"""

SLOPE = 0.79
"""What a doubling of shapes gains in such runs, over what it does from the probe to the short run."""

STEEPEST = 2.5
"""Most of that [dB]: pictures of flat areas, whose few shapes find their places late, look steeper to the
probe.
"""

BEND = 0.075
"""By how much quality grows faster than doublings of the number of shapes [dB, by their square]."""

CEILING = 100.0
"""Most decibels that are told of."""

LATER_BYTES = 0.93
"""Bytes of a run's shapes over those of the short run's: they lose opacities and digits."""


@dataclass(frozen=True)
class Worth:
    """What runs of the default effort are expected to have with ``fewest`` to ``most`` shapes.

    Decibels at the finest size of the training are a parabola over the doublings of the number of shapes;
    bytes are in proportion to it.
    """

    fewest: int
    most: int
    measured: int
    """Shapes that doublings are counted from."""
    psnr_there: float
    """With these, at the finest size [dB]."""
    slope: float
    """What the first doubling from there would gain without the bend [dB]."""
    bend: float
    """What its square adds [dB]."""
    bytes_each: float
    """Of a shape."""
    detail: float = 0.0
    """Squared error of what the finest size lacks of the image."""

    def psnr(self, shapes: float | npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
        """Of the file [dB]."""
        doublings = elementary.log2(np.asarray(shapes, np.float64) / self.measured)
        decibels = self.psnr_there + self.slope * doublings + self.bend * doublings**2
        return np.asarray(
            -10 * elementary.log10(elementary.power(10, -np.minimum(decibels, CEILING) / 10) + self.detail)
        )

    def size(self, shapes: float | npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
        """Bytes of the file."""
        return np.asarray(self.bytes_each * np.asarray(shapes, np.float64))


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
    most = min(MOST, simple_curves(image))
    measured = min(MEASURED, most)
    few = max(min(FEWEST, most), measured // FEWER)
    short, probing = _short(settings, measured), _probing(settings, few)
    height, width = image.shape[:2]
    costs = [
        Course.of(each, width, height, backend, begin=begin, finish=False).cost()
        for each, begin in ((short, 0), (probing, PROBE_RUN - PROBE))
    ]
    meter, start = Meter(report), list[tuple[Scene, Past]]()
    told = meter.stage(costs[0], costs[1])

    def note(now: Progress) -> None:
        settled = now.step % INTERVAL == 0 and now.shapes >= few
        if settled and not start and now.snapshot and now.snapshot.past:
            start.append((now.snapshot.scene(), now.snapshot.past()))
        if told:
            told(now)

    made = fit(image, short, backend, finish=False, importance=importance, report=note, stop=stop)
    if made.interrupted or not start:
        return None
    scene, past = start[0]
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
    size = len(export(made.scene, short, min(USUAL_GRID, finest(short))))
    gain = expected_gain(made.render_psnr, phases(short, width, height))
    worth = expected(most, (measured, made.render_psnr), (len(scene), probe.render_psnr), gain, size)
    return replace(worth, detail=lost_detail(image, short))


def expected(most: int, short: tuple[int, float], probe: tuple[int, float], gain: float, size: int) -> Worth:
    """What is expected up to ``most`` shapes.

    Args:
        most: shapes.
        short: those of the short run, and its decibels.
        probe: the same of the probe.
        gain: of a run over the short one [dB].
        size: bytes of the short run's file.
    """
    shapes, psnr = short
    doublings = float(elementary.log2(shapes / probe[0])) if shapes > probe[0] else 0.0
    below = (min(psnr, CEILING) - min(probe[1], CEILING)) / doublings if doublings else 0.0
    below = min(max(SLOPE * below, 0.0), STEEPEST)
    # Its rise from the probe to the short run is as measured, and nowhere does it fall.
    bend = min(BEND, below / (float(2 * elementary.log2(MEASURED / FEWEST) - elementary.log2(FEWER))))
    slope = below + bend * float(elementary.log2(FEWER))
    there, each = min(psnr, CEILING) + gain, LATER_BYTES * size / shapes
    return Worth(min(FEWEST, most), most, shapes, there, slope, bend, each)


def expected_gain(psnr: float, plan: Sequence[Phase]) -> float:
    """What a run of the default effort has over a short one with ``psnr`` and the sizes of ``plan`` [dB]."""
    first, last = (phase.width * phase.height for phase in (plan[0], plan[-1]))
    low, high = map(elementary.log, GAIN_SIZES)
    seen = min(max(float((high - elementary.log(last / first)) / (high - low)), 0.0), 1.0)
    return GAIN * seen * min(max((psnr - GAIN_FROM) / (GAIN_WHOLE - GAIN_FROM), 0.0), 1.0)


def _short(settings: Settings, shapes: int) -> Settings:
    """A run with so many shapes in the end, which begins with the fewest."""
    density = replace(settings.density, start=min(FEWEST / shapes, 1.0), interval=INTERVAL)
    return replace(settings, curves=shapes, simplify=False, iterations=STEPS, coarse=COARSE, density=density)


def _probing(settings: Settings, shapes: int) -> Settings:
    """A fit at the finest size whose shapes stay."""
    density = replace(settings.density, interval=0)
    return replace(settings, curves=shapes, simplify=False, iterations=PROBE_RUN, coarse=0.0, density=density)


def lost_detail(image: FloatArray, settings: Settings) -> float:
    """Mean squared difference of an image and what its finest size in a fit has of it."""
    height, width = image.shape[:2]
    phase = phases(settings, width, height)[-1]
    if (phase.width, phase.height) == (width, height):
        return 0.0
    small = filters.resize_area(image, (phase.width, phase.height))
    whole = filters.resize_linear(small, (width, height))
    return float(squares(whole - image).mean(dtype="float64")) / 3
