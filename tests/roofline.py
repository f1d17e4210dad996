"""Count what a training step asks of a GPU, without one: ``python -m tests.roofline [--run IMAGE]``.

Launches of a step of ``warpsplat bench``'s scenes are recorded for the CPU, but divided as for CUDA, and run
with kernels that count (``tests/tracing``): bytes of memory in sectors of 32, each once a launch; arithmetic
operations; loads of the thread that has most. The tables are those of docs/gpu.md.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import warp as wp
from PIL import Image

from tests.runs import vectorize
from tests.tracing.copies import Copies, Ledger, counting
from tests.tracing.trace import Count, Memory, Tracer, tracing
from warpsplat.fit import densification, loop, rounding
from warpsplat.fit.objective import Quadratic
from warpsplat.fit.schedule import Phase
from warpsplat.fit.settings import Density, Settings, default_rates, make_settings
from warpsplat.fit.state import FitState
from warpsplat.fit.step import Step, Target
from warpsplat.rendering.backend import GPU_LANES, Backend
from warpsplat.scene import Kind
from warpsplat.tools.bench import bench_scene, bench_target

BANDWIDTH = 3.35e12
"""Of an H100's memory [bytes/s]."""

OPERATIONS = 33.5e12
"""Of an H100 [1/s]: half of its 67 TFLOP/s, which count a product and a sum in one instruction as two."""

SLOW = 8
"""Instructions of an exact division or square root."""

LOAD = 50e-9
"""A load that its thread waits for [s]: between a hit in L1 (some 20 ns) and one in L2 (150 ns). A guess."""

NODE = 1e-6
"""Start of a graph's node after the one before it [s]. A guess."""

SCAN_NODES, SORT_NODES, PASS_NODES = 4, 6, 2
"""Nodes of CUB's scan and radix sort, and of each digit of 8 bits: allocation and release of scratch memory,
clearing of counters, kernels."""

SIZES = ((512, 768, 512), (2048, 2040, 1344))
KINDS = ("closed", "open")

WATCHED = (
    *((loop, name) for name in ("densify", "recover", "evaluate_file")),
    *((rounding, name) for name in ("choose_grid", "freeze_stage")),
    *((densification, name) for name in ("new_shapes", "duplicates", "_reduce_points", "replace_shapes")),
    (Step, "rebuild"),
    (Quadratic, "removal_costs"),
)
"""Functions whose time on the host is measured."""


def scene_step(kind: str, count: int, width: int, height: int, lanes: int = GPU_LANES) -> Step:
    """Return a step on a scene of ``warpsplat bench``, divided as on a GPU, that moves nothing."""
    scene = bench_scene(kind, count, (width, height), 0.9, 0)
    settings = Settings(
        kind=Kind(int(scene.kind[0])),
        curves=count,
        rates=dict.fromkeys(default_rates(), 0.0),
        density=Density(interval=0),
        iterations=1000,
    )
    # For two threads: a step for one is captured as a graph, which cannot be traced.
    backend = replace(Backend.on("cpu", 2), lanes=lanes)
    state = FitState.start(scene, backend, np.random.default_rng(0))
    return Step(state, settings, Target(bench_target(width, height, 0), Phase(width, height)))


def counts_of_step(kind: str, count: int, width: int, height: int) -> list[Count]:
    """Return what the launches of a step read, write and compute."""
    tracer = Tracer()
    with tracing(tracer):
        step = scene_step(kind, count, width, height)
        tracer.counts.clear()
        step.advance()
    return tracer.counts


def nodes(count: Count) -> int:
    """Return the graph's nodes of a launch."""
    if count.kernel == "array_scan":
        return SCAN_NODES
    if count.kernel == "radix_sort_pairs":
        passes = count.memory[""].written // (2 * 4 * count.threads)
        return SORT_NODES + PASS_NODES * passes
    return 1


def memory_time(count: Count) -> float:
    """Return how long the bytes take at least [s]."""
    return count.bytes / BANDWIDTH


def arithmetic_time(count: Count) -> float:
    """Return how long the operations take at least [s]."""
    return (count.simple + SLOW * count.slow) / OPERATIONS


def roofline(count: Count) -> float:
    """Return how long a launch takes at least [s]."""
    return max(memory_time(count), arithmetic_time(count))


def estimate(count: Count) -> float:
    """Return how long a launch may take [s]: also as long as its longest thread waits for its loads."""
    return max(roofline(count), count.longest * LOAD)


def limit(count: Count) -> str:
    """Return what the estimate is bounded by."""
    times = {
        "memory": memory_time(count),
        "arithmetic": arithmetic_time(count),
        "longest thread": count.longest * LOAD,
    }
    return max(times, key=lambda name: times[name])


def table(head: Sequence[str], rows: Iterator[Sequence[object]]) -> str:
    """Return a table of Markdown."""
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(map(str, line)) + " |" for line in lines)


def us(seconds: float) -> str:
    """Return microseconds as text."""
    return f"{1e6 * seconds:.1f}"


def merged(counts: Sequence[Count]) -> Count:
    """Return launches of one kernel as one."""
    first = counts[0]
    memory = {str(i): part for i, one in enumerate(counts) for part in (totals(one),)}
    return replace(
        first,
        threads=sum(one.threads for one in counts),
        memory=memory,
        simple=sum(one.simple for one in counts),
        slow=sum(one.slow for one in counts),
        longest=sum(one.longest for one in counts),
    )


def totals(count: Count) -> Memory:
    """Return the memory of all arrays together."""
    parts = count.memory.values()
    return Memory(
        *(sum(getattr(one, name) for one in parts) for name in ("read", "written")),
        *(sum(getattr(one, name) for one in parts) for name in ("sectors_read", "sectors_written")),
    )


def kernel_table(counts: Sequence[Count]) -> str:
    """Return the table of a step's kernels, in their order."""
    groups: dict[str, list[Count]] = {}
    for count in counts:
        groups.setdefault(count.kernel, []).append(count)
    head = ["kernel", "threads", "read MB", "written MB", "M op", "M div, sqrt", "most loads", "roofline us"]
    head += ["estimate us", "by"]

    def rows() -> Iterator[Sequence[object]]:
        for kernel, own in groups.items():
            one = merged(own)
            memory = totals(one)
            yield (
                f"`{kernel}`" + (f" x {len(own)}" if len(own) > 1 else ""),
                one.threads,
                f"{memory.sectors_read / 1e6:.2f}",
                f"{memory.sectors_written / 1e6:.2f}",
                f"{one.simple / 1e6:.1f}",
                f"{one.slow / 1e6:.2f}",
                one.longest or "",
                us(sum(map(roofline, own))),
                us(sum(map(estimate, own))),
                limit(max(own, key=estimate)),
            )

    return table(head, rows())


@dataclass(frozen=True)
class Summary:
    """A step in numbers."""

    launches: int
    nodes: int
    roofline: dict[str, float]
    """By pass [s]."""
    estimate: dict[str, float]
    """By pass, without the nodes' starts [s]."""
    longest: str
    """Kernel with the largest estimate."""

    @staticmethod
    def of(counts: Sequence[Count]) -> Summary:
        """Return the summary of a step."""
        passes = {"forward": ("outline", "bins", "forward"), "loss": ("loss",), "backward": ("backward",)}
        passes["update"] = ("update",)
        by_pass = {name: [c for c in counts if c.stage in stages] for name, stages in passes.items()}
        return Summary(
            len(counts),
            sum(map(nodes, counts)),
            {name: sum(map(roofline, own)) for name, own in by_pass.items()},
            {name: sum(map(estimate, own)) for name, own in by_pass.items()},
            max(counts, key=estimate).kernel,
        )


def step_tables(sizes: Sequence[tuple[int, int, int]] = SIZES) -> Iterator[str]:
    """Yield a summary of all scenes, and the kernels of the last size."""
    counts = {(kind, size): counts_of_step(kind, *size) for size in sizes for kind in KINDS}
    head = ["scene", "launches", "nodes", "MB", "roofline us: forward", "loss", "backward", "update", "all"]
    head += ["estimate ms", "longest"]

    def rows() -> Iterator[Sequence[object]]:
        for (kind, (shapes, width, height)), own in counts.items():
            one = Summary.of(own)
            yield (
                f"{kind}, {shapes}, {width}x{height}",
                one.launches,
                one.nodes,
                f"{sum(count.bytes for count in own) / 1e6:.0f}",
                *(us(time) for time in one.roofline.values()),
                us(sum(one.roofline.values())),
                f"{1e3 * (sum(one.estimate.values()) + NODE * one.nodes):.2f}",
                f"`{one.longest}`",
            )

    yield table(head, rows())
    for (kind, size), own in counts.items():
        if size == sizes[-1]:
            yield f"{kind}, {size[0]} shapes, {size[1]}x{size[2]}:\n\n{kernel_table(own)}"


def run_ledger(image: Path, settings: Settings) -> Ledger:
    """Vectorize an image and return what was copied, and how long the host worked."""
    pixels = np.asarray(Image.open(image).convert("RGB"), np.float32) / 255
    with counting(WATCHED) as ledger:
        vectorize(pixels, settings, Backend.on("cpu", 1))
    return ledger


def run_tables(ledger: Ledger) -> Iterator[str]:
    """Yield the host's work, and the copies by what asked for them."""
    work = sorted(ledger.work.items(), key=lambda pair: -pair[1].seconds)
    rows = ((f"`{name}`", one.count, f"{1e3 * one.seconds:.0f}") for name, one in work)
    yield table(("on the host", "calls", "ms a run"), rows)
    for title, copies in (("to the host", ledger.to_host), ("to the device", ledger.to_device)):
        yield table((title, "copies", "MB a run"), copy_rows(copies))


def copy_rows(copies: dict[str, Copies]) -> Iterator[Sequence[object]]:
    """Yield the rows of copies, the largest first."""
    for name, one in sorted(copies.items(), key=lambda pair: -pair[1].bytes):
        yield f"`{name}`", one.count, f"{one.bytes / 1e6:.2f}"


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(prog="python -m tests.roofline", description=__doc__)
    parser.add_argument("--run", metavar="IMAGE", type=Path, help="also list what a run leaves to the host")
    parser.add_argument("--curves", type=int, default=512, help="shapes of that run")
    options = parser.parse_args(arguments)
    wp.config.log_level = wp.LOG_ERROR
    for text in step_tables():
        print(text, end="\n\n")
    if options.run:
        ledger = run_ledger(options.run, make_settings(curves=options.curves))
        for text in run_tables(ledger):
            print(text, end="\n\n")


if __name__ == "__main__":
    main()
