"""Levels of detail in one file, from coarse to fine (after LIVE, Ma et al. 2022).

Each level is one fit, which places new shapes in front of those of the earlier levels. These keep moving, but
their own picture, without the shapes in front, stays in the loss: it is nearly as good as a fit with so many
shapes, and the whole nearly as good as one without levels.
"""

from __future__ import annotations

import functools
import itertools
from dataclasses import replace

from warpsplat.fit.loop import fit
from warpsplat.fit.problem import USUAL_ROUNDING, Fit, Problem, Run, Start
from warpsplat.fit.progress import Progress
from warpsplat.fit.settings import Settings
from warpsplat.scene import Scene

EARLIER, LAST = 0.75, 1.25
"""Steps for an earlier level and for the last one, relative to a fit without levels: the last one has
to move the shapes of all."""


def fit_layered(problem: Problem, run: Run) -> Fit:
    """Fit a scene whose first ``settings.levels`` shapes are pictures of their own."""
    below: Scene | None = None
    done = renewed = 0
    rounds = _rounds(problem.settings)
    steps = sum(each.iterations for each in rounds)
    for settings in rounds:
        is_last = settings is rounds[-1]
        whole = run.mapped(functools.partial(_of_all, done, steps, is_last))
        part = whole.part(done / steps, (done + settings.iterations) / steps)
        rounding = USUAL_ROUNDING if is_last else None
        made = fit(replace(problem, settings=settings), part, Start(below=below), rounding)
        done += made.iterations
        renewed += made.renewed
        below = made.scene
        if made.interrupted:
            break
    return replace(made, iterations=done, renewed=renewed)


def _of_all(before: int, steps: int, is_last: bool, now: Progress) -> Progress:
    """Return the progress of a level, with ``before`` of all ``steps`` made earlier, as that of the whole."""
    return replace(now, step=before + now.step, steps=steps, fine=now.fine and is_last)


def _rounds(settings: Settings) -> list[Settings]:
    """Return the settings of each level's fit.

    Only the last one works at the finest size. Where there is a picture already, all new shapes come at once.
    """
    rounds = []
    for first, last in itertools.pairwise((0, *settings.levels)):
        share, coarse = (EARLIER, 1.0) if last < settings.levels[-1] else (LAST, settings.coarse)
        density = replace(settings.density, start=1.0) if first else settings.density
        iterations = max(1, round(share * settings.iterations))
        level = replace(settings, curves=last - first, levels=(), iterations=iterations)
        rounds.append(replace(level, coarse=coarse, density=density))
    return rounds
