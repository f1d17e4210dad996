"""Fits of several numbers of shapes that continue from each other."""

from __future__ import annotations

import pytest

from tests.fit.pictures import picture
from warpsplat.fit.loop import fit
from warpsplat.fit.problem import Problem, Run
from warpsplat.fit.progress import Progress
from warpsplat.fit.schedule import shapes_at
from warpsplat.fit.settings import Settings, make_settings
from warpsplat.rendering.backend import Backend
from warpsplat.search.series import Series, begin_of, growing


@pytest.mark.parametrize(("few", "share"), [(10, 0.25), (128, 0.275), (180, 0.35), (250, 0.375)])
def test_a_fit_begins_where_its_schedule_has_as_many_shapes(few: int, share: float) -> None:
    settings = make_settings(curves=256)
    begin = begin_of(settings, round(1.5 * few))
    assert begin == pytest.approx(1000 * share, abs=25) and begin % 25 == 0
    if few == 180:
        assert shapes_at(settings, begin) == pytest.approx(1.5 * few, rel=0.1)


@pytest.mark.parametrize(("few", "many"), [(50, 200), (200, 250), (10, 9000)])
def test_the_schedule_goes_on_from_the_shapes_that_there_are(few: int, many: int) -> None:
    settings, full = make_settings(curves=many), round(1.5 * few)
    begin = begin_of(settings, full)
    chosen = growing(settings, full, begin)
    assert shapes_at(chosen, begin) == pytest.approx(full, rel=0.02) or chosen.density.start == 1e-3
    counts = [shapes_at(chosen, step) for step in range(begin, 501, 25)]
    assert counts == sorted(counts) and counts[-1] == round(1.5 * many)
    assert all(shapes_at(chosen, step) == shapes_at(settings, step) for step in (700, 1000))


def quick() -> Settings:
    return make_settings(
        subject="photo", iterations=60, curves=4, coarse_pixels=400, density={"interval": 3}, viewer=False
    )


def test_shapes_go_on_with_their_past() -> None:
    """The first step of another fit is the next one of the first: the optimizer forgot nothing."""
    settings, seen = quick(), list[Progress]()
    run, series = Run(Backend.on("cpu", 1), seen.append), Series(quick(), (4, 8))
    first, none = series.next(4)
    assert none is None
    fit(Problem(picture(), first), series.part(4, run))
    assert [p.work for p in seen] == sorted(p.work for p in seen)
    assert seen[-1].work == pytest.approx(1 / 3)
    second, start = series.next(8)
    assert start is not None and start.past is not None and start.scene is not None
    assert start.begin == begin_of(second, 6) > 0
    assert len(start.scene) == round(1.5 * 4), "the surplus, before it is thinned"
    assert start.past.ages.max() >= 0.6 * settings.iterations
    moments = start.past.moments[1]["points"]
    assert moments.shape == start.scene.points.shape and (moments > 0).any()
    made = fit(Problem(picture(), second), series.part(8, run), start)
    assert len(made.scene) == 8
    assert made.iterations == settings.iterations - start.begin
    assert seen[-1].work == 1
