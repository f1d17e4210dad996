"""The course of a run: its schedule and events, its deadline and progress."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, replace

import pytest

from tests import ROOT
from tests.fit.pictures import picture
from warpsplat.fit import budget
from warpsplat.fit.budget import BUDGET_MARGIN
from warpsplat.fit.loop import AFTER_A_STEP, BEFORE_A_STEP, fit
from warpsplat.fit.problem import Fit, Problem, Run
from warpsplat.fit.progress import Progress, TimeLeft
from warpsplat.fit.schedule import (
    CHECK_INTERVAL,
    phase_at,
    phases,
    shapes_at,
)
from warpsplat.fit.settings import QUALITIES, Quality, make_settings
from warpsplat.fit.step import Step
from warpsplat.rendering.backend import Backend


def test_phases() -> None:
    settings = make_settings(iterations=100, coarse=0.4)
    coarse, fine = plan = phases(settings, 768, 512)
    assert coarse.width * coarse.height <= 1.01 * settings.coarse_pixels
    assert (fine.width, fine.height) == (768, 512)
    tolerances = [phase.slack / phase.width for phase in plan]
    assert tolerances[0] > tolerances[1] > 0, "the last steps see the curves of the file more closely"
    assert [plan.index(phase_at(settings, plan, step)) for step in range(100)] == [0] * 40 + [1] * 60
    assert len(phases(settings, 100, 80)) == 1
    large = phases(settings, 8000, 6000)[-1]
    assert large.width * large.height <= 1.01 * settings.fine_pixels


@pytest.mark.parametrize(
    ("width", "height"),
    [(1080, 2400), (3000, 4000), (2480, 3508), (1920, 1080), (1200, 1600), (600, 8000), (8, 40000)],
)
@pytest.mark.parametrize("quality", QUALITIES)
def test_one_scale_serves_both_sides(width: int, height: int, quality: Quality) -> None:
    for phase in phases(make_settings(quality), width, height):
        scale = phase.width / width
        assert abs(height * scale - phase.height) < 0.5
        assert phase.width * phase.height <= width * height


@pytest.mark.parametrize("quality", QUALITIES)
@pytest.mark.parametrize("iterations", [1, 26, 30, 60, 100, 101, 333, 1000])
def test_all_shapes_and_no_more_are_there_in_the_end(quality: Quality, iterations: int) -> None:
    settings = make_settings(quality, curves=90, iterations=iterations)
    density = settings.density
    last = range(0, math.ceil(density.stop * iterations), density.interval)[-1]
    assert shapes_at(settings, last) == 90, "after the last densification"
    without = replace(settings, density=replace(settings.density, interval=0))
    assert shapes_at(without, 0) == 90


def test_the_architecture_lists_the_events() -> None:
    text = (ROOT / "ARCHITECTURE.md").read_text(encoding="utf-8")
    rows = text.split("| event | when |")[1].split("\n\n")[0].splitlines()[2:]
    names = [row.split(" | ")[0].removeprefix("| ") for row in rows]
    before, after = ([event.name for event in events] for events in (BEFORE_A_STEP, AFTER_A_STEP))
    assert names == ["**before a step**", *before, "**after a step**", *after]


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
    """Time that goes by between steps leaves fewer; after compiling they are no slower than before."""
    clock = Clock(jump)
    if is_compiling:
        monkeypatch.setattr(budget, "compile_seconds", lambda: clock.jumped)
    made = fitted(monkeypatch, device, seconds, clock)
    assert least <= made.iterations <= most
    assert len(made.scene) == CURVES
    assert jump or seconds < 100 or clock.now <= 1000 + seconds


NOW = Progress(1, 10, 20.0, 0.0, 0.5, fine=True)


def test_parts_divide_the_work() -> None:
    seen: list[float] = []
    run = Run(Backend.on("cpu", 1), lambda now: seen.append(now.work))
    run.part(0.2, 0.6).part(0.5, 1.0).report(NOW)
    parts = run.open_parts(0.2)
    for part in (next(parts), next(parts)):
        part.report(replace(NOW, work=1.0))
    run.mapped(lambda now: replace(now, work=0.9)).report(NOW)
    assert seen == pytest.approx([0.5, 0.6, 0.8, 0.9])


def test_a_callback_ends_the_run_and_all_of_its_parts() -> None:
    run = Run(Backend.on("cpu", 1), lambda now: now.work > 0.6)
    part, other = run.part(0.5, 1.0), run.within(0.5)
    part.report(replace(NOW, work=0.1))
    assert not run.stopped() and not part.stopped()
    part.report(NOW)
    assert run.stopped() and part.stopped() and other.stopped() and other.over()
    assert Run(run.backend, stop=lambda: True).part(0.0, 0.5).stopped()


def test_a_run_is_over_at_its_deadline() -> None:
    late = Run(Backend.on("cpu", 1), deadline=time.monotonic() - 1)
    assert late.over() and not late.stopped()
    assert late.unsized().stopped() and late.unsized().deadline == math.inf
    run = replace(late, deadline=time.monotonic() + 100)
    assert not run.over() and time.monotonic() + 49 < run.within(0.5).deadline < time.monotonic() + 51
    assert replace(late, deadline=math.inf).within(0.5).deadline == math.inf


def test_time_left_follows_the_pace_since_the_first_report() -> None:
    left = TimeLeft()
    assert left.update(0.1, 100.0) is None, "compiling says nothing of the rest"
    assert left.update(0.2, 101.0) == pytest.approx(8.0)
    assert left.update(0.5, 108.0) == pytest.approx(10.0), "it has become slower"
