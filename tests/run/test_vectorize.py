"""Whole runs: determinism, the loop's promises, and a real photograph."""

from __future__ import annotations

import itertools
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from PIL import Image

import warpsplat
from tests import ROOT
from tests.fit.pictures import picture
from tests.runs import scored, vectorize
from warpsplat.extensions import renderer_names
from warpsplat.files.sources import image_of
from warpsplat.fit import clear
from warpsplat.fit.export import show
from warpsplat.fit.progress import Progress
from warpsplat.fit.settings import Density, make_settings
from warpsplat.metrics import score_svg
from warpsplat.rendering.backend import Backend
from warpsplat.run.figures import missed_goals
from warpsplat.scene import Kind, Scene
from warpsplat.svg.write import read_metadata

CAT = ROOT / "docs" / "images" / "cat.jpg"


@pytest.mark.slow
@pytest.mark.parametrize("kind", list(Kind))
@pytest.mark.parametrize("renderer", renderer_names())
def test_same_seed_same_file_whatever_the_threads(device: str, kind: Kind, renderer: str) -> None:
    settings = make_settings(
        kind=kind, renderer=renderer, curves=16, iterations=20, seed=3, coarse_pixels=1000
    )
    files = [vectorize(picture(), settings, Backend.on(device, n)).svg for n in (1, 2)]
    assert files[0] == files[1]
    other = replace(settings, seed=4)
    assert vectorize(picture(), other, Backend.on(device)).svg != files[0]


@pytest.mark.parametrize("kind", list(Kind))
def test_the_loss_falls_and_the_count_stays(device: str, kind: Kind) -> None:
    settings = make_settings(kind=kind, curves=20, iterations=80, density=Density(interval=10))
    seen: list[Progress] = []
    result = vectorize(picture(), settings, Backend.on(device), report=seen.append)
    assert len(result.scene) == 20
    assert scored(result).paths == 20
    assert seen[-1].step == seen[-1].steps == 80
    assert seen[-1].psnr > seen[0].psnr + 2
    assert scored(result).psnr > 24
    assert abs(scored(result).psnr - result.render_psnr) < 2


@pytest.mark.parametrize("size", [(2, 2), (3, 50), (33, 17), (100, 33)])
def test_odd_sizes(device: str, size: tuple[int, int]) -> None:
    image = np.random.default_rng(0).uniform(size=(size[1], size[0], 3)).astype(np.float32)
    result = vectorize(image, make_settings(curves=30, iterations=12), Backend.on(device))
    assert (result.scene.canvas.width, result.scene.canvas.height) == size
    assert np.isfinite(result.scene.points).all()


FIGURES = [
    ("exact", Kind.FILL, 26.0, 0.15),
    ("exact", Kind.STROKE, 25.0, 0.4),
    ("splat", Kind.FILL, 24.0, 0.7),
]


@pytest.mark.slow
@pytest.mark.parametrize(("renderer", "kind", "figure", "gap"), FIGURES)
def test_a_photograph_reaches_its_figure(renderer: str, kind: Kind, figure: float, gap: float) -> None:
    """451x300, 192 curves, 100 steps: PSNR of the file, and how much more the training render has."""
    settings = make_settings(renderer=renderer, kind=kind, curves=192, iterations=100, coarse_pixels=30_000)
    result = vectorize(image_of(CAT), settings, Backend.on("cpu"))
    assert scored(result).psnr > figure
    assert abs(result.render_psnr - scored(result).psnr) < gap


def test_time_budget_sizes_the_run(device: str) -> None:
    settings = make_settings(curves=12, time_budget="2s", coarse_pixels=1000)
    vectorize(picture(), replace(settings, time_budget=None, iterations=4), Backend.on(device))  # compile
    result = vectorize(picture(), settings, Backend.on(device))
    assert result.iterations > 20
    assert result.seconds < 6, "a step past the deadline at the most, however busy the machine"
    assert not result.stopped


def test_target_psnr_is_reached_with_few_bytes(device: str) -> None:
    """The file is smaller than one of a fixed number of shapes."""
    settings = make_settings(iterations=100, target_psnr=24.0)
    result = vectorize(picture(), settings, Backend.on(device))
    assert 24 <= scored(result).psnr < 31, "24.1 to 27.4 over five seeds"
    assert not result.missed
    plain = vectorize(
        picture(), make_settings(iterations=100, curves=2 * len(result.scene)), Backend.on(device)
    )
    assert scored(result).bytes < 0.75 * scored(plain).bytes, "0.43 to 0.51 over five seeds"


def test_target_psnr_within_a_size_and_a_time(device: str) -> None:
    settings = make_settings(iterations=20, target_psnr=60.0, max_bytes=1500)
    result = vectorize(picture(), settings, Backend.on(device))
    assert 0.9 * 1500 < scored(result).bytes <= 1500
    late = vectorize(picture(), replace(settings, max_bytes=None, time_budget=0.5), Backend.on(device))
    assert not late.stopped
    assert late.missed[0].startswith("target-psnr 60 dB: reached ")


@pytest.mark.parametrize("asked", [3, 25, 45])
def test_a_goal_may_be_interrupted_anywhere(device: str, asked: int) -> None:
    """In a probe run, in the first fit, and while shapes are added: the best so far is the result."""
    steps = itertools.count()
    settings = make_settings(iterations=20, curves=10, target_psnr=60.0)
    result = vectorize(picture(), settings, Backend.on(device), stop=lambda: next(steps) >= asked)
    assert result.stopped
    assert "stopped" in read_metadata(result.svg)


def test_max_bytes_is_kept(device: str) -> None:
    for limit in (900, 3000):
        settings = make_settings(curves=200, iterations=15, max_bytes=limit)
        result = vectorize(picture(), settings, Backend.on(device))
        assert scored(result).bytes <= limit
        assert len(result.scene) >= limit // 300 - 1
    tiny = vectorize(picture(), replace(settings, max_bytes=50), Backend.on(device))
    assert "max-bytes 50" in tiny.missed[0]


@pytest.mark.parametrize(("kind", "precision"), [(Kind.FILL, 0), (Kind.STROKE, 1)])
def test_max_bytes_are_used(device: str, kind: Kind, precision: int) -> None:
    """The shapes of a photograph take a little more than the limit, and the least of them go."""
    settings = make_settings("draft", curves=900, kind=kind, precision=precision, max_bytes="20KB")
    result = vectorize(image_of(CAT), replace(settings, iterations=30), Backend.on(device))
    assert 0.95 * 20_000 < scored(result).bytes <= 20_000
    assert result.missed == ()


def test_a_simple_image_gets_fewer_shapes_unless_told(device: str) -> None:
    target = np.ones((64, 64, 3), np.float32)
    target[16:40, 20:50] = [1, 0, 0]
    settings = make_settings(iterations=5)
    assert len(vectorize(target, settings, Backend.on(device)).scene) == 32
    told = make_settings(iterations=5, curves=50)
    assert len(vectorize(target, told, Backend.on(device)).scene) == 50


LINES = np.ones((64, 64, 3), np.float32)
LINES[20:22, 8:56] = LINES[8:56, 40:42] = 0

DISCS = np.ones((48, 64, 3), np.float32)
DISCS[8:40, 10:30] = [0.9, 0.2, 0.1]
DISCS[20:44, 36:56] = [0.1, 0.3, 0.8]

STRATEGIES = {
    "fit": (picture(), {"curves": 8, "iterations": 30}),
    "layers": (picture(), {"levels": "3,8", "iterations": 20}),
    "psnr": (picture(), {"target_psnr": 22.0, "iterations": 20, "curves": 30}),
    "bytes": (picture(), {"max_bytes": 900, "iterations": 20}),
    "time": (picture(), {"curves": 8, "time_budget": 1.0, "coarse_pixels": 1000}),
    "drawing": (DISCS, {"subject": "drawing"}),
    "drawing within a size": (DISCS, {"subject": "drawing", "max_bytes": 200}),
    "line": (LINES, {"subject": "line"}),
}


@pytest.mark.parametrize("strategy", STRATEGIES)
def test_work_grows_to_one(device: str, strategy: str) -> None:
    image, given = STRATEGIES[strategy]
    seen: list[Progress] = []
    vectorize(image, make_settings(**given), Backend.on(device), report=seen.append)
    work = [progress.work for progress in seen]
    assert work == sorted(work) and len(work) > 1
    assert 0 <= work[0] < 0.9 and work[-1] == 1
    assert all(progress.snapshot for progress in seen)


@pytest.mark.parametrize(
    ("budget", "took", "compiling", "told"),
    [
        (2, 1.9, 0, ""),
        (2, 2.1, 0, ""),  # hundredths of a second
        (2, 2.3, 0, "time-budget 2 s: took 2.3 s"),
        (5, 10.8, 7.04, "took 10.8 s, of which compiling took 7.0 s, which later runs do not need"),
        (5, 10.8, 2, "time-budget 5 s: took 10.8 s"),
        (5, 5.1, 5, ""),
    ],
)
def test_missed_time_budgets(budget: float, took: float, compiling: float, told: str) -> None:
    score = score_svg('<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 8 8"/>', picture(8, 8))
    goals = missed_goals(make_settings(time_budget=float(budget)), score, took, compiling)
    assert len(goals) == bool(told) and "".join(goals).endswith(told)


def test_a_run_can_be_stopped_while_outlines_are_drawn_back(monkeypatch: pytest.MonkeyPatch) -> None:
    """The file says that it was cut short, as that of a run that was stopped before."""
    rounds = list[str]()

    def counted(text: str, scene: Scene) -> Image.Image:
        rounds.append(text)
        return show(text, scene)

    monkeypatch.setattr(clear, "show", counted)
    image = np.dstack([picture(), np.tri(*picture().shape[:2], dtype=np.float32)])
    options: dict[str, Any] = {"subject": "photo", "iterations": 20, "device": "cpu", "threads": 1}
    stopped = warpsplat.vectorize(image, 8, stop=lambda: bool(rounds), **options)
    assert stopped.stopped
    assert len(rounds) == 1
    assert not warpsplat.vectorize(image, 8, **options).stopped
    assert len(rounds) > 2
