"""``warpsplat refine``."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import click

from warpsplat.cli.options import run_options
from warpsplat.config import Settings, make_settings


@click.command("refine", context_settings={"help_option_names": ["-h", "--help"]})
@click.argument("svg", type=click.Path(path_type=Path))
@click.argument("image", type=click.Path(path_type=Path))
@click.option("-o", "--output", type=click.Path(path_type=Path), required=True, help="SVG to write.")
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
    widths move. A result that is no better is not taken.
    """
    settings = make_settings(**given)
    from warpsplat.cli.run import leave, progress_bar
    from warpsplat.cli.signals import Interrupt
    from warpsplat.cli.vectorize import summary
    from warpsplat.device import choose_device, start_warp
    from warpsplat.files import check_output, write_atomically
    from warpsplat.refine import read_pair, refine

    text, target = read_pair(svg, image)
    check_output(output, image)
    start_warp()
    chosen = choose_device(device)
    interrupt = Interrupt()
    with interrupt.watching(), progress_bar(svg, settings, quiet=quiet, verbose=verbose) as report:
        result, before = refine(
            text, target, settings, chosen, name=str(svg), threads=threads, report=report, stop=interrupt
        )
    write_atomically(output, result.svg.encode())
    values = {"svg": str(svg), "output": str(output), "psnr_before": round(before, 3), **result.as_dict()}
    if as_json:
        click.echo(json.dumps(values))
    elif not quiet:
        click.echo(f"{summary(output, values)} (before: {before:.2f} dB)")
    leave(result)
