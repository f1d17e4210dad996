"""Progress of a run that has parts, and the time that is left."""

from __future__ import annotations

import math
import time
from dataclasses import replace

import pytest

from warpsplat.fit.problem import Run
from warpsplat.fit.progress import Progress, TimeLeft
from warpsplat.rendering.backend import Backend

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
