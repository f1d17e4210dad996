"""``warpsplat refine``."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import click

from warpsplat.cli.help import option_in
from warpsplat.cli.hooks import Done, HookedCommand, Hooks, hook_options
from warpsplat.cli.options import (
    INPUT,
    Request,
    checkpoint_options,
    json_option,
    output_option,
    overwrite_option,
    quality_options,
    run_options,
)
from warpsplat.errors import UsageError
from warpsplat.files.inputs import STANDARD, input_name, read_input
from warpsplat.files.output import SVG_ENDINGS
from warpsplat.files.remote import is_remote
from warpsplat.fit.settings import make_settings


@click.command("refine", cls=HookedCommand)
@click.argument("svg", type=INPUT)
@click.argument("image", type=INPUT)
@output_option("  [default: SVG-refined.svg, here]")
@overwrite_option
@option_in(
    "Fitting",
    "--iterations",
    common=True,
    type=int,
    default=200,
    show_default=True,
    metavar="N",
    help="Number of optimisation steps.",
)
@option_in(
    "Goals and limits",
    "--max-memory",
    metavar="SIZE",
    help="Memory limit, such as 4GB; an image that needs more is refused.",
)
@quality_options(refine=True)
@option_in(
    "Contents of the SVG",
    "--keep",
    common=True,
    is_flag=True,
    help="Leave text, images, filters ... unchanged; without this, an SVG that has them is refused.",
)
@checkpoint_options
@hook_options("refine")
@run_options
@json_option
def command(
    svg: Path,
    image: Path,
    checkpoint: Path | None,
    resume: bool,
    checkpoint_every: str,
    keep: bool,
    **given: Any,
) -> None:
    """Improve SVG (ours, VTracer's ...) against IMAGE by gradient descent.

    Its paths are kept, none is added: outlines, colours, opacities and
    widths move. If the result is no better, the SVG is written unchanged. Either of SVG and
    IMAGE may be - for the standard input. The figures go to stderr where the
    SVG goes to stdout.
    """
    hooks, request = Hooks("refine", given), Request.taken(image, given)
    settings = make_settings(**given)
    if svg == image == STANDARD:
        raise UsageError("only one of SVG and image can come from the standard input")
    if image.suffix.lower() in SVG_ENDINGS and svg.suffix.lower() not in SVG_ENDINGS:
        raise UsageError(f"{image}: is an SVG; refine takes the SVG first, then the image")
    output = request.output_for(svg, "-refined.svg")
    hooks.check_files([svg, image], output, checkpoint, overwrite=request.overwrite)
    from warpsplat.cli.run import decibels, echo_remarks, echo_unused_dxf, finish, watched
    from warpsplat.run.command_line import refine_command
    from warpsplat.run.refine import refine
    from warpsplat.run.result import finite
    from warpsplat.svg.inspect import MAX_BYTES

    data = read_input(svg, "an SVG", limit=MAX_BYTES)
    # The standard input can be read once, and a URL should be.
    shown = read_input(image) if image == STANDARD or is_remote(image) else image
    with watched(request, svg) as (report, stop):
        result = refine(
            data,
            shown,
            settings=settings,
            keep=keep,
            output=output,
            device=request.device,
            threads=request.threads,
            callback=hooks.watch(report),
            stop=stop,
            name=input_name(svg),
            checkpoint=checkpoint,
            resume=resume,
            checkpoint_every=checkpoint_every,
            overwrite=request.overwrite,
        )
        hooks.show(result, None if image == STANDARD else shown)
    before = math.inf if result.before is None else result.before
    if not request.quiet:
        echo_remarks(input_name(svg), result)
        echo_unused_dxf(given.get("dxf"), output)
    values = {"svg": str(svg), "output": str(output), "psnr_before": finite(before), **result.as_dict()}
    if keep:
        values["kept"] = result.kept
    line = refine_command(settings, str(svg), str(image), str(output), *(["--keep"] if keep else []))
    done = Done(request, shown, [(output, result)], line)
    finish(done, hooks, values, note=f" (before: {decibels(finite(before))})", aside=output == STANDARD)
