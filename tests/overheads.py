"""Print what passes cost through PyTorch and through DiffVG's interface: ``python -m tests.overheads``.

CPU time of a forward and a backward pass, of the renderer itself, of ``warpsplat.torch``, and of
``warpsplat.pydiffvg`` with ``serialize_scene``, alternately on the scenes of ``warpsplat bench``; and of a
function of torch that only copies pydiffvg's tensors into one and splits its gradient: the least that so
many tensors cost. The tables are those of docs/benchmarks.md. On a busy machine with two threads, torch's
own wait for each other.
"""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import torch
import warp as wp
from torch._utils import _flatten_dense_tensors, _unflatten_dense_tensors

from warpsplat import pydiffvg
from warpsplat.rendering.backend import Backend, Viewport
from warpsplat.rendering.parameters import Parameters
from warpsplat.rendering.renderer import Renderer
from warpsplat.scene import Kind, Rule, Scene
from warpsplat.tools.bench import WARM_UP, bench_scene, passes_of
from warpsplat.torch import SceneTensors, render

SCENES = (
    ("closed", 512, (768, 512)),
    ("open", 512, (768, 512)),
    ("closed", 128, (384, 256)),
    ("open", 128, (384, 256)),  # as DiffVG's painterly_rendering
)


def own_passes(scene: Scene, image_grad: torch.Tensor, threads: int) -> Callable[[], None]:
    """Return the renderer's own passes."""
    canvas = scene.canvas
    parameters = Parameters(scene, Backend.on("cpu", threads))
    renderer = Renderer(parameters, Viewport(canvas.width, canvas.height))
    renderer.forward_complete()
    renderer.write_image_grad(image_grad[..., :3].numpy())
    return passes_of(renderer)


def torch_passes(scene: Scene, image_grad: torch.Tensor, threads: int) -> Callable[[], None]:
    """Return the passes through ``warpsplat.torch``."""
    tensors = SceneTensors.of(scene, requires_grad=True)
    inputs = [value for value in tensors.values.values() if value.requires_grad]

    def run() -> None:
        torch.autograd.grad(render(tensors, threads=threads), inputs, image_grad)

    return run


class Copy(torch.autograd.Function):
    """Tensors -> their numbers."""

    @staticmethod
    def forward(ctx: Any, *tensors: torch.Tensor) -> torch.Tensor:
        ctx.like = tensors
        return _flatten_dense_tensors(tensors)

    @staticmethod
    def backward(ctx: Any, grad: torch.Tensor) -> tuple[torch.Tensor, ...]:
        return tuple(_unflatten_dense_tensors(grad, ctx.like))


def diffvg_scene(scene: Scene, package: Any = pydiffvg) -> tuple[list[Any], list[Any], list[torch.Tensor]]:
    """Return shapes and groups, with tensors of their own, and those that require gradients.

    ``package``: ours, or DiffVG's own.
    """
    shapes: list[Any] = []
    groups: list[Any] = []
    leaves: list[torch.Tensor] = []
    for i in range(len(scene)):
        is_fill = scene.kind[i] == Kind.FILL
        points = torch.tensor(scene.points_of(i), requires_grad=True)
        color = torch.tensor([*scene.colors[i], scene.opacities[i]], requires_grad=True)
        width = torch.tensor(float(scene.widths[i]) / 2, requires_grad=not is_fill)
        counts = torch.full((len(points) // 3,), 2, dtype=torch.int32)
        shapes.append(package.Path(counts, points, bool(is_fill), width))
        fill, stroke = (color, None) if is_fill else (None, color)
        even_odd = scene.rule[i] == Rule.EVENODD
        ids = torch.tensor([i], dtype=torch.int32)
        groups.append(package.ShapeGroup(ids, fill, even_odd, stroke_color=stroke))
        leaves += [points, color] if is_fill else [points, color, width]
    return shapes, groups, leaves


def leaf_passes(scene: Scene, image_grad: torch.Tensor, threads: int) -> Callable[[], None]:
    """Return the passes of ``Copy`` on the tensors of ``pydiffvg_passes``."""
    leaves = diffvg_scene(scene)[2]
    grad = torch.ones(sum(map(torch.Tensor.numel, leaves)))

    def run() -> None:
        torch.autograd.grad(Copy.apply(*leaves), leaves, grad)

    return run


def pydiffvg_passes(
    scene: Scene, image_grad: torch.Tensor, threads: int, package: Any = pydiffvg
) -> Callable[[], None]:
    """Return the passes through ``warpsplat.pydiffvg``, which uses as many threads as torch, or DiffVG."""
    shapes, groups, leaves = diffvg_scene(scene, package)
    size = scene.canvas.width, scene.canvas.height

    def run() -> None:
        arguments = package.RenderFunction.serialize_scene(*size, shapes, groups)
        image = package.RenderFunction.apply(*size, 2, 2, 0, None, *arguments)
        torch.autograd.grad(image, leaves, image_grad)

    return run


def medians(kind: str, count: int, size: tuple[int, int], threads: int, repeats: int) -> list[float]:
    """Return the median CPU time of each kind of passes [ms]."""
    scene = bench_scene(kind, count, size, 0.9, 0)
    image_grad = torch.rand(size[1], size[0], 4, generator=torch.Generator().manual_seed(0))
    works = [
        make(scene, image_grad, threads) for make in (own_passes, torch_passes, pydiffvg_passes, leaf_passes)
    ]
    times = np.zeros((repeats + WARM_UP, len(works)))
    for one in times:
        for i, work in enumerate(works):
            begin = time.process_time()
            work()
            one[i] = 1e3 * (time.process_time() - begin)
    return [statistics.median(column) for column in times[WARM_UP:].T]


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(prog="python -m tests.overheads", description=__doc__)
    parser.add_argument("--threads", type=int, nargs="+", default=[1, 2])
    parser.add_argument("--repeats", type=int, default=20)
    options = parser.parse_args()
    wp.config.log_level = wp.LOG_ERROR
    print("| CPU ms a pass | threads | own | torch | ratio | pydiffvg | ratio | of it its tensors |")
    print("|---|---|---|---|---|---|---|---|")
    for threads in options.threads:
        torch.set_num_threads(threads)
        for kind, count, size in SCENES:
            own, torch_time, pydiffvg_time, leaves = medians(kind, count, size, threads, options.repeats)
            print(
                f"| {count} {kind}, {size[0]}x{size[1]} | {threads} | {own:.1f} | {torch_time:.1f} | "
                f"{torch_time / own:.2f} | {pydiffvg_time:.1f} | {pydiffvg_time / own:.2f} | {leaves:.1f} |",
                flush=True,
            )


if __name__ == "__main__":
    main()
