"""``warpsplat render``."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from warpsplat.cli.echo import echo
from warpsplat.cli.options import (
    INPUT,
    OUTPUT,
    Request,
    device_option,
    flag,
    overwrite_option,
    quiet_option,
    threads_option,
)
from warpsplat.errors import UsageError, naming
from warpsplat.extensions import renderer_names
from warpsplat.fit.settings import DxfCurves
from warpsplat.run.options import BY_NAME


@click.command("render")
@click.argument("svg", type=INPUT)
@click.option(
    "-o",
    "--output",
    type=OUTPUT,
    help="PNG to write, or .pdf, .dxf, .eps; - is the standard output, for a PNG.  "
    "[default: SVG with .png, here]",
)
@overwrite_option
@flag(BY_NAME["dxf"])
@click.option("--scale", type=float, default=1.0, show_default=True, help="Magnification.")
@click.option(
    "--renderer",
    type=click.Choice(["viewer", *renderer_names()]),
    default="viewer",
    show_default=True,
    help="viewer: resvg, for any SVG. exact, splat: the renderers of fits, for SVGs with paths only.",
)
@device_option(
    default="auto",
    show_default=True,
    help="For exact and splat: auto (a GPU if there is one), cpu, or cuda:N.",
)
@threads_option
@quiet_option
def command(svg: Path, scale: float, renderer: Any, dxf: DxfCurves | None, **given: Any) -> None:
    """Convert any SVG to a PNG or PDF, or its paths to a DXF or EPS; - is the standard input."""
    from warpsplat.cli.run import echo_unused_dxf
    from warpsplat.files.inputs import STANDARD, input_name
    from warpsplat.files.marks import mark_png
    from warpsplat.files.output import check_output, write_result
    from warpsplat.run.formats import PICTURE_ENDINGS, check_format, write_named
    from warpsplat.run.render import check_draws_files, check_scale, to_png
    from warpsplat.svg.inspect import inspect_svg, read_svg_text, svg_size
    from warpsplat.svg.viewer import draw_png

    check_draws_files(renderer)
    request = Request.taken(svg, given)
    output = request.output_for(svg, ".png")
    text = read_svg_text(svg)
    check_output(output, svg, endings=PICTURE_ENDINGS, overwrite=request.overwrite)
    check_format(output)
    if renderer != "viewer" and output.suffix.lower() != ".png":
        raise UsageError(f"--renderer {renderer} makes pixels: give an output that ends with .png")
    with naming(input_name(svg)):
        check_scale(svg_size(inspect_svg(text).root) or (1.0, 1.0), scale)
        if renderer != "viewer":
            from warpsplat.run.render import render

            device, threads = request.device, request.threads
            png = to_png(render(text, scale=scale, renderer=renderer, device=device, threads=threads))
            write_result(output, mark_png(png))
        elif output == STANDARD:
            write_result(output, mark_png(draw_png(text, zoom=scale)))
        else:
            write_named(output, text, zoom=scale, dxf=dxf or "arcs")
    if not request.quiet:
        echo_unused_dxf(dxf, output)
    if not request.quiet and output != STANDARD:
        echo(f"{output}: {output.stat().st_size / 1000:.1f} kB")
