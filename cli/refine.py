"""``warpsplat refine``."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import click

from warpsplat.cli.options import run_options
from warpsplat.config import Settings, make_settings
from warpsplat.errors import UsageError
from warpsplat.files import check_output, write_atomically
from warpsplat.inputs import STANDARD, input_name


@click.command("refine", context_settings={"help_option_names": ["-h", "--help"]})
@click.argument("svg", type=click.Path(path_type=Path, allow_dash=True))
@click.argument("image", type=click.Path(path_type=Path, allow_dash=True))
@click.option(
    "-o",
    "--output",
    type=click.Path(path_type=Path, allow_dash=True),
    required=True,
    help="SVG to write, - for the standard output.",
)
@click.option("--iterations", type=int, default=200, show_default=True, metavar="N", help="Steps.")
@click.option("--time-budget", metavar="TIME", help="Size the run to end within 60s, 2m ...")
@click.option(
    "--precision", type=int, metavar="N", help=f"Decimals of coordinates.  [default: {Settings.precision}]"
)
@run_options
@click.option("--json", "as_json", is_flag=True, help="Print the result as one JSON object.")
def command(
    svg: Path,
    image: Path,
    output: Path,
    device: str,
    threads: int | None,
    verbose: int,
    quiet: bool,
    as_json: bool,
    **given: Any,
) -> None:
    """Improve SVG (ours, VTracer's ...) against IMAGE by gradient descent.

    Its paths are kept, none is added: outlines, colours, opacities and
    widths move. A result that is no better is not taken. Either of SVG and
    IMAGE may be - for the standard input.
    """
    settings = make_settings(**given)
    if svg == image == STANDARD:
        raise UsageError("only one of SVG and image can come from the standard input")
    if output == STANDARD and as_json:
        raise UsageError("the SVG and --json cannot both go to the standard output")
    if output != STANDARD:
        if output.suffix.lower() != ".svg":
            raise UsageError(f"{output}: an SVG is written; give a name that ends in .svg")
        check_output(output, svg, image)
    from warpsplat.cli.run import Interrupt, leave, progress_bar
    from warpsplat.cli.vectorize import summary
    from warpsplat.device import choose_device, start_warp
    from warpsplat.image import load_image
    from warpsplat.inspect_svg import read_svg_text
    from warpsplat.refine import refine

    text, target = read_svg_text(svg), load_image(image)
    start_warp()
    chosen = choose_device(device)
    interrupt = Interrupt()
    with interrupt.watching(), progress_bar(svg, settings, quiet=quiet, verbose=verbose) as report:
        result, before = refine(
            text,
            target,
            settings,
            chosen,
            name=input_name(svg),
            threads=threads,
            report=report,
            stop=interrupt,
        )
    if output == STANDARD:
        sys.stdout.buffer.write(result.svg.encode())
        leave(result)
        return
    write_atomically(output, result.svg.encode())
    values = {"svg": str(svg), "output": str(output), "psnr_before": round(before, 3), **result.as_dict()}
    if as_json:
        click.echo(json.dumps(values))
    elif not quiet:
        click.echo(f"{summary(output, values)} (before: {before:.2f} dB)")
    leave(result)
