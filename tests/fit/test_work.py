"""The progress of work in stages, and what is expected of the rest."""

from __future__ import annotations

import pytest

from warpsplat.fit.work import Meter, Progress, TimeLeft


def at(work: float, step: int = 1) -> Progress:
    return Progress(step, 10, 20.0, 0.0, work, fine=True)


def test_stages_count_by_what_they_cost() -> None:
    told: list[Progress] = []
    meter = Meter(told.append, after=10.0)
    first = meter.stage(30.0, 60.0)
    assert first
    first(at(0.5))
    assert told[-1].work == pytest.approx(0.15)
    first(at(1.0))
    second = meter.stage(60.0, 0.0)
    assert second
    second(at(0.5))
    assert told[-1].work == pytest.approx(0.6)
    second(at(1.0))
    assert told[-1].work == pytest.approx(0.9), "what comes after"


def test_a_stage_that_tells_nothing_is_done_when_the_next_one_begins() -> None:
    told: list[Progress] = []
    meter = Meter(told.append)
    meter.stage(50.0, 50.0)
    last = meter.stage(50.0, 0.0)
    assert last
    last(at(0.0))
    assert told[-1].work == pytest.approx(0.5)


def test_a_stage_that_ends_early_has_not_cost_the_rest_of_it() -> None:
    """Otherwise the pace would seem faster than it was, and the rest shorter."""
    told: list[Progress] = []
    meter = Meter(told.append)
    first = meter.stage(80.0, 60.0)
    assert first
    first(at(0.25))
    last = meter.stage(60.0, 0.0)
    assert last
    last(at(0.0))
    assert told[-1].work == pytest.approx(20 / 80)


def test_what_is_likely_left_of_a_stage_may_follow_its_reports() -> None:
    told: list[Progress] = []
    meter = Meter(told.append)
    half = meter.stage(80.0, 30.0, likely=0.5)
    assert half
    half(at(0.25))
    assert told[-1].work == pytest.approx(20 / (20 + 30 + 30))
    heard = meter.stage(80.0, lambda now: 10.0 * now.step, likely=lambda now: 1 / now.step)
    assert heard
    heard(at(0.25, step=2))
    assert told[-1].work == pytest.approx(40 / (40 + 30 + 20))


def test_a_meter_without_a_listener_makes_no_reports() -> None:
    assert Meter(None).stage(1.0, 1.0) is None


def test_time_left_follows_the_pace_since_the_first_report() -> None:
    left = TimeLeft()
    assert left.update(0.1, 100.0) is None, "compiling says nothing of the rest"
    assert left.update(0.2, 101.0) == pytest.approx(8.0)
    assert left.update(0.5, 108.0) == pytest.approx(10.0), "it has become slower"
    assert left.update(0.4, 109.0) == pytest.approx(18.0), "there is more to do than was thought"
