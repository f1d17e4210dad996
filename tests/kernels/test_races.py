"""Threads of a launch do not meet: no two write one element, and none reads what another one writes.

Every launch of real steps, of passes between them and of those through PyTorch is traced (``tests/tracing``).
A new kernel is tested once ``steps_of_all_kinds`` has it, which ``tests/fit/test_step.py`` asks for.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
import warp as wp

from tests import needs
from tests.drawing.drawings import BLUE, GOLD, WHITE, disc, drawing, polygon
from tests.fit.pictures import step_for, steps_of_all_kinds
from tests.helpers import renderer_for
from tests.kernels import racing
from tests.kernels.modules import all_kernels
from tests.lanes import divide_as_on_gpu
from tests.scenes import mixed_scene, with_gradients
from tests.tracing.trace import KINDS, Race, Tracer, tracing
from warpsplat.drawing.tidy import finish_drawing
from warpsplat.fit.problem import Run
from warpsplat.fit.settings import make_settings
from warpsplat.kernels.tile import quad, tile_column
from warpsplat.rendering.backend import GPU_LANES, Backend
from warpsplat.rendering.program import Program
from warpsplat.rendering.renderer import render
from warpsplat.scene import Canvas

THREADS = 2
"""Of steps: those for one are captured as a graph, which cannot be traced."""

LANES = {1: tile_column, 16: quad, GPU_LANES: quad}
"""Threads that share a tile, and the vectors of pixels that their kernels are made for. A tile has GPU_LANES
such vectors, so that there can be no more threads.
"""

NOT_LAUNCHED = {tile_column: {"sum_slots", "sum_lanes", "lane_sums"}, quad: set()}

WITHOUT_TORCH = {"tiles_to_pixels", "pixels_to_tiles"} if "torch" in needs.MISSING else set()

TWICE, SAME, NEIGHBOUR, FLOATS = KINDS

FLAGS = {("adam_update", "broken"), ("splat_forward", "slot_state"), ("soft_forward", "slot_state")}
"""Kernels and arrays in which several threads may write one element, always the same bits: the numbers of a
shape that are not finite, and the lanes of a tile that Gaussians reach."""

Arrays = list[np.ndarray]


def step_results() -> Iterator[Arrays]:
    """Make a step of each kind, and what is launched between steps; yield the results."""
    for step in steps_of_all_kinds("cpu", THREADS):
        step.advance()
        renderer, groups = step.renderer, step.state.parameters.groups.values()
        arrays = [array.numpy() for group in groups for array in (group.value, group.grad, group.moment2)]
        yield [
            *arrays,
            renderer.read_image(),
            step.objective.quadratic().removal_costs(),
            renderer.visible().share,
        ]
        assert np.isfinite(step.psnr())


def opaque_results() -> Iterator[Arrays]:
    """Render opaque shapes; yield gradients."""
    plain = mixed_scene(seed=1)
    painted = replace(with_gradients(mixed_scene(seed=2)), canvas=Canvas(40, 36, None))
    clear = replace(plain, canvas=painted.canvas)
    for scene, straight in ((plain, False), (painted, False), (clear, True), (painted, True)):
        renderer = renderer_for(scene, "cpu", threads=THREADS, opaque=True, straight=straight)
        renderer.write_image_grad(np.random.default_rng(0).normal(size=renderer.read_image().shape))
        renderer.backward()
        yield [renderer.read_image(), *renderer.parameters.gradients().values()]


def drawing_results() -> Iterator[Arrays]:
    """Fit and tidy a drawing; yield its points."""
    backend = Backend.on("cpu", THREADS)
    shapes = (BLUE, [disc(10, 9, 7)]), (GOLD, [polygon((4, 12), (12, 12), (20, 12), (17, 18), (5, 18))])
    exact, spread = (drawing(Canvas(24, 20, WHITE), *shapes, spread=far) for far in (0.0, 0.5))
    target = render(exact.scene, backend=backend)
    done = finish_drawing(target, spread, Run(backend), finest=10)
    yield [done.drawing.scene.points]


def torch_results() -> Iterator[Arrays]:
    """Render through PyTorch; yield an image and its gradients."""
    from warpsplat.torch import SceneTensors, clear_cache, render

    clear_cache()
    tensors = SceneTensors.of(mixed_scene(), requires_grad=True)
    image = render(tensors, 40, threads=THREADS)
    image.square().sum().backward()
    clear_cache()
    yield [image.detach().numpy(), *(v.grad.numpy() for v in tensors.values.values() if v.grad is not None)]


def distance_results() -> Iterator[Arrays]:
    """Compute distances from a scene of DiffVG's; yield them."""
    import torch

    from tests.pydiffvg.helpers import scene
    from warpsplat.pydiffvg.arguments import serialize
    from warpsplat.pydiffvg.distance import distances

    arguments = serialize(48, 48, *scene(), torch.device("cpu"))
    positions = torch.tensor(np.random.default_rng(0).uniform(0, 48, (99, 2)), dtype=torch.float32)
    yield [distances(arguments, positions, THREADS).numpy()]


def results(tracer: Tracer) -> list[Arrays]:
    """Launch every kernel; return what comes out."""
    with tracing(tracer):
        found = [*step_results(), *opaque_results(), *drawing_results()]
        if "torch" not in needs.MISSING:
            found += torch_results()
        if "pydiffvg" not in needs.MISSING:
            found += distance_results()
    return found


def unexpected(races: list[Race]) -> list[Race]:
    """Return those that are no flags."""
    return [race for race in races if race.kind != SAME or (race.kernel, race.arrays) not in FLAGS]


@pytest.mark.slow
@pytest.mark.parametrize("lanes", LANES)
def test_no_two_threads_meet(lanes: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Whatever the order in which they run, the bits are the same."""
    if lanes > 1:
        divide_as_on_gpu(monkeypatch, lanes)
    usual, shuffled = Tracer(), Tracer(np.random.default_rng(lanes))
    for one, other in zip(results(usual), results(shuffled), strict=True):
        for array, again in zip(one, other, strict=True):
            np.testing.assert_array_equal(array, again)
    for tracer in (usual, shuffled):
        assert not unexpected(tracer.races)
        assert not tracer.outside, "accesses outside of all arrays"
        every = {kernel.key for kernel in all_kernels(LANES[lanes])}
        assert every - tracer.kernels <= NOT_LAUNCHED[LANES[lanes]] | WITHOUT_TORCH


def test_exceptions_are_known() -> None:
    """Gradients that are not finite raise one flag from several threads; it is the only such write."""
    scene = mixed_scene(64, 48)
    scene.colors[2] = np.nan
    tracer = Tracer()
    with tracing(tracer):
        step_for(scene, np.ones((48, 64, 3), np.float32), "cpu", make_settings(), threads=THREADS).advance()
    assert {(race.kernel, race.arrays, race.kind) for race in tracer.races} == {
        ("adam_update", "broken", SAME)
    }


def races_of(kernel: wp.Kernel, shuffled: bool) -> list[Race]:
    """Return what is found when a kernel is launched for 8 x 4 threads."""
    tracer = Tracer(np.random.default_rng(3) if shuffled else None)
    source = wp.array(np.arange(64), dtype=wp.float32, device="cpu")
    result = wp.zeros(64, dtype=wp.float32, device="cpu")
    with tracing(tracer):
        program = Program(wp.get_device("cpu"), THREADS)
        program.launch(kernel, (8, 4), source=source, result=result, split=True)
        program.run()
    assert tracer.kernels == {kernel.key}
    return tracer.races


@pytest.mark.parametrize("shuffled", [False, True])
@pytest.mark.parametrize(
    ("kernel", "kinds"),
    [
        (racing.writes_own, set()),
        (racing.updates_own, set()),
        (racing.writes_next_too, {TWICE}),
        (racing.lanes_share, {TWICE}),
        (racing.raises_flag, {SAME}),
        (racing.reads_next, {NEIGHBOUR}),
        (racing.adds_up, {FLOATS}),
    ],
    ids=lambda value: value.key if isinstance(value, wp.Kernel) else "",
)
def test_wrong_kernels_are_found(kernel: wp.Kernel, kinds: set[str], shuffled: bool) -> None:
    assert {race.kind for race in races_of(kernel, shuffled)} == kinds
