"""Pilots: short runs that tell how many shapes a PSNR takes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from warpsplat.fit.loop import Fit
from warpsplat.fit.rate import DB_PER_DOUBLING
from warpsplat.fit.settings import PRESETS, Settings
from warpsplat.fit.work import Progress
from warpsplat.portable import elementary
from warpsplat.search.search import Pursuit

PILOT_CURVES = 256
"""Of the first pilot."""

PILOT_GAIN = 1.5
"""What a run of 1,000 steps has at least over a pilot with as many shapes [dB]: rather too many shapes, since
some that go at the end cost little."""

PILOT_RANGE = 2.0
"""Factor of the number of shapes over which a pilot is believed."""

PILOT_STEP = 8.0
"""Most that the number of shapes changes by from one pilot to the next, as a factor."""

PILOTS = 4
"""At the most."""

PILOT_TIME = 0.15
"""Share of a time budget, of all pilots."""

USUAL_ROUNDS = {"target_psnr": 4.2, "max_bytes": 1.3}
"""How many there are in the mean, as progress is shown before anything is known."""

PILOT_EQUAL, PILOT_RISE = 0.37, 10.5
"""Share of a pilot at which the reduced picture has the decibels that the file will have, and what it gains
from then on in a whole pilot [dB]."""


def pilot(pursuit: Pursuit, most: int) -> tuple[int, int, Fit]:
    """Steps done, the number of shapes that the target needs, and the last pilot."""
    settings = pursuit.settings
    assert settings.target_psnr
    draft = _draft(settings)
    longer = elementary.log(settings.iterations / draft.iterations) / elementary.log(5)
    aim = settings.target_psnr - PILOT_GAIN * float(longer)
    curves, done = min(PILOT_CURVES, most), 0
    seen: dict[int, float] = {}
    for turn in range(PILOTS):
        chosen = replace(draft, curves=curves)
        rest = _after_pilots(pursuit, curves) if turn else _after_pilot(pursuit, aim, curves, most)
        report = pursuit.meter.stage(pursuit.cost(chosen), rest)
        seconds = pursuit.seconds(PILOT_TIME / PILOTS)
        made = pursuit.run(chosen, report, seconds)
        done += made.iterations
        seen[curves] = pursuit.made(made).psnr
        used, curves = curves, curves_for(aim, seen, most)
        if made.interrupted or max(used / curves, curves / used) <= PILOT_RANGE or curves in seen:
            break
    return done, curves, made


def _draft(settings: Settings) -> Settings:
    """Those of pilots."""
    draft = PRESETS["draft"]
    names = ("coarse_pixels", "fine_pixels", "iterations")
    least = {name: min(draft[name], getattr(settings, name)) for name in names}
    return replace(settings, coarse=draft["coarse"], max_bytes=None, **least)


def _after_pilots(pursuit: Pursuit, curves: int) -> float:
    """What a run and its rounds cost."""
    return pursuit.cost(replace(pursuit.settings, curves=curves)) + usual_rounds(pursuit, curves)


def _after_pilot(pursuit: Pursuit, aim: float, curves: int, most: int) -> Callable[[Progress], float]:
    """What comes after the first pilot, by how good its shapes are until now."""

    def rest(now: Progress) -> float:
        gained = 0.0 if now.fine else PILOT_RISE * (now.step / now.steps - PILOT_EQUAL)
        wanted = curves_for(aim, {curves: now.psnr - gained}, most)
        again = max(wanted / curves, curves / wanted) > PILOT_RANGE
        another = pursuit.cost(replace(_draft(pursuit.settings), curves=wanted)) if again else 0.0
        return another + _after_pilots(pursuit, wanted)

    return rest


def curves_for(aim: float, seen: dict[int, float], most: int) -> int:
    """Shapes that a pilot needs for ``aim`` dB, by the PSNR of the ``seen`` numbers of shapes."""
    nearest, *others = sorted(seen, key=lambda count: abs(seen[count] - aim))
    slope = DB_PER_DOUBLING
    if others:
        slope = (seen[nearest] - seen[others[0]]) / float(elementary.log2(nearest / others[0]))
    missing = aim - seen[nearest]
    # Pilots gain less by more shapes than whole runs do; rather too many shapes than too few.
    doublings = missing / max(slope, (0.75 if missing > 0 else 1.0) * DB_PER_DOUBLING)
    step = float(elementary.log2(PILOT_STEP))
    return max(1, min(most, round(nearest * float(elementary.power(2, min(max(doublings, -step), step))))))


def usual_rounds(pursuit: Pursuit, curves: int) -> float:
    """What the rounds after a run with so many shapes cost."""
    number = USUAL_ROUNDS["target_psnr" if pursuit.settings.target_psnr else "max_bytes"]
    return number * pursuit.round_cost(curves, per_pixel=1.0)
