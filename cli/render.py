"""``warpsplat render``."""

from __future__ import annotations

from pathlib import Path

import click

from warpsplat.cli.options import FILE, overwrite_option, threads_option
from warpsplat.errors import ImageError, UsageError


@click.command("render", context_settings={"help_option_names": ["-h", "--help"]})
@click.argument("svg", type=FILE)
@click.option("-o", "--output", type=FILE, required=True, help="PNG to write; - is the standard output.")
@overwrite_option
@click.option("--scale", type=float, default=1.0, show_default=True, help="Magnification.")
@click.option(
    "--renderer",
    type=click.Choice(["viewer", "exact", "splat", "gaussian"]),
    default="viewer",
    show_default=True,
    help="viewer: resvg. exact, splat: those that curves are fitted with, for SVGs of paths.",
)
@click.option("--device", default="auto", show_default=True, help="Of exact and splat.")
@threads_option
def command(
    svg: Path, output: Path, overwrite: bool, scale: float, renderer: str, device: str, threads: int | None
) -> None:
    """Render SVG (any, not only ours; - for the standard input) to a PNG."""
    import math

    from warpsplat.files.inputs import input_name
    from warpsplat.files.output import check_output, mark_png, write_result
    from warpsplat.svg.inspect import MAX_PIXELS, inspect_svg, read_svg_text, svg_size
    from warpsplat.svg.viewer import draw_png

    if not (math.isfinite(scale) and scale > 0):
        raise UsageError(f"scale must be a positive number, not {scale}")
    if renderer == "gaussian":
        raise UsageError(
            "no SVG holds what the gaussian renderer draws: its paths have lost the opacity and softness of "
            "each Gaussian; vectorize --renderer gaussian reports the figures of its own render"
        )
    check_output(output, svg, endings=(".png",), overwrite=overwrite)
    text = read_svg_text(svg)
    try:
        size = svg_size(inspect_svg(text).root)
        if size and max(size[0], 1.0) * scale * max(size[1], 1.0) * scale > MAX_PIXELS:
            raise UsageError(f"scale {scale} makes more than {MAX_PIXELS // 1_000_000} million pixels")
        if size and min(max(1.0, side) for side in size) * scale < 0.5:
            raise UsageError(f"scale {scale} leaves no pixel of {size[0]:g}x{size[1]:g}")
        if renderer == "viewer":
            png = draw_png(text, zoom=scale)
        else:
            from warpsplat.jobs.render import draw_own
            from warpsplat.rendering.backend import Backend
            from warpsplat.rendering.device import choose_device, start_warp

            start_warp()
            png = draw_own(text, renderer, scale, Backend.on(choose_device(device), threads))
    except ImageError as error:
        raise ImageError(f"{input_name(svg)}: {error}") from error
    write_result(output, mark_png(png))
