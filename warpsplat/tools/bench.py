"""Time the stages of a training step on a random scene."""

from __future__ import annotations

import statistics
import sys
import time
from collections import defaultdict
from collections.abc import Callable, Sequence
from typing import Any

import cv2
import numpy as np
import warp as wp

from warpsplat.errors import UsageError
from warpsplat.fit.place import STROKE_CUBICS, circle_outlines
from warpsplat.fit.schedule import Phase
from warpsplat.fit.settings import Density, Settings, default_rates
from warpsplat.fit.state import FitState
from warpsplat.fit.step import Step, Target
from warpsplat.rendering.backend import Backend
from warpsplat.rendering.program import Replay
from warpsplat.rendering.renderer import Renderer
from warpsplat.run.options import KINDS
from warpsplat.scene import Canvas, FloatArray, Kind, Scene

WARM_UP = 3
"""Steps that are not counted."""


def bench_scene(name: str, curves: int, size: tuple[int, int], opacity: float, seed: int) -> Scene:
    """Return shapes of uniform centre and radius: 4 cubics on a jittered circle, or 3 on a jittered line."""
    kind, (width, height) = KINDS[name], size
    rng = np.random.default_rng(seed)
    centres = rng.uniform(0, [width, height], (curves, 2))
    radii = width * rng.uniform(0.05, 0.1, curves) * (0.5 if width > 2000 else 1.0)
    jitter = 0.2  # standard deviation of the control points' distance from the centre, over the radius
    if kind == Kind.FILL:
        circles = circle_outlines(np.zeros((curves, 2)), np.ones(curves), 2)
        offsets = circles * (1 + jitter * rng.normal(size=(curves, circles.shape[1], 1)))
    else:
        angle = rng.uniform(0, np.pi, curves)
        along = np.linspace(-1, 1, 3 * STROKE_CUBICS + 1)
        lines = along[None, :, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)[:, None]
        offsets = lines + jitter * rng.normal(size=lines.shape)
    return Scene.uniform(
        kind,
        Canvas(width, height, np.zeros(3, np.float32)),
        np.asarray(centres[:, None] + radii[:, None, None] * offsets, np.float32),
        colors=rng.uniform(0, 1, (curves, 3)).astype(np.float32),
        opacities=np.full(curves, opacity, np.float32),
        widths=np.full(curves, 0.0 if kind == Kind.FILL else 3.0, np.float32),
    )


def bench_target(width: int, height: int, seed: int) -> FloatArray:
    """Return smooth noise: sRGB in [0, 1], shape (height, width, 3)."""
    noise = np.random.default_rng(seed).uniform(0, 1, (height, width, 3)).astype(np.float32)
    return np.asarray(cv2.GaussianBlur(noise, (0, 0), 8.0), np.float32)


def peak_memory(device: wp.Device) -> int | None:
    """Return the peak memory so far [bytes] of the process, or of the device's pool; None if unknown."""
    if device.is_cuda:
        return int(wp.get_mempool_used_mem_high(device)) if wp.is_mempool_enabled(device) else None
    try:
        import resource
    except ImportError:  # Windows
        return None
    unit = 1 if sys.platform == "darwin" else 1024
    return unit * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


def bench(
    scene: Scene, renderer: Any, backend: Backend, repeats: int, seed: int, through_torch: bool = False
) -> dict[str, Any]:
    """Time ``repeats`` steps after a warm-up. Nothing moves: all learning rates are 0.

    Returns what ``time_steps`` does, counts, memory and, with ``through_torch``, what ``time_torch`` does.
    """
    if through_torch:
        check_torch(backend.device)
    curves, width, height = len(scene), scene.canvas.width, scene.canvas.height
    settings = Settings(
        kind=Kind(int(scene.kind[0])),
        curves=curves,
        renderer=renderer,
        rates=dict.fromkeys(default_rates(), 0.0),
        density=Density(interval=0),
        iterations=1000,
    )
    target = Target(bench_target(width, height, seed), Phase(width, height))
    step = Step(FitState.start(scene, backend, np.random.default_rng(seed)), settings, target)
    times = time_steps(step, repeats)
    median = times["step"]["median"]
    return {
        "renderer": renderer,
        "device": str(backend.device),
        "device_name": backend.device.name,
        "threads": backend.threads,
        "shapes": curves,
        "curves": curves,  # former name
        "width": width,
        "height": height,
        "pairs": int(step.renderer.needed_slots.numpy()[0]),
        "samples": int(step.renderer.needed_samples.numpy()[0]),
        **times,
        "megapixels_per_s": round(width * height / 1e3 / median, 3),
        "us_per_shape": round(1e3 * median / curves, 3),
        "us_per_curve": round(1e3 * median / curves, 3),  # former name
        "ns_per_pixel": round(1e6 * median / (width * height), 3),
        **({"through_torch": time_torch(step.renderer, repeats)} if through_torch else {}),
        "peak_memory": peak_memory(backend.device),
    }


def summary(seconds: Sequence[float]) -> dict[str, float]:
    """Return median, lowest and highest [ms]."""
    values = {"median": statistics.median(seconds), "low": min(seconds), "high": max(seconds)}
    return {name: round(1e3 * value, 3) for name, value in values.items()}


def timed(device: wp.Device, work: Callable[[], object]) -> float:
    """Return how long ``work`` takes [s], including the device."""
    begin = time.perf_counter()
    work()
    wp.synchronize_device(device)
    return time.perf_counter() - begin


def passes_of(renderer: Renderer) -> Replay:
    """Return a function that runs the forward and the backward pass, as a graph where there can be one."""
    return Replay(renderer.backend.device, (renderer.forward_program, renderer.backward_program))


def time_steps(step: Step, repeats: int) -> dict[str, Any]:
    """Time ``repeats`` steps after a warm-up: as a whole, as two passes, and launch by launch.

    Returns summaries of ``step``, ``forward_backward``, and of all ``stages`` and ``kernels``.
    """
    device, renderer = step.renderer.backend.device, step.renderer
    steps, passes, own_passes = [], [], passes_of(renderer)
    launches: list[dict[tuple[str, str], float]] = []
    for _ in range(repeats + WARM_UP):
        steps.append(timed(device, step.advance))
        passes.append(timed(device, own_passes))
        sums: dict[tuple[str, str], float] = defaultdict(float)
        for program in step.programs:
            for key, value in program.run_timed().items():
                sums[key] += value
        launches.append(sums)
    launches = launches[WARM_UP:]
    stages = {
        name: [sum(v for k, v in one.items() if k[0] == name) for one in launches]
        for name in dict.fromkeys(stage for stage, _ in launches[0])
    }
    return {
        "step": summary(steps[WARM_UP:]),
        "forward_backward": summary(passes[WARM_UP:]),
        "stages": {name: summary(seconds) for name, seconds in stages.items()},
        "kernels": {"/".join(key): summary([one[key] for one in launches]) for key in launches[0]},
    }


def check_torch(device: wp.Device) -> None:
    """Raise a ``UsageError`` if PyTorch is not installed, or cannot use ``device``."""
    try:
        import torch

        from warpsplat.torch.cuda import can_use
    except ImportError as error:
        raise UsageError(str(error)) from None
    if not can_use(str(device)):
        raise UsageError(f"PyTorch {torch.__version__} cannot use {device}: install PyTorch with CUDA")


def time_torch(own: Renderer, repeats: int) -> dict[str, Any]:
    """Time passes through PyTorch and the renderer's own alternately, ``repeats`` of each after a warm-up.

    Returns summaries of ``own`` and ``torch``, and the median ``ratio`` of PyTorch's time to the own one.
    """
    import torch

    from warpsplat.torch import SceneTensors, render

    device, viewport = own.backend.device, own.viewport
    torch_device = wp.device_to_torch(device)
    tensors = SceneTensors.of(own.parameters.scene(), torch_device, requires_grad=True)
    inputs = [value for value in tensors.values.values() if value.requires_grad]
    gradient = torch.rand(viewport.height, viewport.width, 4, dtype=torch.float32, device=torch_device)
    own_passes = passes_of(own)

    def torch_passes() -> None:
        image = render(tensors, viewport.width, renderer=own.model, threads=own.backend.threads)
        torch.autograd.grad(image, inputs, gradient)

    pairs = [(timed(device, own_passes), timed(device, torch_passes)) for _ in range(repeats + WARM_UP)][
        WARM_UP:
    ]
    ratio = round(statistics.median(theirs / ours for ours, theirs in pairs), 3)
    return {"own": summary([a for a, _ in pairs]), "torch": summary([b for _, b in pairs]), "ratio": ratio}
