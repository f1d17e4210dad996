"""``warpsplat bench``."""

from __future__ import annotations

import json
import re
from typing import Any

import click

from warpsplat.cli.echo import echo
from warpsplat.cli.options import device_option, json_option, threads_option
from warpsplat.errors import UsageError, counted, shown
from warpsplat.extensions import renderer_names


def parse_size(text: str) -> tuple[int, int]:
    """Parse ``768x512`` as (width, height) [px]; raise ``UsageError`` for anything else."""
    found = re.fullmatch(r"(\d{1,6})x(\d{1,6})", text.strip().lower())
    if not found or not all(16 <= int(n) <= 16384 for n in found.groups()):
        raise UsageError(f"not a size: {shown(text)}; write 768x512, each side from 16 to 16384")
    return int(found[1]), int(found[2])


def table(values: dict[str, Any], verbose: int) -> str:
    """Return the figures as text."""
    rows = [("step", values["step"]), ("forward + backward", values["forward_backward"])]
    rows += [(f"  {name}", spread) for name, spread in values["stages"].items()]
    if verbose:
        rows += [(f"    {name}", spread) for name, spread in values["kernels"].items()]
    torch = values.get("through_torch", {})
    rows += [(f"alternately, {name}", torch[name]) for name in ("own", "torch") if torch]
    memory = values["peak_memory"]
    where = values["device"] + (
        f", {counted(values['threads'], 'thread')}"
        if values["device"] == "cpu"
        else f" ({values['device_name']})"
    )
    return "\n".join(
        [
            f"{values['kind']}, {counted(values['shapes'], 'shape')}, "
            f"{values['width']}x{values['height']} px, "
            f"opacity {values['opacity']:g}, {values['renderer']} renderer, {where}",
            f"{values['pairs']} (tile, shape) pairs, {values['samples']} samples",
            f"{'':36}{'median':>10}{'low':>10}{'high':>10}  ms",
            *(f"{name:36}{s['median']:10.2f}{s['low']:10.2f}{s['high']:10.2f}" for name, s in rows),
            f"{values['megapixels_per_s']:.1f} megapixels/s, {values['us_per_shape']:.1f} us a shape, "
            f"{values['ns_per_pixel']:.1f} ns a pixel"
            + (f", peak memory {memory / 1e6:.0f} MB" if memory else "")
            + (f"; through PyTorch {torch['ratio']:.2f} times as long" if torch else ""),
        ]
    )


@click.command("bench", context_settings={"show_default": True})
@click.option("--curves", type=click.IntRange(1, 100_000), default=512, metavar="N", help="Number of shapes.")
@click.option("--size", default="768x512", metavar="WxH", help="Size of the canvas [px].")
@click.option("--kind", type=click.Choice(["closed", "open"]), default="closed", help="Fills or strokes.")
@click.option(
    "--renderer",
    type=click.Choice(renderer_names()),
    default="exact",
    help="Model of coverage, as in vectorize.",
)
@click.option(
    "--opacity", type=click.FloatRange(0.02, 0.99), default=0.9, metavar="N", help="Opacity of each shape."
)
@device_option(default="auto")
@threads_option
@click.option(
    "--repeats", type=click.IntRange(1, 10_000), default=20, metavar="N", help="Number of timed steps."
)
@click.option(
    "--seed", type=click.IntRange(0, 2**32 - 1), default=0, metavar="N", help="Seed of the random scene."
)
@click.option(
    "--against",
    metavar="OTHER",
    show_default=False,
    help="Compare in turn with another device (cuda:0), another Python's warpsplat, or the one in a folder.",
)
@click.option(
    "--rounds", type=click.IntRange(2, 1000), default=5, metavar="N", help="Rounds of each, with --against."
)
@click.option("--torch", "through_torch", is_flag=True, help="Also time the passes through PyTorch.")
@click.option("-v", "--verbose", count=True, show_default=False, help="Also list the kernels.")
@json_option
def command(size: str, device: str, threads: int | None, verbose: int, as_json: bool, **options: Any) -> None:
    """Time a training step and its stages on a random scene.

    Shapes have uniform centres and radii of 5 to 10 % of the width (half of
    that on canvases wider than 2000 px): closed outlines of 4 cubics on a
    jittered circle, or strokes of 3 cubics that are 3 px wide. Nothing moves.
    """
    width, height = parse_size(size)
    if options["against"]:
        from warpsplat.tools.against import compare, sides
        from warpsplat.tools.against import table as compared

        names = ("curves", "kind", "renderer", "opacity", "repeats", "seed")
        given = [part for name in names for part in (f"--{name}", str(options[name]))]
        given += ["--size", size, *(["--threads", str(threads)] if threads else [])]
        given += ["--torch"] * options["through_torch"]
        found = compare(sides(options["against"], device), given, options["rounds"])
        echo(json.dumps(found) if as_json else compared(found))
        return
    from warpsplat.rendering.backend import Backend
    from warpsplat.rendering.device import choose_device, start_warp
    from warpsplat.tools.bench import bench, bench_scene

    start_warp()
    kind, opacity, seed = options["kind"], options["opacity"], options["seed"]
    scene = bench_scene(kind, options["curves"], (width, height), opacity, seed)
    backend = Backend.on(choose_device(device), threads)
    times = bench(scene, options["renderer"], backend, options["repeats"], seed, options["through_torch"])
    values = {"kind": kind, "opacity": opacity, **times}
    echo(json.dumps(values) if as_json else table(values, verbose))
