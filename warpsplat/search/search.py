"""Runs on the way to a goal: from the start, and again from where shapes went or came."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from warpsplat.fit.afford import STYLE_BYTES
from warpsplat.fit.costs import PIXELS, Course, score_cost, turn_cost
from warpsplat.fit.export import finished
from warpsplat.fit.grow import new_shapes
from warpsplat.fit.importance import pixel_weights
from warpsplat.fit.loop import Fit, fit
from warpsplat.fit.rounding import STAGES, stage_steps
from warpsplat.fit.schedule import phases
from warpsplat.fit.settings import Settings
from warpsplat.fit.simplify import MIN_SPLINE_POINTS, simplify
from warpsplat.fit.stages import Stages
from warpsplat.fit.state import FitState
from warpsplat.fit.step import Step, Target
from warpsplat.fit.work import Meter, Report
from warpsplat.metrics import score_svg
from warpsplat.rendering.backend import Backend
from warpsplat.scene import Basis, FloatArray, Kind, Scene
from warpsplat.scene.geometry import areas
from warpsplat.search.few_shapes import FEW, grounded
from warpsplat.svg.order import by_opacity
from warpsplat.svg.write import path_sizes

Stop = Callable[[], bool]

LAST_STEPS = 0.2
"""Share of the run that is done again where shapes went or came."""

PREPARED = 2.0
"""What comes before these steps, over what a turn of surgery costs (``fit.costs``)."""


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
    metadata: str
    """Of the file."""
    importance: FloatArray | None
    deadline: float
    """Of ``time.monotonic``; infinite where there is none."""
    meter: Meter
    stop: Stop | None
    stages: Stages | None = None

    @property
    def may_choose_ground(self) -> bool:
        """Whether the ground may have any colour."""
        return self.settings.background == "auto" and not self.settings.is_limited

    def over(self) -> bool:
        """Whether there is no time for another round, or the user wants no more."""
        return time.monotonic() > self.deadline or bool(self.stop and self.stop())

    def cost(self, settings: Settings) -> float:
        """Of a run, and of measuring its file (``fit.costs``)."""
        height, width = self.image.shape[:2]
        measured = score_cost(width * height, settings.curves, self.backend, eyes=False)
        return Course.of(settings, width, height, self.backend, thrifty=True).cost() + measured

    def round_cost(self, shapes: int, *, per_pixel: float | None = None) -> float:
        """Of a change to so many shapes, as ``cost``; ``per_pixel``: the grid, where it is known."""
        height, width = self.image.shape[:2]
        course = Course.of(
            self.last_settings(shapes),
            width,
            height,
            self.backend,
            begin=self.last_begin(),
            thrifty=not per_pixel,
        )
        size = course.plan[-1].width * course.plan[-1].height
        prepared = PREPARED * course.serial * turn_cost(size / PIXELS, shapes)
        measured = score_cost(width * height, shapes, self.backend, eyes=False)
        return prepared + course.cost() + measured

    def last_settings(self, shapes: int) -> Settings:
        """Of a round, whose shapes stay."""
        density = replace(self.settings.density, interval=0)
        return replace(self.settings, target_psnr=None, curves=shapes, density=density)

    def last_begin(self) -> int:
        """Step at which a round begins."""
        steps = self.settings.iterations
        before_stages = steps - STAGES * stage_steps(self.settings) - 1
        return max(0, min(round((1 - LAST_STEPS) * steps), before_stages))

    def seconds(self, share: float) -> float | None:
        """A share of the time that is left."""
        return share * max(self.deadline - time.monotonic(), 0.0) if self.deadline < math.inf else None

    def made(self, result: Fit) -> Made:
        """``result`` with the figures of its file."""
        result = replace(result, scene=result.scene.take(by_opacity(result.scene)))
        text = finished(result.scene, self.settings, result.per_pixel, self.metadata)
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
            stages=self.stages,
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
            seen = step.removal_costs()
            scene = smaller(scene, seen, sizes, base.size - wanted)
        else:
            count = min(math.ceil((wanted - base.size) / sizes.mean()), settings.curves - len(scene))
            if count > 0:
                image = step.renderer.read_image()
                scene = scene.append(new_shapes(settings, scene, target.image, image, count, rng, weights))
        if len(scene) <= FEW and self.image.shape[2] == 3 and self.may_choose_ground:
            scene = grounded(scene, self.image, self.backend)
        return fit(
            self.image,
            self.last_settings(len(scene)),
            self.backend,
            scene=scene,
            begin=self.last_begin(),
            per_pixel=change.per_pixel,
            thrifty=True,
            importance=self.importance,
            report=report,
            stop=self.over,
            stages=self.stages,
        )


def smaller(scene: Scene, seen: FloatArray, sizes: npt.NDArray[np.int64], excess: float) -> Scene:
    """Without shapes, and for what is less than a shape without points of splines.

    Args:
        scene: what is to become smaller.
        seen: what the error would grow by without each shape, shape (shape,).
        sizes: of the shapes [bytes], shape (shape,).
        excess: what has to go [bytes].
    """
    order = np.argsort(seen / sizes, kind="stable")
    removed = np.cumsum(sizes[order])
    count = min(int(np.searchsorted(removed, excess, "right")), len(scene) - 1)
    left = excess - (float(removed[count - 1]) if count else 0.0)
    kept = np.sort(order[count:])
    counts = scene.point_counts()
    splines = kept[(scene.basis[kept] == Basis.SPLINE) & (counts[kept] > MIN_SPLINE_POINTS)]
    if not len(splines):  # nothing less than a shape can go
        return scene.take(np.sort(order[min(count + 1, len(scene) - 1) :]))
    a_point = (sizes[splines].mean() - STYLE_BYTES[Kind.FILL]) / (counts[splines].mean() + 2)
    scene, seen = scene.take(kept), seen[kept]
    worth = np.maximum(seen, 0) / np.maximum(areas(scene), 1.0)
    return simplify(scene, np.asarray(worth, np.float32), math.ceil(left / max(a_point, 1.0)))[0]
