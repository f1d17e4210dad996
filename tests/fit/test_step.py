"""Steps of optimisation."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests import needs
from tests.fit.pictures import picture, step_for, steps_of_all_kinds
from tests.helpers import relative_error
from tests.kernels.modules import all_kernels
from tests.lanes import divide_as_on_gpu
from tests.scenes import mixed_scene, with_gradients
from warpsplat.fit.export import export
from warpsplat.fit.place import grid_scene
from warpsplat.fit.rounding import evaluate_file
from warpsplat.fit.settings import LossName, Settings, make_settings
from warpsplat.metrics import psnr
from warpsplat.rendering.backend import GPU_LANES, Backend
from warpsplat.rendering.renderer import Capacity
from warpsplat.rendering.tiles import from_tiles
from warpsplat.scene import Canvas, FloatArray, Kind, Scene
from warpsplat.svg.viewer import on_white, render_svg


def new_scene(settings: Settings, image: FloatArray) -> Scene:
    return grid_scene(settings, image, settings.curves, np.random.default_rng(0))


@pytest.mark.parametrize("renderer", ["exact", "splat"])
@pytest.mark.parametrize("kind", [*Kind, None], ids=["fill", "stroke", "mixed"])
def test_a_captured_step_equals_single_launches(device: str, kind: Kind | None, renderer: str) -> None:
    """On a CPU a step is a graph where one thread is asked for; on a GPU always. Every loss is on."""
    target = np.random.default_rng(0).uniform(size=(48, 64, 3)).astype(np.float32)
    settings = make_settings(kind=kind, renderer=renderer, curves=10, iterations=50, xing=0.01)
    scene = mixed_scene(64, 48, splines=renderer == "exact")
    scene = scene if kind is None else new_scene(settings, target)
    scenes = []
    for graph in (True, False):
        step = step_for(scene, target, device, settings, threads=1)
        assert step.replay.graph is not None
        if not graph:
            step.replay.graph = None
        for _ in range(7):
            step.advance()
        scenes.append(step.state.scene())
    for name in ("points", "colors", "opacities", "widths"):
        np.testing.assert_array_equal(getattr(scenes[0], name), getattr(scenes[1], name))


NOT_IN_STEPS = {
    *("removal_cost", "visibility", "lane_sums"),
    *("tiles_to_pixels", "pixels_to_tiles"),
    *("opaque_backward", "opaque_paint_backward", "straight_forward", "straight_backward"),
    *("straight_paint_forward", "straight_paint_backward"),
    *("along", "crossings", "derivatives", "flatten", "nearest", "solve"),
}
"""Kernels that run between steps, in passes of ``warpsplat.torch``, or for drawings, on the host."""

NOT_IN_STEPS |= set() if "pydiffvg" in needs.MISSING else {"nearest_points"}

SEVERAL_LANES = {"sum_slots", "sum_lanes"}
"""Kernels for tiles that several threads share."""


@pytest.mark.parametrize("gpu_lanes", [False, True])
def test_every_kernel_is_in_a_captured_step(
    device: str, gpu_lanes: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """All that the package has, found by walking it: a graph can hold it, and something launches it."""
    if gpu_lanes:
        divide_as_on_gpu(monkeypatch)
    launched = set()
    for step in steps_of_all_kinds(device):
        assert step.replay.graph is not None
        launched |= {launch.name for program in step.programs for launch in program.launches}
    backend = Backend.on(device)
    every = {kernel.key for kernel in all_kernels(backend.column)}
    assert every - launched == NOT_IN_STEPS | (SEVERAL_LANES if backend.lanes == 1 else set())
    assert launched - every == {"array_scan", "radix_sort_pairs"}


@pytest.mark.parametrize(("planes", "loss"), [(3, "ssim"), (4, "l2"), (3, "edges"), (4, "edges")])
def test_a_step_is_the_same_with_the_lanes_of_a_gpu(
    device: str, planes: int, loss: LossName, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Loss, gradients with weights, and what densification reads back, but for rounding."""
    rng = np.random.default_rng(0)
    target = rng.uniform(size=(41, 59, planes)).astype(np.float32)
    scene = with_gradients(mixed_scene(59, 41))
    scene = replace(scene, canvas=Canvas(59, 41, None)) if planes == 4 else scene
    weights = rng.uniform(0.5, 1.5, (41, 59)).astype(np.float32)
    settings, found = make_settings(loss=loss, loss_weight=0.1, iterations=50), []
    for lanes in (1, 16, GPU_LANES):
        divide_as_on_gpu(monkeypatch, lanes)
        step = step_for(scene, target, device, settings, weights=weights)
        step.advance()
        gradients = step.renderer.parameters.gradients()
        visible = step.renderer.visible()
        near = step.objective.quadratic()
        read = near.removal_costs(), near.residual(), step.objective.by_pixel(), visible.share, visible.color
        found.append([np.array(step.objective.value()), np.array(step.psnr()), *gradients.values(), *read])
    for one, *others in zip(*found, strict=True):
        for many in others:
            assert relative_error(many, one) < 1e-4


@pytest.mark.parametrize("renderer", ["exact", "splat"])
def test_evaluating_a_file_that_outgrows_the_arrays(device: str, renderer: str) -> None:
    """The step is recorded again, and its loss is then that of the file, whatever the render shows."""
    settings = make_settings(curves=20, iterations=100, renderer=renderer)
    scene = new_scene(settings, picture())
    step = step_for(scene, picture(), device, settings, threads=1, capacity=Capacity(40, 9))
    before = step.replay.graph
    evaluate_file(step)
    assert step.replay.graph is not before
    assert step.renderer.capacity.slots > 9
    shown = on_white(render_svg(export(step.state.scene(), settings, step.state.per_pixel)))
    step.advance()
    assert step.psnr() == pytest.approx(psnr(shown, picture().astype(np.float64) * 255), abs=0.01)


@pytest.mark.parametrize(("width", "height"), [(61, 83), (83, 47), (20, 300)])
def test_files_are_evaluated_at_reduced_sizes_of_any_ratio(device: str, width: int, height: int) -> None:
    """The geometry is exactly that of the render, whatever the sides are rounded to."""
    settings = make_settings(curves=6, iterations=100, coarse_pixels=900, fine_pixels=2000)
    image = picture(width, height)
    step = step_for(new_scene(settings, image), image, device, settings)
    evaluate_file(step)
    viewport = step.target.viewport
    assert viewport.pixel_count < width * height
    shift = from_tiles(step.loss_target.target.numpy(), viewport.width, viewport.height)
    inner = (shift - step.target.image)[1:-1, 1:-1]
    assert np.abs(inner).mean() < 0.01
