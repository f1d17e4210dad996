"""Runs on the way to a goal: from the start, and again from where shapes went or came."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from warpsplat.fit.density import densify
from warpsplat.fit.export import export
from warpsplat.fit.importance import pixel_weights
from warpsplat.fit.loop import Fit, Progress, fit
from warpsplat.fit.rounding import STAGES, stage_steps
from warpsplat.fit.schedule import phases
from warpsplat.fit.settings import Settings
from warpsplat.fit.state import FitState
from warpsplat.fit.step import Step, Target
from warpsplat.metrics import score_svg
from warpsplat.rendering.backend import Backend
from warpsplat.scene import FloatArray
from warpsplat.svg.order import by_opacity
from warpsplat.svg.write import path_sizes

Report = Callable[[Progress], None]
Stop = Callable[[], bool]

METADATA = "0" * 8
"""As long as that of a finished file."""

LAST_STEPS = 0.2
"""Share of the run that is done again where shapes went or came."""


@dataclass(frozen=True, eq=False)
class Made:
    """A fit with the figures of its file."""

    fit: Fit
    size: int
    """Bytes."""
    psnr: float
    """As a viewer shows it [dB]."""


@dataclass(frozen=True)
class Change:
    """What is to be made of a file."""

    base: Made
    size: float
    """Bytes that it should have, by the number of its shapes."""
    per_pixel: float | None
    """Units of the view box a pixel that it is to be rounded to; None: those that are worth their bytes."""


@dataclass(frozen=True)
class Pursuit:
    """What all runs on the way to a goal share."""

    image: FloatArray
    settings: Settings
    """With the goals; their ``curves`` are the most that there may be."""
    backend: Backend
    importance: FloatArray | None
    deadline: float
    """Of ``time.monotonic``; infinite where there is none."""
    report: Report | None
    stop: Stop | None

    def over(self) -> bool:
        """Whether there is no time for another round, or the user wants no more."""
        return time.monotonic() > self.deadline or bool(self.stop and self.stop())

    def told(self, first: float, last: float) -> Report | None:
        """Progress that counts as the work from ``first`` to ``last``."""
        report = self.report
        if report is None:
            return None
        return lambda now: report(replace(now, work=first + (last - first) * now.work))

    def seconds(self, share: float) -> float | None:
        """A share of the time that is left."""
        return share * max(self.deadline - time.monotonic(), 0.0) if self.deadline < math.inf else None

    def made(self, result: Fit) -> Made:
        """``result`` with the figures of its file."""
        result = replace(result, scene=result.scene.take(by_opacity(result.scene)))
        text = export(result.scene, self.settings, result.per_pixel, METADATA)
        score = score_svg(text, self.image, own=True, eyes=False)
        return Made(result, score.bytes, score.psnr)

    def run(self, settings: Settings, report: Report | None, seconds: float | None) -> Fit:
        """A run from the start, that aims at no PSNR."""
        return fit(
            self.image,
            replace(settings, target_psnr=None),
            self.backend,
            thrifty=True,
            importance=self.importance,
            seconds=seconds,
            report=report,
            stop=self.stop,
        )

    def changed(self, change: Change, report: Report | None) -> Fit:
        """Shapes removed or added, and the last steps again."""
        settings, base, wanted = self.settings, change.base, change.size
        scene = base.fit.scene
        plan = phases(settings, self.image.shape[1], self.image.shape[0])
        weights = pixel_weights(Target(self.image, plan[-1]).image, self.importance, settings.texture)
        rng = np.random.default_rng(settings.seed)
        target = Target(self.image, plan[-1], weights)
        step = Step(FitState.start(scene, self.backend, rng), settings, target)
        sizes = path_sizes(scene, base.fit.per_pixel)
        if wanted < base.size:
            seen = step.renderer.removal_costs(step.aim.target, step.aim.importance)
            order = np.argsort(seen / sizes, kind="stable")
            removed = np.cumsum(sizes[order])
            count = min(1 + int(np.searchsorted(removed, base.size - wanted)), len(scene) - 1)
            scene = scene.take(np.sort(order[count:]))
        else:
            count = min(math.ceil((wanted - base.size) / sizes.mean()), settings.curves - len(scene))
            if count > 0:
                image = step.renderer.read_image()
                scene = scene.append(densify(settings, scene, target.image, image, count, rng, weights))
        before_stages = settings.iterations - STAGES * stage_steps(settings) - 1
        density = replace(settings.density, interval=0)
        return fit(
            self.image,
            replace(settings, target_psnr=None, curves=len(scene), density=density),
            self.backend,
            scene=scene,
            begin=max(0, min(round((1 - LAST_STEPS) * settings.iterations), before_stages)),
            per_pixel=change.per_pixel,
            thrifty=True,
            importance=self.importance,
            report=report,
            stop=self.over,
        )
