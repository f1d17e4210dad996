"""What finishing a drawing costs, for progress that goes on evenly, not for results (``fit.costs``).

Fitted to the processor time of drawings of 0.04 to 0.8 million pixels with 3 to 90 shapes.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from warpsplat.drawing.fit_outlines import GAIN, PATIENCE, Refinement
from warpsplat.drawing.nodes import Edit
from warpsplat.fit.constraints import Drawing
from warpsplat.fit.costs import PIXELS, serial
from warpsplat.fit.work import Meter, Progress, Report
from warpsplat.rendering.backend import Backend
from warpsplat.scene import FloatArray, Paint
from warpsplat.scene.geometry import areas

STEP, STEP_LENGTH, STEP_PAINTED = 0.9, 0.18, 2.7
"""Of a step: of each, of a thousand pixels of outlines, of ``costs.PIXELS`` under gradients. What lies inside
shapes of one colour is known."""

STARTED = 25.0
"""What a fit takes besides its steps."""

DONE = 0.75
"""Share of a fit's steps that are taken in the mean: then nothing is gained any more."""

NEAR_END = 0.5
"""Share of ``drawing.PATIENCE`` after which a fit that gains nothing is expected to end by it."""

GRID, GRID_PIXELS, GRID_POINT = 100.0, 35.0, 0.16
"""Of choosing the grid: of each drawing, of ``costs.PIXELS``, of a point."""

FITS = 1.5
"""How often a drawing is fitted anew in a round, in the mean."""

LOOK, LOOK_PIXELS, LOOK_POINT, LOOK_CANDIDATE = 25.0, 5.0, 0.02, 0.15
"""What else a round costs: each, of ``costs.PIXELS``, of a point, of a candidate."""

ROUNDS_LEFT = 0.33
"""See ``rounds_left``."""

UNKNOWN = 10.0
"""Most rounds that are expected before two have shown what they spare: some drawings take no more."""

FALL, SLOWEST_FALL = 0.9, 0.95
"""What a round spares over the one before it: before that is known, and the most that is expected."""


@dataclass(frozen=True)
class Costs:
    """What parts of finishing a drawing cost (``fit.costs``)."""

    target: FloatArray
    drawing: Drawing
    backend: Backend

    @cached_property
    def _size(self) -> float:
        return self.target[..., 0].size / PIXELS

    @cached_property
    def _step(self) -> float:
        scene = self.drawing.scene
        on, following = self.drawing.links()
        length = np.hypot(*(scene.points[following] - scene.points[on]).T).sum()
        painted = areas(scene)[scene.paint != Paint.FLAT].sum()
        return float(STEP + STEP_LENGTH * length / 1000 + STEP_PAINTED * painted / PIXELS)

    def refit(self, how: Refinement) -> float:
        """Of fitting it, if all steps are taken."""
        return how.steps * self._step + serial(self.backend) * STARTED

    def grid(self) -> float:
        """Of choosing its grid."""
        cost = GRID + GRID_PIXELS * self._size + GRID_POINT * len(self.drawing.joints)
        return serial(self.backend) * cost

    def look(self, candidates: float) -> float:
        """Of a round of ``tidy.tidied`` that finds so many candidates, besides fitting."""
        cost = LOOK + LOOK_PIXELS * self._size + LOOK_POINT * len(self.drawing.joints)
        cost += LOOK_CANDIDATE * candidates
        return serial(self.backend) * cost


class Ending:
    """What share of its steps that are left a fit is likely to take, by the decibels that it reports."""

    def __init__(self) -> None:
        self._best, self._gained = -math.inf, 0

    def __call__(self, now: Progress) -> float:
        """Hear a report."""
        if now.psnr > self._best - 10 * math.log10(1 - GAIN):
            self._best, self._gained = now.psnr, now.step
        if now.step - self._gained < NEAR_END * PATIENCE:
            return DONE
        left = max(self._gained + PATIENCE - now.step, 0)
        return min(DONE, left / max(now.steps - now.step, 1))


class RoundsWatch:
    """The progress of the rounds in which a drawing loses nodes, of which nobody knows how many there are."""

    def __init__(self, meter: Meter, costs: Costs, how: Refinement, least: float, last: float) -> None:
        """Nothing was found yet.

        Args:
            meter: of all stages.
            costs: of the drawing.
            how: it is fitted after a round.
            least: share of the file's bytes that a round spares, or is the last.
            last: what is to be done after the rounds.
        """
        self._meter, self._costs, self._how, self._least, self._last = meter, costs, how, least, last
        self._spared: list[float] = []
        self._rest = 0.0

    def ahead(self, candidates: Sequence[Edit], edits: Sequence[Edit], most: int) -> float:
        """What rounds from one with these candidates on cost, and what comes then; see ``rounds_left``."""
        fits, number = FITS * self._costs.refit(self._how), len(candidates)
        rounds = rounds_left(candidates, edits, min(most, worthwhile_rounds(self._spared, self._least)))
        # There are fewer candidates from round to round.
        self._rest = max(rounds - 1, 0.0) * (fits + self._costs.look(number / 2)) + self._last
        return min(rounds, 1.0) * (fits + self._costs.look(number)) + self._rest

    def found(self, candidates: Sequence[Edit], edits: Sequence[Edit], most: int) -> None:
        """Take note that a round begins with these candidates."""
        self.ahead(candidates, edits, most)
        self._meter.stage(self._costs.look(len(candidates)), self._rest)  # of which nothing shows

    def spared(self, share: float) -> None:
        """Take note of the share of the file's bytes that a round spared."""
        self._spared.append(share)

    def refit(self) -> Report | None:
        """What is reported to while a drawing is fitted anew: maybe not for the last time in this round."""
        cost = self._costs.refit(self._how)
        return self._meter.stage(cost, (FITS - 1) * cost + self._rest)


def rounds_left(candidates: Sequence[Edit], edits: Sequence[Edit], most: float) -> float:
    """How many rounds there will be, the one that found ``candidates`` and tries ``edits`` of them included.

    A round disposes of about those that it tries, so that the number of candidates falls by a factor, and
    rounds go with its logarithm. The last of them are few and lie far apart, whence ``ROUNDS_LEFT``.
    """
    if not edits:
        return 0.0
    rounds = ROUNDS_LEFT * math.log1p(len(candidates)) * len(candidates) / len(edits)
    return min(max(rounds, 1.0), most)


def worthwhile_rounds(spared: Sequence[float], least: float) -> float:
    """How many rounds follow until one spares less than ``least``, by what those so far ``spared``: a share
    that falls geometrically.
    """
    if not spared:
        return UNKNOWN
    if spared[-1] <= least:
        return 1.0
    fall, most = FALL, UNKNOWN
    if len(spared) > 1:
        fall, most = (spared[-1] / spared[0]) ** (1 / (len(spared) - 1)), math.inf
    return max(min(math.log(least / spared[-1]) / math.log(min(fall, SLOWEST_FALL)), most), 1.0)
