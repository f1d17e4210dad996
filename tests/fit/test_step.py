"""Steps: recorded, captured, rendered as the file is; surgery between them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.drawing.drawings import seam
from tests.fit.pictures import picture
from tests.kernels.modules import kernel_modules, kernels_of
from tests.scenes import mixed_scene, picture_scene, with_gradients
from warpsplat.drawing.fit_outlines import Refinement, start
from warpsplat.extensions import renderer_names
from warpsplat.fit.export import export
from warpsplat.fit.place import grid_scene
from warpsplat.fit.schedule import Phase, phases
from warpsplat.fit.settings import Density, Renderer, Settings, make_settings
from warpsplat.fit.state import FitState
from warpsplat.fit.step import Step, Target
from warpsplat.fit.surgery import operate
from warpsplat.fit.viewer_shift import look_at_file
from warpsplat.metrics import psnr
from warpsplat.rendering.backend import Backend
from warpsplat.rendering.renderer import Capacity
from warpsplat.rendering.tiles import from_tiles
from warpsplat.scene import Canvas, Cap, FloatArray, Kind, Paint, Picture, Scene
from warpsplat.scene.geometry import areas
from warpsplat.svg.viewer import on_white, render_svg


def step_for(
    image: FloatArray,
    settings: Settings,
    device: str,
    *,
    threads: int | None = None,
    scene: Scene | None = None,
    capacity: Capacity | None = None,
) -> Step:
    """At the finest size."""
    rng = np.random.default_rng(settings.seed)
    scene = scene or grid_scene(settings, image, settings.curves, rng)
    state = FitState.start(scene, Backend.on(device, threads), rng)
    target = Target(image, phases(settings, image.shape[1], image.shape[0])[-1])
    return Step(state, settings, target, capacity=capacity)


def test_a_coarse_step_has_fewer_vertices(device: str) -> None:
    settings, image = make_settings(curves=10), picture()
    counts = []
    for slack in (1.0, 4.0):
        rng = np.random.default_rng(0)
        state = FitState.start(grid_scene(settings, image, 10, rng), Backend.on(device), rng)
        step = Step(state, settings, Target(image, Phase(64, 48, slack)))
        counts.append(int(step.renderer.needed_samples.numpy()[0]))
    assert 0.4 < counts[1] / counts[0] < 0.7, "half as many pieces, each rounded up"


@pytest.mark.parametrize("renderer", ["exact", "splat"])
@pytest.mark.parametrize("kind", [*Kind, None], ids=["fill", "stroke", "mixed"])
def test_a_captured_step_does_what_its_launches_do(device: str, kind: Kind | None, renderer: str) -> None:
    """On a CPU a step is a graph where one thread is asked for; on a GPU always. Every loss is on."""
    target = np.random.default_rng(0).uniform(size=(48, 64, 3)).astype(np.float32)
    settings = make_settings(kind=kind, renderer=renderer, curves=10, iterations=50, xing=0.01)
    scene = mixed_scene(64, 48, splines=renderer == "exact") if kind is None else None
    scenes = []
    for graph in (True, False):
        step = step_for(target, settings, device, threads=1, scene=scene)
        assert step._graph is not None
        if not graph:
            step._graph = None
        for _ in range(7):
            step.advance()
        scenes.append(step.state.scene())
    for name in ("points", "colors", "opacities", "widths"):
        np.testing.assert_array_equal(getattr(scenes[0], name), getattr(scenes[1], name))


OF_TORCH = {"pixels", "composite_opaque", "composite_straight"}
"""Kernels of passes that are no steps: those of ``warpsplat.torch``."""


def test_every_kernel_is_in_a_captured_step(device: str) -> None:
    """All that the package has, found by walking it: a graph can hold it, and something launches it."""
    launched = {"removal_cost", "visibility"}  # between steps
    for renderer in renderer_names():
        settings = make_settings(renderer=renderer, iterations=50, xing=0.01)
        scene = mixed_scene(64, 48, splines=renderer == "exact")
        step = step_for(picture(), settings, device, threads=1, scene=scene)
        assert step._graph is not None
        launched |= {launch.name for program in step.programs for launch in program.launches}
    scene = with_gradients(mixed_scene(64, 48))
    stroke = int(np.flatnonzero(scene.kind == Kind.STROKE)[0])
    twins = scene.take(np.array([stroke, stroke]))
    scene = scene.append(replace(twins, twin=np.array([0, 1], np.int32)))
    scene = replace(scene, cap=np.full(len(scene), Cap.BUTT, np.int32), canvas=Canvas(64, 48, None))
    kept = Picture("<g/>", (64, 48), (9, 9), np.full((20, 20, 4), 0.5, np.float32))
    scene = scene.append(picture_scene(scene.canvas, kept))
    target = np.concatenate([picture(), np.ones((48, 64, 1), np.float32)], axis=2)
    step = step_for(target, make_settings(iterations=50), device, threads=1, scene=scene)
    assert step._graph is not None
    launched |= {launch.name for program in step.programs for launch in program.launches}
    tied = start(np.ones((32, 48, 3), np.float32), seam(), Backend.on(device, 1), Refinement())
    assert tied._graph is not None
    launched |= {launch.name for program in tied.programs for launch in program.launches}
    layered = with_gradients(mixed_scene(64, 48))
    unit = np.array([30, 20, 9, 0, 0, 9], np.float32)  # a circle
    radial = (layered.paint == Paint.RADIAL)[:, None]
    layered = replace(layered, frames=np.where(radial, unit, layered.frames))
    layered = replace(layered, layer=np.minimum(np.arange(len(layered)), 1).astype(np.int32))
    step = step_for(picture(), make_settings(iterations=50), device, threads=1, scene=layered)
    assert step._graph is not None
    launched |= {launch.name for program in step.programs for launch in program.launches}
    modules = [m for m in kernel_modules() if m.__name__.rpartition(".")[2] not in OF_TORCH]
    every = {kernel.key for module in modules for kernel in kernels_of(module)}
    assert every <= launched
    assert launched - every == {"array_scan", "radix_sort_pairs"}


def test_a_mixed_scene_comes_nearer_to_the_image(device: str) -> None:
    """Fills and strokes of different lengths in one optimisation: all move, only strokes have widths."""
    scene = mixed_scene(64, 48, seed=2)
    step = step_for(picture(), make_settings(iterations=60), device, scene=scene)
    step.advance()
    before = step.psnr()
    for _ in range(40):
        step.advance()
    assert step.psnr() > before + 1
    after = step.state.scene()
    np.testing.assert_array_equal(after.first, scene.first)
    for i in range(len(scene)):
        assert np.abs(after.points_of(i) - scene.points_of(i)).max() > 0.1
    assert not after.widths[scene.kind == Kind.FILL].any()
    assert (after.widths != scene.widths)[scene.kind == Kind.STROKE].all()


def test_recorded_steps_refuse_to_run_after_surgery(device: str) -> None:
    """Their launches hold the addresses of arrays that are gone."""
    settings = make_settings(curves=12, iterations=100)
    old = step_for(picture(), settings, device)
    old.advance()
    new = operate(old, grows=False)
    for refused in (old.advance, lambda: old.configure(settings), old.render, lambda: old.time(1)):
        with pytest.raises(RuntimeError, match="surgery"):
            refused()
    assert new.state.step == 1
    new.advance()
    assert new.state.step == 2
    assert np.isfinite(new.psnr())


@pytest.mark.parametrize("kind", list(Kind))
def test_surgery_keeps_the_number_or_follows_the_schedule(device: str, kind: Kind) -> None:
    settings = make_settings(kind=kind, curves=30, iterations=100, density=Density(interval=25))
    image = picture()
    rng = np.random.default_rng(0)
    state = FitState.start(grid_scene(settings, image, 10, rng), Backend.on(device), rng)
    step = Step(state, settings, Target(image, phases(settings, 64, 48)[-1]))
    for _ in range(25):
        step.advance()
    same = operate(step, grows=False)
    assert same.state.parameters.shape_count == 10
    more = operate(same, grows=True)
    assert 10 < more.state.parameters.shape_count < 30


def test_small_in_front_with_area_order(device: str) -> None:
    settings = make_settings(curves=12, iterations=30, order="area", density=Density(interval=10, stop=1.0))
    step = step_for(picture(), settings, device)
    step.advance()
    step = operate(step, grows=False)
    sizes = areas(step.state.scene())
    assert sizes.max() > sizes.min()
    assert (np.diff(sizes) <= 1e-3).all()


@pytest.mark.parametrize("renderer", ["exact", "splat"])
def test_a_look_at_the_file_that_outgrows_the_arrays(device: str, renderer: Renderer) -> None:
    """The step is recorded anew, and its loss is then that of the file, whatever the render shows."""
    settings = make_settings(curves=20, iterations=100, renderer=renderer)
    step = step_for(picture(), settings, device, threads=1, capacity=Capacity(40, 9))
    before = step._graph
    look_at_file(step)
    assert step._graph is not before
    assert step.renderer.capacity.slots > 9
    shown = on_white(render_svg(export(step.state.scene(), settings, step.state.per_pixel)))
    step.advance()
    assert step.psnr() == pytest.approx(psnr(shown, picture().astype(np.float64) * 255), abs=0.01)


@pytest.mark.parametrize(("width", "height"), [(61, 83), (83, 47), (20, 300)])
def test_reduced_sizes_of_any_ratio(device: str, width: int, height: int) -> None:
    """The file is looked at in exactly the geometry of the render, whatever the sides are rounded to."""
    settings = make_settings(curves=6, iterations=100, coarse_pixels=900, fine_pixels=2000)
    step = step_for(picture(width, height), settings, device)
    look_at_file(step)
    viewport = step.target.viewport
    assert viewport.pixel_count < width * height
    shift = from_tiles(step.aim.target.numpy(), viewport.width, viewport.height)
    inner = (shift - step.target.image)[1:-1, 1:-1]
    assert np.abs(inner).mean() < 0.01
