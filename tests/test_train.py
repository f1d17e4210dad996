"""Whole runs: determinism, the loop's promises, and a real photograph."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import warp as wp

from warpsplat.config import QUALITIES, Density, Renderer, make_settings
from warpsplat.image import load_image
from warpsplat.metrics import psnr
from warpsplat.pipeline import vectorize
from warpsplat.render import Capacity
from warpsplat.scene import FloatArray, Kind
from warpsplat.svg import export
from warpsplat.tiles import from_tiles
from warpsplat.train import Progress, Trainer, phases
from warpsplat.viewer import on_white, render_svg

CAT = Path(__file__).parents[1] / "docs" / "images" / "cat.jpg"


def picture(width: int = 64, height: int = 48) -> FloatArray:
    """A bright disc on a gradient."""
    y, x = np.mgrid[:height, :width].astype(np.float32)
    image = np.stack([x / width, y / height, 0.3 + 0 * x], axis=2)
    image[np.hypot(x - 40, y - 20) < 12] = [0.9, 0.8, 0.1]
    return image


@pytest.mark.parametrize("kind", ["closed", "open"])
@pytest.mark.parametrize("renderer", ["exact", "splat"])
def test_same_seed_same_file_whatever_the_threads(device: str, kind: Kind, renderer: Renderer) -> None:
    settings = make_settings(
        kind=kind, renderer=renderer, curves=16, iterations=40, seed=3, coarse_pixels=1000
    )
    files = [vectorize(picture(), settings, wp.get_device(device), threads=n).svg for n in (1, 2, 1)]
    assert files[0] == files[1] == files[2]
    other = replace(settings, seed=4)
    assert vectorize(picture(), other, wp.get_device(device)).svg != files[0]


@pytest.mark.parametrize("kind", ["closed", "open"])
def test_the_loss_falls_and_the_count_stays(device: str, kind: Kind) -> None:
    settings = make_settings(kind=kind, curves=20, iterations=80, density=Density(interval=10))
    seen: list[Progress] = []
    result = vectorize(picture(), settings, wp.get_device(device), report=seen.append)
    assert len(result.scene) == 20
    assert result.score
    assert result.score.paths == 20
    assert seen[-1].step == seen[-1].steps == 80
    assert seen[-1].psnr > seen[0].psnr + 2
    assert result.score.psnr > 24
    assert abs(result.score.psnr - result.render_psnr) < 2


def test_paper_options_run(device: str) -> None:
    settings = make_settings(
        kind="open",
        renderer="splat",
        curves=8,
        iterations=30,
        segment_opacities=True,
        order="area",
        through_scales=False,
    )
    result = vectorize(picture(), settings, wp.get_device(device))
    assert len(result.scene) == 8
    assert result.scene.opacities.shape == (8, 3)
    assert result.score
    assert result.score.paths == 24


def test_small_in_front_with_area_order(device: str) -> None:
    settings = make_settings(curves=12, iterations=30, order="area", density=Density(interval=10, stop=1.0))
    trainer = Trainer(picture(), settings, wp.get_device(device))
    for _ in range(2):
        trainer._surgery(0.5) if trainer.renderer else trainer.enter(phases(settings, 64, 48)[0])
    areas = trainer.scene().areas()
    assert (np.diff(areas) <= 1e-3).all()


def test_stop_ends_the_run_early_with_a_file(device: str) -> None:
    settings = make_settings(curves=8, iterations=1000)
    calls = 0

    def stop() -> bool:
        nonlocal calls
        calls += 1
        return calls >= 5

    result = vectorize(picture(), settings, wp.get_device(device), stop=stop)
    assert result.stopped
    assert result.iterations == 5
    assert "<path" in result.svg


@pytest.mark.parametrize("size", [(2, 2), (3, 50), (33, 17), (100, 33)])
def test_odd_sizes(device: str, size: tuple[int, int]) -> None:
    image = np.random.default_rng(0).uniform(size=(size[1], size[0], 3)).astype(np.float32)
    result = vectorize(image, make_settings(curves=30, iterations=12), wp.get_device(device))
    assert (result.scene.width, result.scene.height) == size
    assert np.isfinite(result.scene.points).all()


def test_phases() -> None:
    settings = make_settings(iterations=100)
    coarse, fine = phases(settings, 768, 512)
    assert coarse.width * coarse.height <= 1.01 * settings.coarse_pixels
    assert (fine.width, fine.height) == (768, 512)
    assert len(phases(settings, 100, 80)) == 1
    large = phases(settings, 8000, 6000)[-1]
    assert large.width * large.height <= 1.01 * settings.fine_pixels


FIGURES = [("exact", "closed", 26.0, 0.15), ("exact", "open", 25.0, 0.4), ("splat", "closed", 24.0, 0.7)]


@pytest.mark.parametrize(("renderer", "kind", "figure", "gap"), FIGURES)
def test_a_photograph_reaches_its_figure(renderer: Renderer, kind: Kind, figure: float, gap: float) -> None:
    """451x300, 192 curves, 100 steps: PSNR of the file, and how much more the training render has."""
    settings = make_settings(renderer=renderer, kind=kind, curves=192, iterations=100, coarse_pixels=30_000)
    result = vectorize(load_image(CAT), settings, wp.get_device("cpu"))
    assert result.score
    assert result.score.psnr > figure
    assert abs(result.render_psnr - result.score.psnr) < gap


def test_time_budget_sizes_the_run(device: str) -> None:
    settings = make_settings(curves=12, time_budget="2s", coarse_pixels=1000)
    vectorize(picture(), replace(settings, time_budget=None, iterations=4), wp.get_device(device))  # compile
    result = vectorize(picture(), settings, wp.get_device(device))
    assert result.iterations > 20
    assert result.seconds < 2.5, "a step past the deadline at the most"
    assert not result.stopped


def test_target_psnr_ends_the_run(device: str) -> None:
    settings = make_settings(curves=20, iterations=3000, target_psnr=22.0)
    result = vectorize(picture(), settings, wp.get_device(device))
    assert result.score
    assert result.score.psnr >= 22
    assert result.iterations < 3000
    assert not result.missed
    missed = vectorize(picture(), replace(settings, iterations=10, target_psnr=60.0), wp.get_device(device))
    assert missed.missed[0].startswith("target-psnr 60 dB: reached ")


@pytest.mark.parametrize("kind", ["closed", "open"])
@pytest.mark.parametrize("precision", [0, 1, 2])
def test_max_bytes_are_used(device: str, kind: Kind, precision: int) -> None:
    """On a photograph; its curves fit a little more than the limit, and the least of them go."""
    settings = make_settings("draft", curves=900, kind=kind, precision=precision, max_bytes="20KB")
    result = vectorize(load_image(CAT), replace(settings, iterations=30), wp.get_device(device))
    assert result.score
    assert 0.95 * 20_000 < result.score.bytes <= 20_000
    assert result.missed == ()


def test_a_simple_image_gets_fewer_curves_unless_told(device: str) -> None:
    target = np.ones((64, 64, 3), np.float32)
    target[16:40, 20:50] = [1, 0, 0]
    settings = make_settings(iterations=5)
    assert len(vectorize(target, settings, wp.get_device(device)).scene) == 32
    told = make_settings(iterations=5, curves=50)
    assert len(vectorize(target, told, wp.get_device(device)).scene) == 50


def test_figures_of_the_render_and_of_the_file_have_their_own_names(device: str) -> None:
    """Splats leak: the file is worse than the render, and the estimate knows."""
    settings = make_settings(curves=60, iterations=120, precision=0, renderer="splat")
    trainer = Trainer(picture(), settings, wp.get_device(device))
    trainer.run()
    assert trainer.renderer
    render = 255 * trainer.renderer.read_image()
    file = psnr(on_white(render_svg(export(trainer.scene(), settings))), 255 * picture())
    assert trainer.render_psnr() == pytest.approx(psnr(render, 255 * picture()))
    assert trainer.render_psnr() > trainer.psnr() + 0.1
    assert abs(trainer.psnr() - file) < abs(trainer.render_psnr() - file)


def test_max_bytes_is_kept(device: str) -> None:
    for limit in (900, 3000):
        settings = make_settings(curves=200, iterations=15, max_bytes=limit)
        result = vectorize(picture(), settings, wp.get_device(device))
        assert result.score
        assert result.score.bytes <= limit
        assert len(result.scene) >= limit // 300 - 1
    tiny = vectorize(picture(), replace(settings, max_bytes=50), wp.get_device(device))
    assert "max-bytes 50" in tiny.missed[0]


def test_a_look_at_the_file_that_outgrows_the_arrays(device: str) -> None:
    """The step is recorded anew, and its loss is then that of the file."""
    settings = make_settings(curves=20, iterations=100)
    trainer = Trainer(picture(), settings, wp.get_device(device), threads=1)
    trainer.enter(phases(settings, 64, 48)[-1])
    assert trainer.renderer
    trainer.renderer.capacity = Capacity(40, 9)
    trainer.renderer.rebuild()
    before = trainer.graph
    trainer._look()
    assert trainer.graph is not before
    assert trainer.renderer.capacity.slots > 9
    shown = on_white(render_svg(export(trainer.scene(), settings)))
    trainer.advance()
    assert trainer.psnr() == pytest.approx(psnr(shown, picture().astype(np.float64) * 255), abs=0.01)


@pytest.mark.parametrize(("width", "height"), [(61, 83), (83, 47), (20, 300)])
def test_reduced_sizes_of_any_ratio(device: str, width: int, height: int) -> None:
    """The file is looked at in exactly the geometry of the render, whatever the sides are rounded to."""
    settings = make_settings(curves=6, iterations=100, coarse_pixels=900, fine_pixels=2000)
    trainer = Trainer(picture(width, height), settings, wp.get_device(device))
    trainer.enter(phases(settings, width, height)[-1])
    trainer._look()
    assert trainer.renderer
    shift = from_tiles(trainer.device_target.numpy(), trainer.renderer.width, trainer.renderer.height)
    inner = (shift - trainer.small)[1:-1, 1:-1]
    assert np.abs(inner).mean() < 0.01
    assert len(trainer.run()) == 6


@pytest.mark.parametrize(
    ("width", "height"),
    [(1080, 2400), (3000, 4000), (2480, 3508), (1920, 1080), (1200, 1600), (600, 8000), (8, 40000)],
)
def test_one_scale_serves_both_sides(width: int, height: int) -> None:
    for quality in QUALITIES:
        for phase in phases(make_settings(quality), width, height):
            scale = phase.width / width
            assert abs(height * scale - phase.height) < 0.5
            assert phase.width * phase.height <= width * height
