"""Levels of detail in one file, from coarse to fine (after LIVE, Ma et al. 2022).

A round for each level: new shapes in front of those of the earlier ones. These go on moving, but their own
picture, without what is in front of it, stays in the loss. So the first shapes are a picture of their own,
nearly as good as one of so many shapes, and the whole one nearly as good as without levels.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import replace

from warpsplat.fit.costs import Course
from warpsplat.fit.loop import Fit, fit
from warpsplat.fit.settings import Settings
from warpsplat.fit.stages import Stages
from warpsplat.fit.work import Meter, Report
from warpsplat.rendering.backend import Backend
from warpsplat.scene import FloatArray, Scene

EARLIER, LAST = 0.75, 1.25
"""Steps of an earlier round and of the last, over those of a run without levels: the last has to move the
shapes of all."""


def fit_layered(
    image: FloatArray,
    settings: Settings,
    backend: Backend,
    *,
    importance: FloatArray | None = None,
    report: Report | None = None,
    after: float = 0.0,
    stop: Callable[[], bool] | None = None,
    stages: Stages | None = None,
) -> Fit:
    """A scene whose first ``settings.levels`` shapes are pictures of their own: its layers.

    Arguments are those of ``fit``, and the work that comes ``after`` it (``fit.costs``).
    """
    below: Scene | None = None
    done = renewed = 0
    rounds = _rounds(settings)
    steps = sum(each.iterations for each in rounds)
    height, width = image.shape[:2]
    costs = [
        Course.of(
            each, width, height, backend, ends=settings.levels[:number], finish=each is rounds[-1]
        ).cost()
        for number, each in enumerate(rounds)
    ]
    meter = Meter(report, after)
    for number, each in enumerate(rounds):
        finish = each is rounds[-1]
        told = meter.stage(costs[number], sum(costs[number + 1 :]))
        made = fit(
            image,
            each,
            backend,
            below=below,
            finish=finish,
            importance=importance,
            report=_told(told, done, steps, finish),
            stop=stop,
            stages=stages,
        )
        done += made.iterations
        renewed += made.renewed
        below = made.scene
        if made.interrupted:
            break
    return replace(made, iterations=done, renewed=renewed)


def _rounds(settings: Settings) -> list[Settings]:
    """Of each level's own shapes. Only the last one sees the finest size; where there is a picture already,
    all new shapes come at once.
    """
    rounds = []
    for first, last in itertools.pairwise((0, *settings.levels)):
        is_last = last == settings.levels[-1]
        share = LAST if is_last else EARLIER
        density = replace(settings.density, start=1.0) if first else settings.density
        rounds.append(
            replace(
                settings,
                curves=last - first,
                levels=(),
                iterations=max(1, round(share * settings.iterations)),
                coarse=settings.coarse if is_last else 1.0,
                density=density,
            )
        )
    return rounds


def _told(report: Report | None, before: int, steps: int, finish: bool) -> Report | None:
    """Steps of a round as those of the run, ``before`` and ``steps`` in all."""
    if report is None:
        return None
    return lambda now: report(replace(now, step=before + now.step, steps=steps, fine=now.fine and finish))
