"""Estimate quality and size by the number of shapes, from one short fit and a probe with fewer shapes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from warpsplat.alpha import squares
from warpsplat.fit.export import export
from warpsplat.fit.loop import fit
from warpsplat.fit.place import simple_curves
from warpsplat.fit.problem import Problem, Run, Start
from warpsplat.fit.progress import Progress
from warpsplat.fit.rounding import USUAL_GRID, finest
from warpsplat.fit.schedule import Phase, phases
from warpsplat.fit.settings import Settings
from warpsplat.fit.state import Past
from warpsplat.portable import elementary, filters
from warpsplat.scene import FloatArray, Scene

FEWEST_SHAPES, MOST_SHAPES = 16, 1024
"""Range of the number of shapes: fewer show no likeness, more make a file larger than many a JPEG of the same
photograph.
"""

MEASURED = 256
"""Most shapes of the short fit: about as many as are suggested for photographs."""

SHORT_STEPS, SHORT_COARSE, SHORT_INTERVAL = 400, 0.9, 20
"""Steps of the short fit, the share of them on the reduced image, and those between densification steps."""

SHORT_END = 0.9
"""Share of the progress at which the short fit is done, and the probe begins."""

FEWER = 4
"""How many times fewer shapes the probe has, which shows how quality depends on their number."""

PROBE, PROBE_RUN = 30, 200
"""Steps of the probe at the finest size: the last ones, which are small, of a schedule of so many."""

EFFORT_GAIN, GAIN_FROM, GAIN_WHOLE = 0.42, 22.0, 27.0
"""Gain of a run of the default effort over the short fit [dB] if that reaches ``GAIN_WHOLE`` dB; none up to
``GAIN_FROM`` dB, and in between a part of it. What is hard to draw gains little (docs/experiments.md).
"""

GAIN_SIZES = 4.0, 16.0
"""Ratios of the finest to the reduced size [pixels] of full gain, and of none: most steps see the latter."""

SLOPE = 0.79
"""Gain by a doubling of shapes in such runs, over the gain from the probe to the short fit."""

STEEPEST = 2.5
"""Largest gain by a doubling [dB]: the probe overestimates it for pictures of flat areas, whose few
shapes find their places late.
"""

BEND = 0.075
"""Growth of quality with the square of the number of doublings [dB]."""

CEILING = 100.0
"""Highest PSNR that is estimated [dB]."""

LATER_BYTES = 0.93
"""Bytes of a run's shapes over those of the short fit's: they lose opacities and digits."""


@dataclass(frozen=True)
class Worth:
    """Expected quality and size of runs of the default effort with ``fewest`` to ``most`` shapes.

    Decibels at the finest size of the training are a parabola over the doublings of the number of shapes;
    bytes are in proportion to it.
    """

    fewest: int
    most: int
    measured: int
    """Shapes that doublings are counted from."""
    psnr_there: float
    """PSNR with these, at the finest size [dB]."""
    slope: float
    """Gain of the first doubling from there, without the bend [dB]."""
    bend: float
    """Gain by the square of the doublings [dB]."""
    bytes_each: float
    """Bytes of a shape."""
    detail: float = 0.0
    """Mean squared error of the image at the finest size."""

    def psnr(self, shapes: float | npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
        """Return the PSNR of the file [dB]."""
        doublings = elementary.log2(np.asarray(shapes, np.float64) / self.measured)
        decibels = self.psnr_there + self.slope * doublings + self.bend * doublings**2
        return np.asarray(
            -10 * elementary.log10(elementary.power(10, -np.minimum(decibels, CEILING) / 10) + self.detail)
        )

    def size(self, shapes: float | npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
        """Return the bytes of the file."""
        return np.asarray(self.bytes_each * np.asarray(shapes, np.float64))


def survey(problem: Problem, run: Run) -> Worth | None:
    """Estimate what numbers of shapes give on an image; None if the run was stopped."""
    image, settings = problem.target, problem.settings
    most = min(MOST_SHAPES, simple_curves(image))
    measured = min(MEASURED, most)
    few = max(min(FEWEST_SHAPES, most), measured // FEWER)
    short, probing = _short(settings, measured), _probing(settings, few)
    start = list[tuple[Scene, Past]]()

    def keep(now: Progress) -> Progress:
        settled = now.step % SHORT_INTERVAL == 0 and now.shapes >= few
        if settled and not start and now.snapshot and now.snapshot.past:
            start.append((now.snapshot.scene(), now.snapshot.past()))
        return now

    made = fit(replace(problem, settings=short), run.part(0.0, SHORT_END).mapped(keep), rounding=None)
    if made.interrupted or not start:
        return None
    scene, past = start[0]
    probing = replace(probing, curves=len(scene))
    begin = Start(scene, past, PROBE_RUN - PROBE)
    probe = fit(replace(problem, settings=probing), run.part(SHORT_END, 1.0), begin, None)
    if probe.interrupted:
        return None
    size = len(export(made.scene, short, min(USUAL_GRID, finest(short))))
    gain = expected_gain(made.render_psnr, phases(short, *problem.size))
    worth = expected(most, (measured, made.render_psnr), (len(scene), probe.render_psnr), gain, size)
    return replace(worth, detail=lost_detail(image, short))


def expected(most: int, short: tuple[int, float], probe: tuple[int, float], gain: float, size: int) -> Worth:
    """Estimate quality and size up to ``most`` shapes.

    ``short`` and ``probe`` are the shapes and PSNR of these fits, ``size`` the bytes of the short one's
    file, and ``gain`` that of a run over the short fit [dB].
    """
    shapes, psnr = short
    doublings = float(elementary.log2(shapes / probe[0])) if shapes > probe[0] else 0.0
    below = (min(psnr, CEILING) - min(probe[1], CEILING)) / doublings if doublings else 0.0
    below = min(max(SLOPE * below, 0.0), STEEPEST)
    # The rise from the probe to the short fit is as measured, and the curve falls nowhere.
    bend = min(BEND, below / (float(2 * elementary.log2(MEASURED / FEWEST_SHAPES) - elementary.log2(FEWER))))
    slope = below + bend * float(elementary.log2(FEWER))
    there, each = min(psnr, CEILING) + gain, LATER_BYTES * size / shapes
    return Worth(min(FEWEST_SHAPES, most), most, shapes, there, slope, bend, each)


def expected_gain(psnr: float, plan: Sequence[Phase]) -> float:
    """Return the gain of a run of the default effort over a short fit with ``psnr`` [dB]."""
    first, last = (phase.width * phase.height for phase in (plan[0], plan[-1]))
    low, high = map(elementary.log, GAIN_SIZES)
    seen = min(max(float((high - elementary.log(last / first)) / (high - low)), 0.0), 1.0)
    return EFFORT_GAIN * seen * min(max((psnr - GAIN_FROM) / (GAIN_WHOLE - GAIN_FROM), 0.0), 1.0)


def _short(settings: Settings, shapes: int) -> Settings:
    """Return the settings of the short fit, which grows from the fewest shapes to ``shapes``."""
    density = replace(settings.density, start=min(FEWEST_SHAPES / shapes, 1.0), interval=SHORT_INTERVAL)
    return replace(
        settings, curves=shapes, simplify=False, iterations=SHORT_STEPS, coarse=SHORT_COARSE, density=density
    )


def _probing(settings: Settings, shapes: int) -> Settings:
    """Return the settings of the probe, a fit at the finest size whose shapes stay."""
    density = replace(settings.density, interval=0)
    return replace(settings, curves=shapes, simplify=False, iterations=PROBE_RUN, coarse=0.0, density=density)


def lost_detail(image: FloatArray, settings: Settings) -> float:
    """Return the mean squared difference of an image and its finest size in a fit."""
    height, width = image.shape[:2]
    phase = phases(settings, width, height)[-1]
    if (phase.width, phase.height) == (width, height):
        return 0.0
    small = filters.resize_area(image, (phase.width, phase.height))
    whole = filters.resize_linear(small, (width, height))
    return float(squares(whole - image).mean(dtype="float64")) / 3
