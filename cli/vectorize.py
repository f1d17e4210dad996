"""``warpsplat vectorize``."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from warpsplat.cli.echo import echo
from warpsplat.cli.help import option_in
from warpsplat.cli.hooks import Done, HookedCommand, Hooks, hook_options
from warpsplat.cli.options import (
    INPUT,
    Request,
    checkpoint_options,
    importance_option,
    json_option,
    output_option,
    overwrite_option,
    preset_option,
    quality_options,
    run_options,
)
from warpsplat.cli.suggest import NOTHING_ELSE, suggest_number, suggest_option
from warpsplat.errors import UsageError
from warpsplat.extensions import declared, load
from warpsplat.run.options import settings_from, with_preset


@click.command("vectorize", cls=HookedCommand)
@click.argument("images", type=INPUT, nargs=-1, required=True, metavar="IMAGE...")
@output_option(" For several results a folder, or OUT-{curves}.svg.  [default: IMAGE with .svg, here]")
@overwrite_option
@preset_option
@quality_options(several=True)
@importance_option
@checkpoint_options
@hook_options("vectorize")
@run_options
@option_in(
    "Files",
    "--data-uri",
    "as_uri",
    is_flag=True,
    help="Print the SVG as a data URI; the figures go to stderr.",
)
@json_option
@suggest_option
def command(
    images: tuple[Path, ...],
    as_uri: bool,
    suggest: bool,
    preset: str | None,
    checkpoint: Path | None,
    resume: bool,
    checkpoint_every: str,
    **given: Any,
) -> None:
    """Turn IMAGE (- is the standard input) into an SVG and measure the file.

    The figures are those of the file as a viewer shows it: PSNR and SSIM
    against the image, number of paths, size. They go to stderr where the SVG
    goes to stdout. Several images are processed as by batch. Several numbers
    of shapes (--curves 50,200,1000) make a file each, and share work.
    """
    hooks = Hooks("vectorize", given)
    given = with_preset(preset, given)
    numbers = given["curves"] if isinstance(given["curves"], tuple) else ()
    request = Request.taken(images[0], given)
    if suggest:
        hooks.check_mode("suggestion")
        if len(images) > 1 or as_uri or checkpoint or resume:
            raise UsageError(NOTHING_ELSE)
        suggest_number(request, given)
    elif len(images) > 1:
        if numbers:
            raise UsageError(
                "several images, each with several numbers of shapes: a batch file, with "
                f"matrix: {{curves: {list(numbers)}}}"
            )
        hooks.check_mode("several images")
        if as_uri:
            raise UsageError("--data-uri takes one image")
        vectorize_images = declared("provides").get("vectorize_images")
        if vectorize_images is None:
            raise UsageError("several images need the extension batch, which is not installed")
        load(vectorize_images)(images, request, given, hooks.values)
    elif numbers:
        hooks.check_mode("several numbers")
        if as_uri or checkpoint or resume:
            flag = "--data-uri" if as_uri else "--checkpoint" if checkpoint else "--resume"
            raise UsageError(f"several numbers of shapes and {flag} cannot be combined")
        from warpsplat.cli.several import make_several

        make_several(request, numbers, given, hooks)
    else:
        keeping = {"checkpoint": checkpoint, "resume": resume, "checkpoint_every": checkpoint_every}
        single(request, given, hooks, keeping, preset=preset, as_uri=as_uri)


def single(
    request: Request,
    given: dict[str, Any],
    hooks: Hooks,
    keeping: dict[str, Any],
    *,
    preset: str | None = None,
    as_uri: bool = False,
) -> None:
    """Make a file of one image, and whatever hooks add.

    ``given``: options, those of ``preset`` included; ``keeping``: those of ``vectorize`` for checkpoints.
    """
    from warpsplat.files.inputs import STANDARD, read_input
    from warpsplat.files.output import SVG_ENDINGS

    settings, image = settings_from(given), request.image
    output = request.output_for(image, ".svg")
    if as_uri and request.output == STANDARD:
        raise UsageError("the standard output takes one thing: -o - or --data-uri")
    inputs, data = request.inputs, read_input(image)
    if image.suffix.lower() in SVG_ENDINGS:
        raise UsageError(
            f"{image}: is an SVG, not an image; refine improves SVGs, render makes images of them"
        )
    hooks.check_files(inputs, output, keeping["checkpoint"], overwrite=request.overwrite)
    from warpsplat.cli.run import echo_notes, echo_unused_dxf, finish, requested, watched
    from warpsplat.run.command_line import vectorize_command
    from warpsplat.run.vectorize import vectorize

    with watched(request, image, requested(settings)) as (report, stop):
        result = vectorize(
            data,
            settings=settings,
            output=output,
            overwrite=request.overwrite,
            callback=hooks.watch(report),
            stop=stop,
            **request.source,
            **keeping,
        )
        hooks.show(result, data)
    if not request.quiet:
        echo_notes(image, settings, result, verbose=request.verbose)
        echo_unused_dxf(given.get("dxf"), output)
    if as_uri:
        from warpsplat.svg.numbers import data_uri

        echo(data_uri(result.svg))
    values = {"image": str(image), "output": str(output), **result.as_dict()}
    line = vectorize_command(settings, str(image), str(output), *request.flags, preset=preset)
    done = Done(request, data, [(output, result)], line)
    finish(done, hooks, values, aside=as_uri or output == STANDARD)
