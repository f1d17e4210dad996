"""What is expected of a run's time: only that it goes on, and counts what there is."""

from __future__ import annotations

import itertools
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from tests.search.test_goals import made
from warpsplat.drawing.costs import Costs
from warpsplat.drawing.fit_outlines import Refinement
from warpsplat.drawing.tidy import REFIT, finish_drawing
from warpsplat.drawing.trace.trace import trace
from warpsplat.extensions import renderer_names
from warpsplat.fit.constraints import Drawing
from warpsplat.fit.costs import Course, score_cost
from warpsplat.fit.schedule import phases
from warpsplat.fit.settings import Density, Settings, make_settings
from warpsplat.fit.work import Progress
from warpsplat.rendering.backend import Backend
from warpsplat.scene import Kind
from warpsplat.search.goals import ROUNDS, rounds_left


def course(settings: Settings, **more: Any) -> Course:
    return replace(Course(settings, phases(settings, 768, 512)), **more)


def test_a_course_goes_on_with_its_steps() -> None:
    settings = make_settings(curves=64)
    whole = course(settings)
    costs = [whole.cost(step) for step in range(0, 1001, 10)]
    assert costs[0] == 0
    assert all(earlier < later for earlier, later in itertools.pairwise(costs))
    assert costs[-1] == whole.cost()
    late = course(settings, begin=800)
    assert late.cost(800) == 0
    assert late.cost() == pytest.approx(whole.cost() - whole.cost(800), rel=0.05)


def test_a_turn_is_over_at_once() -> None:
    """It is done after the report of its step, at the size of the step before it."""
    settings = make_settings(curves=64, iterations=400, coarse=0.5)
    interval = settings.density.interval
    plain = course(replace(settings, density=replace(settings.density, interval=0)))

    def surgery(step: int) -> float:
        return course(settings, serial=1000).cost(step) - course(settings, serial=0).cost(step)

    assert interval == 25
    assert surgery(25) == 0 < surgery(26) == surgery(50) < surgery(51)
    coarse, fine = surgery(201) - surgery(200), surgery(226) - surgery(225)
    assert fine > 1.5 * coarse > 0, "the one at the change is done before it"
    assert plain.cost() < course(settings).cost()


def test_what_is_done_besides_steps_counts() -> None:
    settings = make_settings(curves=64)
    plain = replace(settings, density=Density(interval=0), viewer=False)
    cost = course(plain, finish=False).cost()
    assert course(plain).cost() > cost, "a grid"
    assert course(plain, thrifty=True).cost() > course(plain).cost()
    assert course(replace(plain, viewer=True)).cost() > course(plain).cost(), "looks"
    turns = replace(plain, density=Density(start=1.0, surplus=1.0))
    assert course(turns, finish=False).cost() > cost, "surgery"
    assert course(replace(turns, paint="auto"), finish=False).cost() > course(turns, finish=False).cost()
    assert course(turns, serial=8).cost() > course(turns).cost(), "which one thread does"
    assert course(plain, finish=False, serial=8).cost() == cost
    assert course(plain, finish=False, ends=(16,)).cost() > cost, "an earlier level"


def test_kinds_of_steps_have_costs_of_their_own() -> None:
    kinds = (
        {},
        {"kind": Kind.STROKE},
        *({"renderer": name, "iterations": 1000} for name in renderer_names() if name != "exact"),
    )
    costs = [course(make_settings(curves=64, **kind)).cost() for kind in kinds]
    assert len(set(costs)) == len(costs)
    assert costs[0] == min(costs)


def test_measuring_takes_longer_with_eyes_and_beside_threads(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("importlib.util.find_spec", lambda name: name)
    one, four = Backend.on("cpu", 1), replace(Backend.on("cpu", 1), threads=4)
    cost = score_cost(100_000, 64, one, eyes=False)
    assert score_cost(100_000, 64, one, eyes=True) > cost
    assert score_cost(100_000, 64, four, eyes=False) == 4 * cost


def test_rounds_that_are_left_follow_what_is_amiss() -> None:
    scene = trace(np.zeros((32, 32, 3), np.float32)).scene
    settings = make_settings(curves=100, target_psnr=27.0)
    left = [rounds_left([made(scene, 10_000, 27.4)], settings, most) for most in range(ROUNDS + 1)]
    assert left[:2] == pytest.approx([0, 1])
    assert all(fewer < more < fewer + 1.001 for fewer, more in itertools.pairwise(left))
    assert left[ROUNDS] < ROUNDS, "any of them may be the last"

    size = make_settings(curves=100, max_bytes=10_000)

    def tried(size_now: int, most: int = ROUNDS) -> float:
        return rounds_left([made(scene, size_now, 27)], size, most)

    assert tried(30_000) > tried(10_500) > 1
    assert tried(1_000) > tried(9_500) > 1
    assert tried(9_500) > tried(10_500), "what grows may come to be too large"
    assert tried(30_000, 2) == 2


def test_a_drawing_goes_on_while_its_grid_is_chosen() -> None:
    image = np.ones((40, 40, 3), np.float32)
    image[8:30, 6:34] = (0.9, 0.2, 0.1)
    image[14:22, 12:20] = (0.1, 0.3, 0.8)
    traced = trace(image)
    drawing, backend = Drawing(traced.scene, traced.joints, traced.same), Backend.on("cpu", 1)
    costs, told = Costs(image, drawing, backend), list[Progress]()
    finish_drawing(image, drawing, backend, report=told.append)
    assert 0.9 < told[-1].work <= 1
    # Were the grid left out, the last stage would begin where the one before it ended.
    ends = [now.work for now, later in itertools.pairwise(told) if later.step < now.step]
    begins = [now.work for now in told if now.step == 10]
    assert begins[-1] - ends[-1] > costs.grid() / (
        costs.grid() + costs.refit(Refinement()) + 20 * costs.refit(REFIT) + 16 * costs.look(20)
    )
