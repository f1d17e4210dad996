"""The smallest file that reaches a PSNR, and the best one within a size.

A first run has about as many shapes as are needed. Then shapes go, or come, and the last steps are done
again, until the file is as it should be: what counts is the file itself, as it is written and shown.
"""

from __future__ import annotations

import math
import time
from dataclasses import replace

from warpsplat.fit.afford import affordable_curves
from warpsplat.fit.loop import Fit
from warpsplat.fit.place import simple_curves
from warpsplat.fit.rate import DB_PER_DOUBLING
from warpsplat.fit.rounding import finest
from warpsplat.fit.settings import Settings
from warpsplat.fit.stages import Stages
from warpsplat.fit.work import Meter, Report
from warpsplat.portable import elementary
from warpsplat.rendering.backend import Backend
from warpsplat.scene import FloatArray
from warpsplat.search.few_shapes import FEW, for_few
from warpsplat.search.probes import pilot, usual_rounds
from warpsplat.search.search import Change, Made, Pursuit, Stop
from warpsplat.svg.write import GRIDS

MOST_CURVES = 20_000
"""Without ``--curves``."""

ROUNDS = 6
"""Times at the most that shapes go or come."""

ENOUGH_DB = 0.03
"""A file that has no more than this over the target is small enough [dB]."""

AIM_DB = 0.01
"""What is aimed at over the target [dB]."""

CUT_DB = 1.3
"""What half of the shapes cost, by what the first few that go do when the rest is fitted anew [dB]."""

NEAR = 0.005
"""Where a file that is smaller by this share has turned out to miss the target, no other is tried."""

LEAST_LACK = 0.05
"""A file that misses the target gets shapes for so much at the least [dB]."""

FULL = 0.98
"""A file that fills so much of its limit is large enough."""

AIM_FULL = 0.996
"""What is aimed at of the limit."""

CUT_MOST = 0.8
"""Size after a round over that before, at the least; beyond, what went would be missed."""

SAME_GRID = 1.15
"""Size after a round over that before up to which the grid stays; beyond, it is chosen anew."""

GROW_MOST = 1.35
"""Size after a round over that before, at the most."""

TRIES = 3
"""Runs of a file of few shapes, with different seeds: by chance they differ by tenths of a decibel."""

MAIN_TIME = 0.7
"""Share of a time budget that is left after the pilots; the rest is for the rounds."""

ENDING = 0.15
"""Share of rounds on the way to a PSNR after which there is no other, whatever was missing before."""

LAST_ROUNDS = {"grow": 0.75, "shrink": 0.5}
"""How many follow in the mean once a file should have its size: one that grew is often too large."""


def pursue(
    image: FloatArray,
    settings: Settings,
    backend: Backend,
    *,
    metadata: str = "",
    importance: FloatArray | None = None,
    seconds: float | None = None,
    report: Report | None = None,
    after: float = 0.0,
    stop: Stop | None = None,
    stages: Stages | None = None,
) -> Fit:
    """The smallest file that has ``target_psnr``, within ``max_bytes``; without a target the best in these.

    Arguments are those of ``fit``, the ``metadata`` of the file, and the work that comes ``after`` it
    (``fit.costs``). Where a goal is out of reach, the result is what comes nearest to it.
    """
    most = settings.curves
    if settings.simplify:
        most = min(MOST_CURVES, simple_curves(image))
    settings = replace(settings, curves=most)
    if settings.max_bytes:
        room = affordable_curves(settings, image.shape[1], image.shape[0])
        settings = replace(for_few(replace(settings, curves=room)), curves=most)
    deadline = math.inf if seconds is None else time.monotonic() + seconds
    meter = Meter(report, after)
    pursuit = Pursuit(image, settings, backend, metadata, importance, deadline, meter, stop, stages)
    done, first = _first(pursuit)
    if first.interrupted:
        return replace(first, iterations=done)
    tried = [pursuit.made(first)]
    for turn in range(ROUNDS):
        change = _next(tried, settings)
        if change is None or pursuit.over():
            break
        shapes, later = len(change.base.fit.scene), rounds_left(tried, settings, ROUNDS - turn) - 1
        cost = pursuit.round_cost(shapes, per_pixel=change.per_pixel)
        rest = max(later, 0.0) * pursuit.round_cost(shapes, per_pixel=change.base.fit.per_pixel)
        result = pursuit.changed(change, pursuit.meter.stage(cost, rest))
        done += result.iterations
        if result.interrupted:
            break
        made = pursuit.made(result)
        if made.size in {other.size for other in tried}:
            break  # what there is no step between
        tried.append(made)
    best = min(tried, key=lambda made: _rank(made, settings))
    interrupted = bool(stop and stop())
    return replace(best.fit, iterations=done, interrupted=interrupted)


def rounds_left(tried: list[Made], settings: Settings, most: int) -> float:
    """How many rounds there will be in the mean, ``most`` at the most and the next one included, by what has
    been ``tried``: for progress.

    On the way to a PSNR each may be the last. On that to a size, they go by the number of shapes, as far as
    it may change in a round.
    """
    best = min(tried, key=lambda made: _rank(made, settings))
    if settings.target_psnr and _fits(best, settings):
        return float(1 - elementary.power(1 - ENDING, most)) / ENDING
    assert settings.max_bytes
    growth = float(elementary.log(AIM_FULL * settings.max_bytes / best.size))
    way, step = ("grow", GROW_MOST) if growth > 0 else ("shrink", CUT_MOST)
    return min(max(growth / float(elementary.log(step)), 1.0) + LAST_ROUNDS[way], most)


def _first(pursuit: Pursuit) -> tuple[int, Fit]:
    """Steps done, and a run with about as many shapes as are needed."""
    settings, image = pursuit.settings, pursuit.image
    curves, done = settings.curves, 0
    if settings.max_bytes:
        curves = affordable_curves(settings, image.shape[1], image.shape[0])
    if settings.target_psnr:
        done, curves, last = pilot(pursuit, curves)
        if last.interrupted:
            return done, last
    settings = replace(settings, curves=curves)
    tries = TRIES if settings.max_bytes and curves <= FEW else 1
    results = []
    for turn in range(tries):
        seeded = replace(settings, seed=(settings.seed + turn) % 2**32)
        cost, later = pursuit.cost(settings), usual_rounds(pursuit, curves)
        report = pursuit.meter.stage(cost, (tries - turn - 1) * cost + later)
        results.append(pursuit.run(seeded, report, pursuit.seconds(MAIN_TIME / (tries - turn))))
        done += results[-1].iterations
        if results[-1].interrupted or pursuit.over():
            break
    if len(results) == 1:
        return done, results[0]
    return done, max(results, key=lambda result: _promise(pursuit.made(result)))


def _promise(made: Made) -> float:
    """What a file of a few shapes would have at a size that is the same for all [dB]."""
    return made.psnr - DB_PER_DOUBLING * float(elementary.log2(made.size))


def _fits(made: Made, settings: Settings) -> bool:
    return not settings.max_bytes or made.size <= settings.max_bytes


def _reaches(made: Made, settings: Settings) -> bool:
    return settings.target_psnr is not None and made.psnr >= settings.target_psnr


def _rank(made: Made, settings: Settings) -> tuple[bool, bool, float]:
    """Less is better: what fits comes first, of that what reaches the target, of that the smallest; of what
    does not fit the smallest, of what does not reach it the best.
    """
    if not _fits(made, settings):
        return True, True, made.size
    reaches = _reaches(made, settings)
    return False, not reaches, made.size if reaches else -made.psnr


def _next(tried: list[Made], settings: Settings) -> Change | None:
    """What to do next; None where what there is will do."""
    best = min(tried, key=lambda made: _rank(made, settings))
    limit = settings.max_bytes or math.inf
    if _reaches(best, settings) and _fits(best, settings):
        assert settings.target_psnr
        surplus = best.psnr - settings.target_psnr
        slope, least = CUT_DB, CUT_MOST * best.size
        failed = [made for made in tried[tried.index(best) + 1 :] if made.size < best.size]
        if failed:
            nearest = max(failed, key=lambda made: made.size)
            slope = (best.psnr - nearest.psnr) / float(elementary.log2(best.size / nearest.size))
            least = (2 * nearest.size + best.size) / 3
        if surplus <= ENOUGH_DB or best.size - least < NEAR * best.size:
            return None
        wanted = best.size * float(elementary.power(2, (AIM_DB - surplus) / slope))
        return Change(best, max(wanted, least), best.fit.per_pixel)
    if best.size > FULL * limit and _fits(best, settings):
        return None
    large = [made for made in tried if not _fits(made, settings)]
    if large:
        base = min(large, key=lambda made: made.size)
        return Change(base, max(AIM_FULL * limit, CUT_MOST * base.size), base.fit.per_pixel)
    base = max(tried, key=lambda made: made.size)
    per_pixel = base.fit.per_pixel
    if len(base.fit.scene) >= settings.curves:
        finer = [grid for grid in (*GRIDS, finest(settings)) if 2 * per_pixel <= grid <= finest(settings)]
        return Change(base, base.size, min(finer)) if finer else None
    wanted = GROW_MOST * base.size
    if settings.target_psnr:
        lack = max(settings.target_psnr - base.psnr, LEAST_LACK)
        wanted = min(wanted, base.size * float(elementary.power(2, lack / DB_PER_DOUBLING)))
    wanted = min(wanted, AIM_FULL * limit)
    return Change(base, wanted, per_pixel if wanted <= SAME_GRID * base.size else None)
