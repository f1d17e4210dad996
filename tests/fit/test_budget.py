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


def test_the_steps_fill_the_time(device: str, monkeypatch: pytest.MonkeyPatch) -> None:
    clock = Clock()
    made = fitted(monkeypatch, device, 120.0, clock)
    assert 100 < made.iterations < 120
    assert clock.now <= 1120
    assert len(made.scene) == CURVES


@pytest.mark.parametrize("seconds", [-5.0, 3.0, 20.0])
def test_a_late_start_costs_steps_and_no_shapes(
    seconds: float, device: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As after kernels were compiled: few steps are left, or none."""
    made = fitted(monkeypatch, device, seconds, Clock())
    assert CHECK_INTERVAL <= made.iterations <= max(CHECK_INTERVAL, seconds)
    assert len(made.scene) == CURVES


def test_time_that_is_lost_between_costs_steps_and_no_shapes(
    device: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    made = fitted(monkeypatch, device, 120.0, Clock(500.0))
    assert 30 < made.iterations <= 32 + CHECK_INTERVAL
    assert len(made.scene) == CURVES


def test_compiling_does_not_make_steps_slow(device: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """The time is gone, but the steps after it take no longer than those before."""
    clock = Clock(60.0)
    monkeypatch.setattr(budget, "compile_seconds", lambda: clock.jumped)
    made = fitted(monkeypatch, device, 180.0, clock)
    assert 100 < made.iterations < 120
