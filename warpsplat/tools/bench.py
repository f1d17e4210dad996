"""Time the stages of a training step on a random scene."""

from __future__ import annotations

import sys
from dataclasses import asdict, dataclass
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
from warpsplat.rendering.renderer import Renderer
from warpsplat.run.options import KINDS
from warpsplat.scene import Canvas, FloatArray, Kind, Scene
from warpsplat.tools.timing import WARM_UP, Spread, timed

STAGES = ("outline", "bins", "forward", "loss", "backward", "update")

RADIUS = (0.05, 0.1)
"""Range of the shapes' radii over the width of the canvas."""

LARGE = 2000
"""Canvases wider than this [px] get shapes of half that radius."""

HALF_WIDTH = 1.5
"""Of the strokes [px]."""

JITTER = 0.2
"""Standard deviation of the control points' distance from the centre, over the radius."""

SMOOTH = 8.0
"""Standard deviation of the blur of the random target image [px]."""


def bench_scene(kind: Kind, curves: int, width: int, height: int, opacity: float, seed: int) -> Scene:
    """Return shapes of uniform centre and radius: 4 cubics on a jittered circle, or 3 on a jittered line."""
    rng = np.random.default_rng(seed)
    centres = rng.uniform(0, [width, height], (curves, 2))
    radii = width * rng.uniform(*RADIUS, curves) * (0.5 if width > LARGE else 1.0)
    if kind == Kind.FILL:
        circles = circle_outlines(np.zeros((curves, 2)), np.ones(curves), 2)
        offsets = circles * (1 + JITTER * rng.normal(size=(curves, circles.shape[1], 1)))
    else:
        angle = rng.uniform(0, np.pi, curves)
        along = np.linspace(-1, 1, 3 * STROKE_CUBICS + 1)
        direction = np.stack([np.cos(angle), np.sin(angle)], axis=1)
        offsets = along[None, :, None] * direction[:, None] + JITTER * rng.normal(
            size=(curves, len(along), 2)
        )
    return Scene.uniform(
        kind,
        Canvas(width, height, np.zeros(3, np.float32)),
        np.asarray(centres[:, None] + radii[:, None, None] * offsets, np.float32),
        colors=rng.uniform(0, 1, (curves, 3)).astype(np.float32),
        opacities=np.full(curves, opacity, np.float32),
        widths=np.full(curves, 0.0 if kind == Kind.FILL else 2 * HALF_WIDTH, np.float32),
    )


def bench_target(width: int, height: int, seed: int) -> FloatArray:
    """Return smooth noise: sRGB in [0, 1], shape (height, width, 3)."""
    noise = np.random.default_rng(seed).uniform(0, 1, (height, width, 3)).astype(np.float32)
    return np.asarray(cv2.GaussianBlur(noise, (0, 0), SMOOTH), np.float32)


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
    *,
    curves: int,
    width: int,
    height: int,
    kind: str,
    renderer: Any,
    backend: Backend,
    opacity: float,
    repeats: int,
    seed: int,
    through_torch: bool = False,
) -> dict[str, Any]:
    """Time ``repeats`` steps after a warm-up. The scene stays as it is: all rates are 0.

    Returns:
        ``step``, ``forward_backward`` and each of ``stages`` as median, low and high [ms]; counts; memory;
        ``through_torch``, where that is asked for, as ``bench_torch`` has it.

    Raises:
        UsageError: PyTorch is asked for and not installed.
    """
    settings = Settings(
        kind=KINDS[kind],
        curves=curves,
        renderer=renderer,
        rates=dict.fromkeys(default_rates(), 0.0),
        density=Density(interval=0),
        iterations=1000,
    )
    scene = bench_scene(KINDS[kind], curves, width, height, opacity, seed)
    target = Target(bench_target(width, height, seed), Phase(width, height))
    step = Step(FitState.start(scene, backend, np.random.default_rng(seed)), settings, target)
    times = time_steps(step, repeats)
    whole = Spread.of(times.steps)
    return {
        "kind": kind,
        "renderer": renderer,
        "device": str(backend.device),
        "device_name": backend.device.name,
        "threads": backend.threads,
        "shapes": curves,
        "curves": curves,  # what it was called at first
        "width": width,
        "height": height,
        "opacity": opacity,
        "pairs": int(step.renderer.needed_slots.numpy()[0]),
        "samples": int(step.renderer.needed_samples.numpy()[0]),
        **times.as_dict(),
        "megapixels_per_s": round(width * height / 1e3 / whole.median, 3),
        "us_per_shape": round(1e3 * whole.median / curves, 3),
        "us_per_curve": round(1e3 * whole.median / curves, 3),  # what it was called at first
        "ns_per_pixel": round(1e6 * whole.median / (width * height), 3),
        **({"through_torch": _through_torch(step.renderer, repeats)} if through_torch else {}),
        "peak_memory": peak_memory(backend.device),
    }


def _through_torch(own: Renderer, repeats: int) -> dict[str, Any]:
    try:
        from warpsplat.tools.bench_torch import bench_torch
    except ImportError as error:
        raise UsageError(str(error)) from None
    return bench_torch(own, repeats)


@dataclass(frozen=True)
class Times:
    """Times of steps [s], one entry a repeat."""

    steps: list[float]
    both: list[float]
    """Forward and backward pass alone."""
    kernels: list[dict[tuple[str, str], float]]
    """By stage and name."""

    def as_dict(self) -> dict[str, Any]:
        """Return medians, lows and highs [ms]."""
        stages = {
            stage: [sum(v for k, v in kernels.items() if k[0] == stage) for kernels in self.kernels]
            for stage in STAGES
        }
        singles = {f"{stage}/{name}": (stage, name) for stage, name in self.kernels[0]}
        return {
            "step": asdict(Spread.of(self.steps)),
            "forward_backward": asdict(Spread.of(self.both)),
            "stages": {stage: asdict(Spread.of(seconds)) for stage, seconds in stages.items()},
            "kernels": {
                label: asdict(Spread.of([kernels[key] for kernels in self.kernels]))
                for label, key in singles.items()
            },
        }


def time_steps(step: Step, repeats: int) -> Times:
    """Time ``repeats`` steps after a warm-up, whole, then in two halves, then launch by launch."""
    device, renderer = step.renderer.backend.device, step.renderer
    times = Times([], [], [])
    for i in range(repeats + WARM_UP):
        whole = timed(device, step.advance)
        both = timed(device, renderer.forward) + timed(device, renderer.backward)
        kernels: dict[tuple[str, str], float] = {}
        for program in step.programs:
            for key, value in program.run_timed().items():
                kernels[key] = kernels.get(key, 0.0) + value
        if i >= WARM_UP:
            times.steps.append(whole)
            times.both.append(both)
            times.kernels.append(kernels)
    return times
