"""Time a forward and backward pass through PyTorch against the renderer's own."""

from __future__ import annotations

import statistics
from dataclasses import asdict
from typing import Any

import torch
import warp as wp

from warpsplat.rendering.program import capture
from warpsplat.rendering.renderer import Renderer
from warpsplat.tools.timing import WARM_UP, Spread, timed
from warpsplat.torch import SceneTensors, render


def bench_torch(own: Renderer, repeats: int) -> dict[str, Any]:
    """Time ``repeats`` passes of each, alternately, after a warm-up.

    Args:
        own: renders the scene, as a step does it.
        repeats: of both.

    Returns:
        ``own`` and ``torch`` as median, low and high [ms]; ``ratio``, the median of torch's time over the own
        time just before.
    """
    device, viewport = own.backend.device, own.viewport
    place = wp.device_to_torch(device)
    tensors = SceneTensors.of(own.parameters.scene(), place, requires_grad=True)
    wanted = [value for value in tensors.values.values() if value.requires_grad]
    gradient = torch.rand(viewport.height, viewport.width, 4, dtype=torch.float32, device=place)
    programs = (own.forward_program, own.backward_program)
    graph = capture(device, programs)

    def pass_own() -> None:
        if graph:
            wp.capture_launch(graph)
        else:
            own.forward()
            own.backward()

    def pass_torch() -> None:
        image = render(tensors, viewport.width, renderer=own.model, threads=own.backend.threads)
        torch.autograd.grad(image, wanted, gradient)

    pairs = [(timed(device, pass_own), timed(device, pass_torch)) for _ in range(repeats + WARM_UP)]
    first, second = (list(seconds) for seconds in zip(*pairs[WARM_UP:], strict=True))
    ratio = statistics.median(b / a for a, b in pairs[WARM_UP:])
    return {
        "own": asdict(Spread.of(first)),
        "torch": asdict(Spread.of(second)),
        "ratio": round(ratio, 3),
    }
