"""Search for the smallest file that reaches a PSNR, or for the best file within a size.

Short probe runs estimate how many shapes a PSNR takes, and a first fit has about so many. Then shapes are
removed or added, and the last steps repeated, until the file itself, as a viewer shows it, meets the goal.
"""

from __future__ import annotations

import functools
import math
from dataclasses import replace

from warpsplat.fit.budget import affordable_curves
from warpsplat.fit.loop import fit
from warpsplat.fit.place import simple_curves
from warpsplat.fit.problem import Fit, Problem, Rounding, Run
from warpsplat.fit.rounding import DB_PER_DOUBLING, finest
from warpsplat.fit.settings import PRESETS, Settings
from warpsplat.portable import elementary
from warpsplat.search.candidate import FEW_SHAPES, LAST_STEPS, Candidate, Change, changed, for_few, measured
from warpsplat.svg.write import GRIDS

PROBES, PROBE_CURVES, PROBE_STEP = 4, 256, 8.0
"""Most probe runs, shapes of the first one, and largest factor between the numbers of two."""

PROBE_TIME, FIRST_TIME = 0.15, 0.7
"""Shares of a time budget: for all probe runs, and of the rest for the first fit."""

LIKELY_PROBES, LIKELY_ROUNDS = 2, 3
"""Probe runs and rounds that a search takes on average, for its progress."""

ENOUGH_DB, AIM_DB = 0.03, 0.01
"""A file this little above the target is small enough, and a new candidate aims so far above it [dB]."""

FULL_SHARE, AIM_FULL = 0.98, 0.996
"""Shares of the size limit from which a file is large enough, and that a new candidate aims at."""

CUT_MOST, GROW_MOST, SAME_GRID = 0.8, 1.35, 1.15
"""Smallest and largest size of a candidate over that of its base, as removing more loses shapes that would be
missed, and the largest at which it keeps its base's grid."""

BY_BYTES = Rounding(by_bytes=True)


def search_goal(problem: Problem, run: Run) -> Fit:
    """Return the smallest file with ``target_psnr`` within ``max_bytes``; without a target the best one.

    If the goal is out of reach, the result is what comes nearest to it.
    """
    problem = _for_search(problem)
    settings, curves, done = problem.settings, problem.settings.curves, 0
    if settings.max_bytes:
        curves = affordable_curves(settings, *problem.size)
    probed, fitted = _progress(settings)
    if settings.target_psnr:
        curves, done, last = estimate_curves(problem, curves, run.part(0.0, probed))
        if last.interrupted:
            return replace(last, iterations=done)
    first, steps = fit_first(problem.having(curves=curves), run.part(probed, fitted))
    done += steps
    if first.interrupted:
        return replace(first, iterations=done)
    tried, parts = [measured(problem, first)], run.open_parts(fitted, 1 / LIKELY_ROUNDS)
    search_rounds = 6  # most times that shapes are removed or added
    for _ in range(search_rounds):
        change = next_change(tried, settings)
        if change is None or run.over():
            break
        made = run.attempt(functools.partial(changed, problem, change, next(parts)))
        if made is None:
            break
        done += made.iterations
        if made.interrupted:
            break
        candidate = measured(problem, made)
        if candidate.size in {other.size for other in tried}:
            break  # there is nothing in between
        tried.append(candidate)
    best = min(tried, key=lambda candidate: _rank(candidate, settings))
    return replace(best.fit, iterations=done, interrupted=run.stopped())


def _progress(settings: Settings) -> tuple[float, float]:
    """Return the likely shares of all steps that are done after the probe runs, and after the first fit."""
    probes = LIKELY_PROBES * draft_of(settings).iterations if settings.target_psnr else 0
    steps = probes + (1 + LIKELY_ROUNDS * LAST_STEPS) * settings.iterations
    return probes / steps, (probes + settings.iterations) / steps


def _for_search(problem: Problem) -> Problem:
    """Return the problem with the most shapes that there may be, and settings for few shapes if need be."""
    settings, most = problem.settings, problem.settings.curves
    most_curves = 20_000  # most shapes without --curves
    if settings.simplify:
        most = min(most_curves, simple_curves(problem.target))
    settings = replace(settings, curves=most)
    if settings.max_bytes:
        fitting = affordable_curves(settings, *problem.size)
        settings = replace(for_few(replace(settings, curves=fitting)), curves=most)
    return replace(problem, settings=settings)


def estimate_curves(problem: Problem, most: int, run: Run) -> tuple[int, int, Fit]:
    """Estimate by probe runs how many shapes the target takes; return also their steps, and the last one."""
    settings = problem.settings
    assert settings.target_psnr
    draft = draft_of(settings)
    longer = elementary.log(settings.iterations / draft.iterations) / elementary.log(5)
    # Least gain of 1,000 steps over a probe run with as many shapes [dB]. It errs towards too many shapes,
    # since removing some at the end costs little.
    probe_gain = 1.5
    aim = settings.target_psnr - probe_gain * float(longer)
    curves, done = min(PROBE_CURVES, most), 0
    seen: dict[int, float] = {}
    parts = run.open_parts()
    probe_range = 2.0  # factor of the number of shapes over which the estimate of a probe run holds
    for _ in range(PROBES):
        probe = replace(problem, settings=replace(draft, curves=curves))
        made = fit(probe, next(parts).within(PROBE_TIME / PROBES), None, BY_BYTES)
        done += made.iterations
        seen[curves] = measured(problem, made).psnr
        used, curves = curves, curves_for(aim, seen, most)
        if made.interrupted or max(used / curves, curves / used) <= probe_range or curves in seen:
            break
    return curves, done, made


def draft_of(settings: Settings) -> Settings:
    """Return the settings of a draft, which has no goals."""
    draft = PRESETS["draft"]
    names = ("coarse_pixels", "fine_pixels", "iterations")
    least = {name: min(draft[name], getattr(settings, name)) for name in names}
    return replace(settings, coarse=draft["coarse"], max_bytes=None, target_psnr=None, **least)


def curves_for(aim: float, seen: dict[int, float], most: int) -> int:
    """Return how many shapes a probe run needs for ``aim`` dB, by the PSNR of the numbers ``seen`` so far."""
    nearest, *others = sorted(seen, key=lambda count: abs(seen[count] - aim))
    slope = DB_PER_DOUBLING
    if others:
        slope = (seen[nearest] - seen[others[0]]) / float(elementary.log2(nearest / others[0]))
    missing = aim - seen[nearest]
    # Probe runs gain less by more shapes than whole fits do; rather too many shapes than too few.
    doublings = missing / max(slope, (0.75 if missing > 0 else 1.0) * DB_PER_DOUBLING)
    step = float(elementary.log2(PROBE_STEP))
    return max(1, min(most, round(nearest * float(elementary.power(2, min(max(doublings, -step), step))))))


def fit_first(problem: Problem, run: Run) -> tuple[Fit, int]:
    """Fit ``settings.curves`` shapes, several times if these are few; return the best, and all steps."""
    settings = problem.settings
    # First fits of a file of few shapes, with different seeds: by chance they differ by tenths of a decibel.
    first_fits = 3
    tries = first_fits if settings.max_bytes and settings.curves <= FEW_SHAPES else 1
    results: list[Fit] = []
    for number in range(tries):
        seeded = problem.having(seed=(settings.seed + number) % 2**32, target_psnr=None)
        part = run.part(number / tries, (number + 1) / tries).within(FIRST_TIME / (tries - number))
        results.append(fit(seeded, part, None, BY_BYTES))
        if results[-1].interrupted or run.over():
            break
    done = sum(made.iterations for made in results)
    if len(results) == 1:
        return results[0], done
    return max(results, key=lambda made: _promise(measured(problem, made))), done


def _promise(candidate: Candidate) -> float:
    """Return the PSNR that a file of few shapes would have at a size that is the same for all [dB]."""
    return candidate.psnr - DB_PER_DOUBLING * float(elementary.log2(candidate.size))


def _fits(candidate: Candidate, settings: Settings) -> bool:
    return not settings.max_bytes or candidate.size <= settings.max_bytes


def _reaches(candidate: Candidate, settings: Settings) -> bool:
    return settings.target_psnr is not None and candidate.psnr >= settings.target_psnr


def _rank(candidate: Candidate, settings: Settings) -> tuple[bool, bool, float]:
    """Return a sort key, best first: files within the limit, of these those that reach the target, by size.

    Of those that miss it the one with the highest PSNR is best, beyond the limit the smallest.
    """
    if not _fits(candidate, settings):
        return True, True, candidate.size
    reaches = _reaches(candidate, settings)
    return False, not reaches, candidate.size if reaches else -candidate.psnr


def next_change(tried: list[Candidate], settings: Settings) -> Change | None:
    """Return what to try next; None if the best candidate so far will do."""
    best = min(tried, key=lambda candidate: _rank(candidate, settings))
    limit = settings.max_bytes or math.inf
    if _reaches(best, settings) and _fits(best, settings):
        return _cut(best, tried, settings)
    if best.size > FULL_SHARE * limit and _fits(best, settings):
        return None
    large = [candidate for candidate in tried if not _fits(candidate, settings)]
    if large:
        # A change may make a file no smaller; made of the same base again, the next one would be the same.
        base = tried[-1] if tried[-1] in large else min(large, key=lambda candidate: candidate.size)
        return Change(base, max(AIM_FULL * limit, CUT_MOST * base.size), base.fit.per_pixel)
    return _growth(max(tried, key=lambda candidate: candidate.size), settings)


def _cut(best: Candidate, tried: list[Candidate], settings: Settings) -> Change | None:
    """Return how to make a candidate smaller that reaches the target."""
    assert settings.target_psnr
    surplus = best.psnr - settings.target_psnr
    # Loss by halving the number of shapes, at the rate of the first to be removed, the others refitted [dB].
    cut_db = 1.3
    slope, least = cut_db, CUT_MOST * best.size
    failed = [later for later in tried[tried.index(best) + 1 :] if later.size < best.size]
    if failed:
        nearest = max(failed, key=lambda candidate: candidate.size)
        slope = (best.psnr - nearest.psnr) / float(elementary.log2(best.size / nearest.size))
        least = (2 * nearest.size + best.size) / 3
    # Least relative difference in size to a smaller file that missed the target for a candidate in between.
    near_size = 0.005
    if surplus <= ENOUGH_DB or best.size - least < near_size * best.size:
        return None
    wanted = best.size * float(elementary.power(2, (AIM_DB - surplus) / slope))
    return Change(best, max(wanted, least), best.fit.per_pixel)


def _growth(base: Candidate, settings: Settings) -> Change | None:
    """Return how to improve a candidate within the limit: by more shapes, or else by a finer grid."""
    per_pixel = base.fit.per_pixel
    if len(base.fit.scene) >= settings.curves:
        finer = [grid for grid in (*GRIDS, finest(settings)) if 2 * per_pixel <= grid <= finest(settings)]
        return Change(base, base.size, min(finer)) if finer else None
    wanted = GROW_MOST * base.size
    least_lack = 0.05  # A file that misses the target gets shapes for at least so much [dB]
    if settings.target_psnr:
        lack = max(settings.target_psnr - base.psnr, least_lack)
        wanted = min(wanted, base.size * float(elementary.power(2, lack / DB_PER_DOUBLING)))
    wanted = min(wanted, AIM_FULL * (settings.max_bytes or math.inf))
    return Change(base, wanted, per_pixel if wanted <= SAME_GRID * base.size else None)
