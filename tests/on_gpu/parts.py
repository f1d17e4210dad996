"""The parts of ``python -m tests.on_gpu``. Each yields rows of the table, as they are known."""

from __future__ import annotations

import functools
import multiprocessing
import os
import statistics
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import warp as wp
from PIL import Image

from tests import ROOT
from tests.fit.pictures import picture, step_for
from tests.kernels.modules import all_kernels
from tests.runs import scored, vectorize
from tests.scenes import CURVES, forms_scene, mixed_scene, random_scene, styled_scene, with_gradients
from warpsplat.errors import UsageError
from warpsplat.fit.settings import make_settings
from warpsplat.rendering.backend import Backend, Viewport
from warpsplat.rendering.kernel_cache import load
from warpsplat.rendering.parameters import Parameters
from warpsplat.rendering.renderer import Renderer
from warpsplat.scene import Cap, FloatArray, Join, Kind, Scene
from warpsplat.tools.bench import bench, bench_scene, check_torch, peak_memory, time_torch

MEGA = 1e6


@dataclass(frozen=True)
class Row:
    """A line of the table."""

    what: str
    figure: str
    wanted: str = ""
    passed: bool | None = True
    """None: left out, as something is missing here."""


@dataclass(frozen=True)
class Plan:
    """What the parts are given."""

    device: str
    pictures: tuple[str, ...]
    """Image files."""
    sizes: tuple[tuple[int, int, int], ...] = ((512, 768, 512), (2048, 2040, 1344))
    """Shapes, width and height [px] that are timed."""
    has_goals: bool = True
    """Whether the last of them has goals."""
    curves: int = 512
    """Shapes for a picture."""
    iterations: int | None = None
    """Steps for a picture; default: the usual number."""
    side: int | None = None
    """Longest side that pictures are reduced to [px]; default: as they are."""
    repeats: int = 20
    suite: tuple[str, ...] = ("tests",)
    """Arguments of pytest."""

    @property
    def is_cuda(self) -> bool:
        """Return whether the device is a GPU."""
        return self.device.startswith("cuda")


def compile_share(device: str, share: int, shares: int) -> None:
    """Compile every ``shares``-th module for a device."""
    chosen = wp.get_device(device)
    modules = {kernel.module: kernel for kernel in all_kernels(Backend.on(chosen).column)}
    for kernel in [*modules.values()][share::shares]:
        load(kernel, chosen)


def kernels(plan: Plan) -> Iterator[Row]:
    """Compile all kernels, also those of the CPU that it is compared with; capture a step."""
    device = wp.get_device(plan.device)
    memory = f"{device.total_memory / 1e9:.0f} GB" if device.is_cuda else "a CPU"
    yield Row("device", f"{device.name}, {memory}, Warp {wp.__version__}")
    begin, workers = time.perf_counter(), min(16, os.cpu_count() or 1)
    shares = [(name, i, workers) for name in dict.fromkeys((plan.device, "cpu")) for i in range(workers)]
    with ProcessPoolExecutor(workers, multiprocessing.get_context("spawn")) as pool:
        for done in [pool.submit(compile_share, *share) for share in shares]:
            done.result()
    yield Row(f"kernels compiled by {workers} processes", f"{time.perf_counter() - begin:.1f} s")
    captured = step_for(mixed_scene(64, 48), picture(), plan.device, threads=1).replay.graph is not None
    yield Row("a step is one graph", "yes" if captured else "no", "yes", captured)


def suite(plan: Plan) -> Iterator[Row]:
    """Run the tests that take a device, but for the slowest: ``pytest --device cuda:0`` runs all."""
    command = [sys.executable, "-m", "pytest", "-q", "--device", plan.device, "-k", f"[{plan.device}"]
    # Modules whose tests ask for what is missing do not keep the others from running; a plugin that may be
    # installed warns beside workers, and warnings are errors.
    command += ["-m", "not slow", "--continue-on-collection-errors", "-p", "no:benchmark"]
    if find_spec("xdist") and len(plan.suite) == 1:
        command += ["-n", str(min(8, os.cpu_count() or 1)), "--dist", "worksteal"]
    done = subprocess.run([*command, *plan.suite], cwd=ROOT, capture_output=True, text=True, check=False)
    lines = [line for line in (done.stdout or done.stderr).splitlines() if line.strip()]
    for line in lines:
        if line.startswith(("FAILED", "ERROR")):
            yield Row("a test", line[:200].replace("|", "/"), passed=False)
    yield Row("tests with a device", lines[-1].strip("= ") if lines else "none", "", done.returncode == 0)


def renderer_for(scene: Scene, device: str) -> Renderer:
    """Return a renderer of a scene at its own size, after a first pass."""
    viewport = Viewport(scene.canvas.width, scene.canvas.height)
    renderer = Renderer(Parameters(scene, Backend.on(device)), viewport)
    renderer.forward_complete()
    return renderer


def passes(scene: Scene, device: str) -> tuple[FloatArray, dict[str, FloatArray]]:
    """Return a render and gradients for a random gradient of the image."""
    renderer = renderer_for(scene, device)
    image = renderer.read_image()
    renderer.write_image_grad(np.random.default_rng(0).normal(size=image.shape).astype(np.float32))
    renderer.backward()
    return image, renderer.parameters.gradients()


def scenes(plan: Plan) -> dict[str, Scene]:
    """Return scenes of all kinds, and those that are timed at the first size."""
    found = {
        f"{kind.name.lower()}, {basis.name.lower()}": random_scene(kind, 30, 90, 70, basis=basis)
        for kind in Kind
        for basis in CURVES
    }
    found |= {
        "mixed": mixed_scene(90, 70),
        "forms": forms_scene(90, 70).append(mixed_scene(90, 70)),
        "gradients": with_gradients(mixed_scene(90, 70)),
        "styled": styled_scene(Cap.SQUARE, Join.MITER),
    }
    count, width, height = plan.sizes[0]
    return found | {
        f"{kind}, {count}, {width}x{height}": bench_scene(kind, count, (width, height), 0.9, 0)
        for kind in ("closed", "open")
    }


def agreement(plan: Plan) -> Iterator[Row]:
    """Compare images and gradients with those of the CPU."""
    for name, scene in scenes(plan).items():
        (image, gradients), (expected, others) = passes(scene, plan.device), passes(scene, "cpu")
        difference = np.abs(image - expected)
        # A curve may be cut into one piece more or less, by which single pixels differ.
        good = float(difference.mean()) < 1e-5
        figure = f"mean {difference.mean():.1e}, largest {difference.max():.1e}"
        yield Row(f"image of {name}, difference from the CPU's", figure, "mean below 1e-5", good)
        error = max(relative(gradients[name], others[name]) for name in others)
        yield Row(f"gradients of {name}, relative", f"{error:.1e}", "below 1e-3", error < 1e-3)


def relative(found: FloatArray, expected: FloatArray) -> float:
    """Return the norm of the difference over that of what is expected."""
    return float(np.linalg.norm(found - expected) / max(float(np.linalg.norm(expected)), 1e-30))


def bits(plan: Plan) -> Iterator[Row]:
    """Vectorize twice."""
    settings = make_settings(curves=64, iterations=min(200, plan.iterations or 200), subject="photo")
    files = {vectorize(picture(96, 80), settings, Backend.on(plan.device)).svg for _ in range(2)}
    yield Row("two runs", "same bits" if len(files) == 1 else "differ", "same bits", len(files) == 1)


GOALS = {"closed": 2.0, "open": 1.0}
"""Forward and backward pass of the largest scene [ms]."""


def timed_scenes(plan: Plan) -> Iterator[tuple[str, str, Scene]]:
    """Yield the scenes to time: their kind, name and shapes."""
    for count, width, height in plan.sizes:
        for kind in GOALS:
            scene = bench_scene(kind, count, (width, height), 0.9, 0)
            yield kind, f"{kind}, {count}, {width}x{height}", scene


def speed(plan: Plan) -> Iterator[Row]:
    """Time steps."""
    for kind, name, scene in timed_scenes(plan):
        times = bench(scene, "exact", Backend.on(plan.device), plan.repeats, 0)
        yield Row(f"step, {name}", spread(times["step"]))
        size = (len(scene), scene.canvas.width, scene.canvas.height)
        has_goal = plan.has_goals and plan.is_cuda and size == plan.sizes[-1]
        good = not has_goal or times["forward_backward"]["median"] <= GOALS[kind]
        wanted = f"at most {GOALS[kind]:g} ms" if has_goal else ""
        yield Row(f"forward and backward, {name}", spread(times["forward_backward"]), wanted, good)
        slowest = sorted(times["kernels"].items(), key=lambda pair: -pair[1]["median"])[:4]
        yield Row(f"slowest kernels, {name}", ", ".join(f"{key} {one['median']:.3f}" for key, one in slowest))


def missing_torch(plan: Plan) -> str:
    """Return why PyTorch cannot be used with the device; empty if it can."""
    try:
        check_torch(wp.get_device(plan.device))
    except UsageError as error:
        return str(error)
    return ""


def through_torch(plan: Plan) -> Iterator[Row]:
    """Time passes through PyTorch."""
    missing = missing_torch(plan)
    if missing:
        yield Row("through PyTorch", missing, "", None)
        return
    for _, name, scene in timed_scenes(plan):
        ratio = time_torch(renderer_for(scene, plan.device), plan.repeats)["ratio"]
        yield Row(f"through PyTorch, {name}", f"{ratio:.2f} times as long")


def spread(times: dict[str, float]) -> str:
    """Return a median with lowest and highest."""
    return f"{times['median']:.3f} ms ({times['low']:.3f} to {times['high']:.3f})"


def quality(plan: Plan) -> Iterator[Row]:
    """Vectorize pictures on the CPU and on the device."""
    differences = []
    for path in plan.pictures:
        opened = Image.open(path).convert("RGB")
        if plan.side:
            opened.thumbnail((plan.side, plan.side))
        image = np.asarray(opened, np.float32) / 255
        settings = make_settings(curves=plan.curves, iterations=plan.iterations or 1000, subject="photo")
        found = []
        for device in ("cpu", plan.device):
            begin = time.perf_counter()
            psnr = scored(vectorize(image, settings, Backend.on(device))).psnr
            found.append((psnr, time.perf_counter() - begin))
        (usual, usual_time), (own, own_time) = found
        differences.append(own - usual)
        figure = f"{usual:.2f} dB in {usual_time:.1f} s; {own:.2f} dB in {own_time:.1f} s"
        yield Row(f"{Path(path).name}, CPU and {plan.device}", figure)
    mean = statistics.fmean(differences) if differences else float("nan")
    wanted = "within 0.1 dB"
    yield Row(f"mean difference of {len(differences)}", f"{mean:+.3f} dB", wanted, abs(mean) <= 0.1)


def streams(plan: Plan) -> Iterator[Row]:
    """Render from two threads, each on a stream of its own (on a CPU: only from two threads)."""
    missing = missing_torch(plan)
    if missing:
        yield Row("two streams", missing, "all", None)
        return
    import torch

    from warpsplat.torch import kept

    count = 8
    renders = [torch_render(mixed_scene(96, 80, seed=seed), plan.device) for seed in range(2)]
    expected = [render() for render in renders]
    found: list[list[Any]] = [[], []]

    def on_a_stream(work: Callable[[], None]) -> None:
        with torch.cuda.stream(torch.cuda.Stream(plan.device) if plan.is_cuda else None):
            work()

    def several(index: int) -> None:
        found[index] += [renders[index]() for _ in range(count)]

    workers = [
        threading.Thread(target=on_a_stream, args=(functools.partial(several, index),)) for index in range(2)
    ]
    for worker in workers:
        worker.start()
    for worker in workers:
        worker.join()
    same = sum(equal(one, usual) for usual, many in zip(expected, found, strict=True) for one in many)
    yield Row("two streams", f"{same} of {2 * count} as in turn", "all", same == 2 * count)

    kept.KEPT = 1
    renders = [torch_render(random_scene(Kind.FILL, 20 + i, 96, 80), plan.device) for i in range(count)]
    expected, late = [render() for render in renders], list[list[Any]]()
    on_a_stream(lambda: late.extend(render() for render in renders))
    same = sum(map(equal, late, expected))
    yield Row("renderers freed while they are at work", f"{same} of {count} as in turn", "all", same == count)


def equal(some: Sequence[Any], others: Sequence[Any]) -> bool:
    """Return whether tensors are equal, once all work on their device is done."""
    import torch

    if some[0].is_cuda:
        torch.cuda.synchronize(some[0].device)
    return all(map(torch.equal, some, others))


def torch_render(scene: Scene, device: str) -> Callable[[], list[Any]]:
    """Return a function that renders a scene and returns the image and its gradients, maybe before they are
    computed.
    """
    import torch

    from warpsplat.torch import SceneTensors, render

    tensors = SceneTensors.of(scene, torch.device(device), requires_grad=True)
    inputs = [value for value in tensors.values.values() if value.requires_grad]

    def run() -> list[Any]:
        image = render(tensors, 96)
        return [image.detach(), *torch.autograd.grad(image.square().sum(), inputs)]

    return run


def memory(plan: Plan) -> Iterator[Row]:
    """Measure the memory of the largest scene, and whether renderers give it back."""
    device = wp.get_device(plan.device)
    count, width, height = plan.sizes[-1]
    for kind in GOALS:
        passes(bench_scene(kind, count, (width, height), 0.9, 0), plan.device)
        peak = peak_memory(device)
        yield Row(f"peak after {kind}, {count}, {width}x{height}", f"{peak / MEGA:.0f} MB" if peak else "?")
    used = []
    for _ in range(6):
        passes(bench_scene("closed", plan.sizes[0][0], plan.sizes[0][1:], 0.9, 0), plan.device)
        wp.synchronize_device(device)
        in_use = wp.get_mempool_used_mem_current(device) if device.is_cuda else peak_memory(device)
        used.append(in_use or 0)
    growth = (used[-1] - used[1]) / MEGA
    yield Row("growth over four renderers", f"{growth:.1f} MB", "at most 16 MB", growth <= 16)


PARTS: dict[str, tuple[Callable[[Plan], Iterator[Row]], int]] = {
    "kernels": (kernels, 100),
    "agreement": (agreement, 40),
    "bits": (bits, 20),
    "speed": (speed, 40),
    "torch": (through_torch, 20),
    "streams": (streams, 15),
    "memory": (memory, 15),
    "quality": (quality, 90),
    "suite": (suite, 140),
}
"""Each part with its time limit [s]: eight minutes in all. What decides most comes first."""


def names(chosen: Sequence[str]) -> list[str]:
    """Return the parts to run, in their order."""
    return [name for name in PARTS if not chosen or name in chosen]
