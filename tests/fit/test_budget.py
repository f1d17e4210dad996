"""Fits with a deadline, by a clock that goes on with their steps only."""

from __future__ import annotations

import time
from dataclasses import dataclass

import pytest

from tests.fit.pictures import picture
from warpsplat.fit import budget
from warpsplat.fit.budget import BUDGET_MARGIN
from warpsplat.fit.loop import fit
from warpsplat.fit.problem import Fit, Problem, Run
from warpsplat.fit.schedule import CHECK_INTERVAL
from warpsplat.fit.settings import make_settings
from warpsplat.fit.step import Step
from warpsplat.rendering.backend import Backend

CURVES = 24


@dataclass
class Clock:
    """A second a step; before the 31st it jumps."""

    jump: float = 0.0
    now: float = 1000.0
    jumped: float = 0.0


def fitted(monkeypatch: pytest.MonkeyPatch, device: str, seconds: float, clock: Clock) -> Fit:
    original = Step.advance

    def advance(step: Step) -> None:
        if step.state.step == 30:
            clock.jumped = clock.jump
        clock.now += 1.0 if step.state.step != 30 else 1.0 + clock.jump
        original(step)

    def measure(_step: Step, count: int) -> None:
        clock.now += count / BUDGET_MARGIN

    monkeypatch.setattr(time, "monotonic", lambda: clock.now)
    monkeypatch.setattr(Step, "advance", advance)
    monkeypatch.setattr(Step, "time", measure)
    settings = make_settings(curves=CURVES, coarse_pixels=1000, subject="photo")
    return fit(Problem(picture(), settings), Run(Backend.on(device, 1), deadline=clock.now + seconds))


@pytest.mark.parametrize(
    ("seconds", "jump", "is_compiling", "least", "most"),
    [
        (120, 0, False, 101, 119),
        *((seconds, 0, False, CHECK_INTERVAL, max(CHECK_INTERVAL, seconds)) for seconds in (-5, 3, 20)),
        (120, 500, False, 31, 32 + CHECK_INTERVAL),
        (180, 60, True, 101, 119),
    ],
    ids=["all", "too late", "very late", "late", "lost between", "compiling"],
)
def test_the_steps_fill_the_time_and_no_shapes_are_lost(
    seconds: float,
    jump: float,
    is_compiling: bool,
    least: float,
    most: float,
    device: str,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Time that goes by between steps leaves fewer of them; after compiling they are no slower than before."""
    clock = Clock(jump)
    if is_compiling:
        monkeypatch.setattr(budget, "compile_seconds", lambda: clock.jumped)
    made = fitted(monkeypatch, device, seconds, clock)
    assert least <= made.iterations <= most
    assert len(made.scene) == CURVES
    assert jump or seconds < 100 or clock.now <= 1000 + seconds
