"""Compare ``warpsplat.pydiffvg`` with DiffVG: images, gradients and processor time.

    OMP_NUM_THREADS=1 python -m tests.diffvg_comparison FOLDER

FOLDER has DiffVG's package ``pydiffvg`` and its compiled module. Without CMake and CUDA, that is made of its
C++ files with pybind11 and a copy of thrust by ``g++ -O3 -std=c++17 -fPIC -shared ... -o diffvg.so``.
"""

from __future__ import annotations

import argparse
import importlib
import math
import statistics
import sys
import time
from collections import defaultdict
from collections.abc import Callable
from types import ModuleType
from typing import Any, NamedTuple

import torch

from tests.overheads import SCENES, pydiffvg_passes
from warpsplat import pydiffvg
from warpsplat.tools.bench import bench_scene

Tensor = torch.Tensor
Tensors = dict[str, Tensor]

SIZE = 64
"""Of the images of scenes [px]."""
FINE = 16
"""Samples of DiffVG along x and y for its images; for gradients 2, as its programs take."""
DIFFERENCE_SAMPLES = 6
"""Samples of DiffVG for its central differences, always at the same places."""
STEP = 0.3
"""Of central differences, for what is given in pixels; for others a hundredth of it."""
DIRECTIONS = 2
"""In which a tensor is varied."""


def tensor(*values: Any) -> Tensor:
    return torch.tensor(values[0] if len(values) == 1 else values, dtype=torch.float32)


class Case(NamedTuple):
    """A scene: its tensors by name, and what makes it of them in either package."""

    tensors: Tensors
    make: Callable[[ModuleType, Tensors], tuple[list[Any], list[Any]]]
    background: Tensor | None = None


def first() -> Tensor:
    return torch.tensor([0], dtype=torch.int32)


def counts(*values: int) -> Tensor:
    return torch.tensor(values, dtype=torch.int32)


BLOB = tensor([[10.3, 26.1], [13.2, 5.4], [46.8, 8.3], [52.7, 29.2], [55.1, 52.6], [16.4, 57.3]])
KNOT = tensor([[6.3, 50.2], [70.4, 2.3], [-6.2, 3.1], [57.7, 53.4]])
WAVE = tensor([[8.2, 40.4], [20.6, 4.3], [36.1, 60.2], [56.4, 20.7]])
STAR = tensor([[32.2, 6.1], [16.4, 56.3], [57.1, 24.2], [6.6, 25.4], [47.3, 55.8]])
RED, BLUE = tensor(0.8, 0.3, 0.2, 0.9), tensor(0.2, 0.3, 0.8, 0.6)
GROUND = torch.ones(SIZE, SIZE, 4) * tensor(0.9, 0.8, 0.4, 1.0)
STOPS = tensor([[0.9, 0.1, 0.2, 0.9], [0.1, 0.8, 0.6, 0.7]])
TURNED = tensor([[0.9, -0.4, 12.2], [0.4, 0.9, -8.4], [0, 0, 1]])
PAINT = {"ends": tensor(14.2, 20.1, 50.3, 40.4), "offsets": tensor(0.1, 0.85), "stops": STOPS}


def closed(pd: ModuleType, t: Tensors, **more: Any) -> tuple[list[Any], list[Any]]:
    shape = pd.Path(counts(2, 2), t["points"], True)
    return [shape], [pd.ShapeGroup(first(), t.get("color"), **more)]


def stroked(pd: ModuleType, t: Tensors, **more: Any) -> tuple[list[Any], list[Any]]:
    shape = pd.Path(counts(2), t["points"], False, stroke_width=t["width"])
    return [shape], [pd.ShapeGroup(first(), None, stroke_color=t.get("color"), **more)]


def strokes(pd: ModuleType, t: Tensors) -> tuple[list[Any], list[Any]]:
    numbers = range(len(t) // 3)
    shapes = [pd.Path(counts(2), t[f"points {i}"], False, stroke_width=t[f"width {i}"]) for i in numbers]
    return shapes, [pd.ShapeGroup(counts(i), None, stroke_color=t[f"color {i}"]) for i in numbers]


def polyline(pd: ModuleType, t: Tensors) -> tuple[list[Any], list[Any]]:
    shape = pd.Polygon(t["points"], False, stroke_width=t["width"])
    return [shape], [pd.ShapeGroup(first(), None, stroke_color=t["color"])]


def loop(pd: ModuleType, t: Tensors) -> tuple[list[Any], list[Any]]:
    shape = pd.Path(counts(2, 2), t["points"], True, stroke_width=t["width"])
    return [shape], [pd.ShapeGroup(first(), None, stroke_color=t["color"])]


def mixed(pd: ModuleType, t: Tensors) -> tuple[list[Any], list[Any]]:
    """A closed path of a cubic, a quadratic and a line."""
    return [pd.Path(counts(2, 1, 0), t["points"], True)], [pd.ShapeGroup(first(), t["color"])]


def circles(pd: ModuleType, t: Tensors) -> tuple[list[Any], list[Any]]:
    shapes = [pd.Circle(t[f"radius {i}"], t[f"center {i}"]) for i in range(2)]
    return shapes, [pd.ShapeGroup(counts(0, 1), t["color"], use_even_odd_rule=True)]


def painted(pd: ModuleType, t: Tensors, kind: str) -> tuple[list[Any], list[Any]]:
    paint = getattr(pd, kind)(t["ends"][:2], t["ends"][2:], t["offsets"], t["stops"])
    return closed(pd, {"points": t["points"], "color": paint})


def star(pd: ModuleType, t: Tensors, even_odd: bool) -> tuple[list[Any], list[Any]]:
    shape = pd.Polygon(t["points"], True)
    return [shape], [pd.ShapeGroup(first(), t["color"], use_even_odd_rule=even_odd)]


def basic(pd: ModuleType, t: Tensors) -> tuple[list[Any], list[Any]]:
    shapes = [
        pd.Circle(t["radius"], t["center"]),
        pd.Ellipse(t["radii"], t["middle"]),
        pd.Rect(t["low"], t["high"]),
        pd.Polygon(t["corners"], True),
    ]
    return shapes, [pd.ShapeGroup(counts(i), t[f"color {i}"]) for i in range(4)]


def rings(pd: ModuleType, t: Tensors) -> tuple[list[Any], list[Any]]:
    circle = pd.Circle(t["radius"], t["center"], stroke_width=t["width"])
    shapes = [circle, pd.Rect(t["low"], t["high"], stroke_width=t["width 1"])]
    return shapes, [pd.ShapeGroup(counts(i), None, stroke_color=t[f"color {i}"]) for i in range(2)]


def layers(pd: ModuleType, t: Tensors) -> tuple[list[Any], list[Any]]:
    shapes = [pd.Path(counts(2, 2), t["points"], True), pd.Circle(t["radius"], t["center"])]
    return shapes, [pd.ShapeGroup(counts(i), t[f"color {i}"]) for i in range(2)]


BASIC: Tensors = {
    "radius": tensor(9.3), "center": tensor(16.2, 15.7), "radii": tensor(12.4, 6.3),
    "middle": tensor(44.6, 14.1), "low": tensor(6.3, 34.2), "high": tensor(28.4, 56.7),
    "corners": tensor([[40.2, 32.1], [58.3, 50.4], [35.6, 57.2]]), "color 0": RED, "color 1": BLUE,
    "color 2": tensor(0.3, 0.7, 0.3, 0.8), "color 3": tensor(0.7, 0.6, 0.1, 0.7),
}  # fmt: skip
RINGS: Tensors = {
    "radius": tensor(12.3), "center": tensor(20.2, 21.7), "width": tensor(2.2), "low": tensor(30.3, 34.2),
    "high": tensor(54.4, 56.7), "width 1": tensor(1.6), "color 0": RED, "color 1": BLUE,
}  # fmt: skip
LAYERS: Tensors = {
    "points": BLOB,
    "radius": tensor(13.4),
    "center": tensor(38.2, 30.1),
    "color 0": RED,
    "color 1": BLUE,
}
FADED = torch.cat([GROUND[..., :3], torch.full((SIZE, SIZE, 1), 0.5)], dim=2)
CASES: dict[str, Case] = {
    "closed path": Case({"points": BLOB, "color": RED}, closed),
    "open stroke": Case({"points": WAVE, "width": tensor(2.4), "color": RED}, stroked),
    "thin stroke": Case({"points": WAVE, "width": tensor(0.5), "color": RED}, stroked),
    "tapered stroke": Case({"points": WAVE, "width": tensor(1.2, 3.1, 2.3, 4.2), "color": RED}, stroked),
    "strokes of 0.3 to 2 px": Case(
        {
            name: value
            for i, width in enumerate((0.15, 0.3, 0.6, 1.0))
            for name, value in (
                (f"points {i}", WAVE + tensor(0, 5.3 * (i - 1.6))),
                (f"width {i}", tensor(width)),
                (f"color {i}", RED if i % 2 else BLUE),
            )
        },
        strokes,
    ),
    "stroke over itself": Case(
        {"points": KNOT, "width": tensor(4.4), "color": tensor(0.8, 0.3, 0.2, 0.5)}, stroked
    ),
    "rotated stroke": Case(
        {"points": WAVE, "width": tensor(2.4), "color": RED, "matrix": TURNED},
        lambda pd, t: stroked(pd, t, shape_to_canvas=t["matrix"]),
    ),
    "stroke of a polyline": Case({"points": STAR, "width": tensor(1.4), "color": RED}, polyline),
    "stroke around a path": Case({"points": BLOB, "width": tensor(1.8), "color": BLUE}, loop),
    "cubic, quadratic, line": Case({"points": BLOB, "color": RED}, mixed),
    "two circles, even-odd": Case(
        {
            "radius 0": tensor(17.3),
            "center 0": tensor(26.2, 30.7),
            "radius 1": tensor(13.4),
            "center 1": tensor(41.3, 36.2),
            "color": RED,
        },
        circles,
    ),
    "linear gradient": Case({"points": BLOB, **PAINT}, lambda pd, t: painted(pd, t, "LinearGradient")),
    "radial gradient": Case({"points": BLOB, **PAINT}, lambda pd, t: painted(pd, t, "RadialGradient")),
    "star, even-odd": Case({"points": STAR, "color": RED}, lambda pd, t: star(pd, t, True)),
    "star, nonzero": Case({"points": STAR, "color": RED}, lambda pd, t: star(pd, t, False)),
    "rotated group": Case(
        {"points": BLOB, "color": RED, "matrix": TURNED},
        lambda pd, t: closed(pd, t, shape_to_canvas=t["matrix"]),
    ),
    "basic shapes": Case(BASIC, basic),
    "outlines": Case(RINGS, rings),
    "layers": Case(LAYERS, layers),
    "opaque background": Case(LAYERS, layers, GROUND),
    "translucent background": Case(LAYERS, layers, FADED),
}


def render(pd: ModuleType, case: Case, tensors: Tensors, samples: int, size: int = SIZE) -> Tensor:
    scene = pd.RenderFunction.serialize_scene(size, size, *case.make(pd, tensors))
    image: Tensor = pd.RenderFunction.apply(size, size, samples, samples, 0, case.background, *scene)
    return image


def loss(image: Tensor) -> Tensor:
    """Return a sum with smooth weights."""
    y, x = torch.meshgrid(torch.arange(SIZE) / 9, torch.arange(SIZE) / 11, indexing="ij")
    weights = (x[..., None] + tensor(0, 1, 2, 4)).sin() * (y[..., None] + tensor(1, 0, 3, 2)).cos() + 0.4
    return (image.double() * weights).sum()


def compare_images(theirs: ModuleType) -> None:
    print(f"| image | largest difference | mean | PSNR | DiffVG, 2 x 2 samples |\n|{'---|' * 5}")
    for name, case in CASES.items():
        wanted, found, few = (
            render(pd, case, case.tensors, n).detach()
            for pd, n in ((theirs, FINE), (pydiffvg, 2), (theirs, 2))
        )
        error = (found - wanted).abs()
        figures = f"{error.max():.3f} | {error.mean():.4f} | {psnr(found, wanted)} | {psnr(few, wanted)}"
        print(f"| {name} | {figures} |")


def psnr(a: Tensor, b: Tensor) -> str:
    return f"{-10 * math.log10(float((a - b).square().mean())):.1f}"


def kind_of(name: str, case: str) -> str:
    if name.startswith(("color", "stops")):
        return "colours"
    if name.startswith("width"):
        return "widths"
    if name in ("ends", "offsets", "matrix"):
        return "gradients and transforms"
    return "points of strokes" if "stroke" in case or case == "outlines" else "points of fills"


def compare_gradients(theirs: ModuleType) -> None:
    """Print medians of relative errors along random directions; right: the mean of both differences."""
    errors: dict[str, list[tuple[float, float]]] = defaultdict(list)
    generator = torch.Generator().manual_seed(0)
    for case_name, case in CASES.items():
        found = []
        for pd in (pydiffvg, theirs):
            leaves = {name: value.clone().requires_grad_() for name, value in case.tensors.items()}
            loss(render(pd, case, leaves, 2)).backward()
            found.append({name: value.grad for name, value in leaves.items()})
        for name, value in case.tensors.items():
            kind = kind_of(name, case_name)
            step = STEP if "points" in kind or kind == "widths" or name == "ends" else STEP / 100
            wanted, ours, other = [], [], []
            for _ in range(DIRECTIONS):
                direction = torch.randn(value.shape, generator=generator) / max(1, value.numel()) ** 0.5
                if name == "matrix":
                    direction[2] = 0
                differences = []
                for pd, samples in ((pydiffvg, 2), (theirs, DIFFERENCE_SAMPLES)):
                    ahead, behind = (
                        loss(
                            render(pd, case, case.tensors | {name: value + sign * step * direction}, samples)
                        )
                        for sign in (1, -1)
                    )
                    differences.append(float(ahead - behind) / (2 * step))
                wanted.append(sum(differences) / 2)
                for gradients, into in zip(found, (ours, other), strict=True):
                    into.append(float((gradients[name] * direction).sum()))
            size = sum(x * x for x in wanted) ** 0.5
            errors[kind].append(
                tuple(
                    sum((x - y) ** 2 for x, y in zip(g, wanted, strict=True)) ** 0.5 / size
                    for g in (ours, other)
                )
            )
    print(f"\n| gradient of | tensors | warpsplat | DiffVG |\n|{'---|' * 4}")
    everything = [pair for pairs in errors.values() for pair in pairs]
    for kind, pairs in {**errors, "all": everything}.items():
        mine, others = (sorted(each)[len(pairs) // 2] for each in zip(*pairs, strict=True))
        print(f"| {kind} | {len(pairs)} | {mine:.4f} | {others:.4f} |")
    print(f"\nwarpsplat is nearer in {sum(a < b for a, b in everything)} of {len(everything)}")


def compare_times(theirs: ModuleType) -> None:
    """Print processor seconds of serialisation, forward and backward pass, of the scenes of bench."""
    print(f"\n| step | warpsplat | DiffVG | ratio |\n|{'---|' * 4}")
    for kind, count, (width, height) in SCENES:
        scene, grad = bench_scene(kind, count, (width, height), 0.9, 0), torch.ones(height, width, 4)
        ours, others = (pydiffvg_passes(scene, grad, 1, pd) for pd in (pydiffvg, theirs))
        ours()
        seconds = median_time(ours, 9), median_time(others, 1)
        what = f"{count} {kind} paths, {width}x{height}"
        print(f"| {what} | {seconds[0]:.4f} s | {seconds[1]:.3f} s | {seconds[1] / seconds[0]:.0f} |")


def median_time(work: Callable[[], None], repeats: int) -> float:
    """Return the median of the processor time [s]."""
    times = []
    for _ in range(repeats):
        began = time.process_time()
        work()
        times.append(time.process_time() - began)
    return statistics.median(times)


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m tests.diffvg_comparison", description=__doc__)
    parser.add_argument("folder", help="folder with DiffVG's pydiffvg and its compiled module")
    parser.add_argument("--part", choices=["images", "gradients", "times"], help="default: all")
    given = parser.parse_args()
    sys.path.insert(0, given.folder)
    theirs = importlib.import_module("pydiffvg")
    theirs.set_use_gpu(False)
    parts = {"images": compare_images, "gradients": compare_gradients, "times": compare_times}
    for name, compare in parts.items():
        if given.part in (None, name):
            compare(theirs)


if __name__ == "__main__":
    main()
