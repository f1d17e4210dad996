"""What is expected of finishing a drawing: only that it counts what there is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.drawing.drawings import logo
from warpsplat.drawing.costs import (
    DONE,
    FITS,
    UNKNOWN,
    Costs,
    Ending,
    RoundsWatch,
    rounds_left,
    worthwhile_rounds,
)
from warpsplat.drawing.fit_outlines import PATIENCE, Refinement
from warpsplat.drawing.nodes import Edit
from warpsplat.fit.constraints import Drawing
from warpsplat.fit.work import Meter, Progress
from warpsplat.rendering.backend import Backend
from warpsplat.scene import Paint
from warpsplat.scene.scene import starts_of

HOW = Refinement(steps=25)


def costs(drawing: Drawing | None = None, threads: int = 1, side: int = 64) -> Costs:
    backend = replace(Backend.on("cpu", 1), threads=threads)
    return Costs(np.ones((side, side, 3), np.float32), drawing or logo(), backend)


def edits(count: int) -> list[Edit]:
    return [Edit("without", (float(i), 0.0), frozenset(), 0.1, 19) for i in range(count)]


def test_steps_cost_by_what_they_render() -> None:
    def step(made: Drawing) -> float:
        return costs(made).refit(replace(HOW, steps=26)) - costs(made).refit(HOW)

    made, count = logo(), len(logo().scene)
    plain = step(made)
    longer = replace(made, scene=replace(made.scene, points=3 * made.scene.points))
    assert step(longer) > plain > 0
    scene = replace(
        made.scene,
        paint=np.full(count, Paint.LINEAR, np.int32),
        stop_first=starts_of(np.full(count, 2)),
        stop_offsets=np.tile(np.float32([0, 1]), count),
        stop_colors=np.zeros((2 * count, 3), np.float32),
        stop_opacities=np.ones(2 * count, np.float32),
    )
    assert step(replace(made, scene=scene)) > 1.05 * plain


def test_what_one_thread_does_counts_as_often_as_there_are() -> None:
    def steps(threads: int) -> float:
        return costs(threads=threads).refit(replace(HOW, steps=50)) - costs(threads=threads).refit(HOW)

    assert steps(4) == pytest.approx(steps(1))
    assert costs(threads=4).refit(HOW) > costs().refit(HOW), "what comes before the steps"
    assert costs(threads=4).grid() == 4 * costs().grid()
    assert costs(side=200).grid() > costs().grid()
    assert costs(threads=4).look(100) == 4 * costs().look(100) > 4 * costs().look(10)


def test_rounds_go_with_candidates_and_how_many_of_them_meet() -> None:
    def left(candidates: int, tried: int, most: int = 16) -> float:
        return rounds_left(edits(candidates), edits(tried), most)

    assert left(0, 0) == 0
    assert left(1, 1) == 1
    assert 1 < left(50, 20) < left(90, 20) < left(90, 15) < 16
    assert left(400, 40) == 16
    assert left(400, 40, 3) == 3


def test_rounds_end_as_their_candidates_do() -> None:
    told: list[Progress] = []
    watch = RoundsWatch(Meter(told.append), costs(), HOW, least=0.004, last=1000.0)
    assert watch.ahead([], [], 16) == 1000, "none at all"
    many, few = (watch.ahead(edits(count), edits(10), 16) for count in (100, 20))
    assert many > few > 1000 + FITS * costs().refit(HOW)

    def report() -> float:
        heard = watch.refit()
        assert heard
        heard(Progress(25, 25, 30.0, 0.0, 1.0, fine=True))
        return told[-1].work

    watch.found(edits(100), edits(10), 16)
    first, again = report(), report()
    assert first < again, "a second fit of a round is work as well"
    watch.found(edits(20), edits(10), 15)
    assert again < report(), "and there are fewer rounds to come than there were"


def test_rounds_end_where_they_spare_too_little() -> None:
    assert worthwhile_rounds([], 0.004) == UNKNOWN
    assert worthwhile_rounds([0.001], 0.004) == 1
    assert worthwhile_rounds([0.06], 0.004) > worthwhile_rounds([0.01], 0.004) > 1
    assert worthwhile_rounds([0.064, 0.032], 0.004) == pytest.approx(3), "0.016, 0.008, 0.004"
    assert worthwhile_rounds([0.128, 0.01, 0.032], 0.004) == pytest.approx(3), "half as much in the mean"
    assert 20 < worthwhile_rounds([0.03, 0.032], 0.004) < 100, "it rises now and then"
    told: list[Progress] = []
    watch = RoundsWatch(Meter(told.append), costs(), HOW, least=0.004, last=1000.0)
    before = watch.ahead(edits(90), edits(10), 16)
    watch.spared(0.03)
    watch.spared(0.01)
    assert watch.ahead(edits(90), edits(10), 16) < before


def test_a_fit_that_gains_nothing_is_about_to_end() -> None:
    def hear(ending: Ending, step: int, psnr: float) -> float:
        return ending(Progress(step, 200, psnr, 0.0, step / 200, fine=True))

    ending = Ending()
    assert [hear(ending, 10, 30.0), hear(ending, 20, 30.0)] == [DONE, DONE]
    still = [hear(ending, step, 30.0) for step in (30, 40, 50)]
    assert still == pytest.approx([20 / 170, 10 / 160, 0]), f"{PATIENCE} steps after the first"
    ending = Ending()
    assert [hear(ending, step, 30.0 + step / 100) for step in range(10, 200, 10)] == [DONE] * 19
