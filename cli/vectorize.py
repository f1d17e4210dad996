"""``warpsplat vectorize``."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import click

from warpsplat.cli.batch import Manner, flags_of, perform
from warpsplat.cli.motion import Motion, WithPreview, motion_options
from warpsplat.cli.options import (
    FILE,
    checkpoint_options,
    importance_option,
    overwrite_option,
    run_options,
    several_quality_options,
)
from warpsplat.cli.report import check_report, report_option, write_report
from warpsplat.cli.request import Request
from warpsplat.cli.say import say
from warpsplat.cli.suggest import NOTHING_ELSE, suggest_number, suggest_option
from warpsplat.cli.summary import summary
from warpsplat.errors import UsageError
from warpsplat.run.options import settings_from


@click.command("vectorize", cls=WithPreview, context_settings={"help_option_names": ["-h", "--help"]})
@click.argument("images", type=FILE, nargs=-1, required=True, metavar="IMAGE...")
@click.option(
    "-o",
    "--output",
    type=FILE,
    help="SVG to write, or .svgz, .png, .pdf; - is stdout; of several images a folder, of several numbers of"
    " shapes a folder or OUT-{curves}.svg.  [default: IMAGE with .svg, here]",
)
@overwrite_option
@several_quality_options
@importance_option
@checkpoint_options
@motion_options
@report_option
@run_options
@click.option(
    "--data-uri", "as_uri", is_flag=True, help="Print the SVG as a data URI; the figures go to stderr."
)
@click.option("--json", "as_json", is_flag=True, help="Print the result as one JSON object.")
@suggest_option
def command(
    images: tuple[Path, ...],
    output: Path | None,
    overwrite: bool,
    importance: Path | None,
    report: Path | None,
    device: str,
    threads: int | None,
    verbose: int,
    quiet: bool,
    as_uri: bool,
    as_json: bool,
    suggest: bool,
    checkpoint: Path | None,
    resume: bool,
    checkpoint_every: str,
    **given: Any,
) -> None:
    """Turn IMAGE (- is the standard input) into an SVG and say how good the file is.

    The figures are those of the file as a viewer shows it: PSNR and SSIM
    against the image, number of paths, size. They go to stderr where the SVG
    goes to stdout. Several images are made as batch makes them. Several numbers
    of shapes (--curves 50,200,1000) make a file each, and share work.
    """
    motion = Motion.of(given)
    numbers = given["curves"] if isinstance(given["curves"], tuple) else ()
    request = Request(
        images[0], output, importance, overwrite, report, device, threads, verbose, quiet, as_json
    )
    if suggest:
        motion.for_several("a run that makes a file")
        if len(images) > 1 or as_uri or checkpoint or resume:
            raise UsageError(NOTHING_ELSE)
        suggest_number(request, given)
    elif len(images) > 1:
        if numbers:
            raise UsageError(
                "several images, each with several numbers of shapes: a batch file, with "
                f"matrix: {{curves: {list(numbers)}}}"
            )
        motion.for_several()
        device_given = None if device == "auto" else device
        several(
            images,
            output,
            {**given, "device": device_given, "importance": importance},
            Manner(overwrite=overwrite, threads=threads, report=report, quiet=quiet, as_json=as_json),
            as_uri=as_uri,
        )
    elif numbers:
        motion.for_several("one number of shapes")
        if as_uri or checkpoint or resume:
            flag = "--data-uri" if as_uri else "--checkpoint" if checkpoint else "--resume"
            raise UsageError(f"several numbers of shapes and {flag} do not go together")
        from warpsplat.cli.several import make_several

        make_several(request, numbers, given)
    else:
        keeping = {"checkpoint": checkpoint, "resume": resume, "checkpoint_every": checkpoint_every}
        single(request, given, motion, keeping, as_uri=as_uri)


def single(
    request: Request, given: dict[str, Any], motion: Motion, keeping: dict[str, Any], *, as_uri: bool
) -> None:
    """Make a file of one image, and all that is asked for besides.

    Args:
        request: what is to be done.
        given: settings.
        motion: what shows the run.
        keeping: how its state is kept: ``checkpoint`` and what goes with it, see ``warpsplat.vectorize``.
        as_uri: whether the file is printed.

    Raises:
        WarpsplatError: what cannot be done is found before the work, as far as it can be.
    """
    settings = settings_from(given)
    from warpsplat.files.inputs import STANDARD, read_input
    from warpsplat.files.output import check_output
    from warpsplat.run.formats import ENDINGS, check_format

    image, overwrite, report = request.image, request.overwrite, request.report
    if request.output is None and image == STANDARD:
        raise UsageError("an image from the standard input has no name: give -o FILE.svg, or -o -")
    if as_uri and request.output == STANDARD:
        raise UsageError("the standard output takes one thing: -o - or --data-uri")
    inputs = request.inputs
    data = read_input(image)
    output = request.output or Path(image.name).with_suffix(".svg")
    check_output(output, *inputs, endings=ENDINGS, overwrite=overwrite)
    check_format(output)
    kept = [path for path in (keeping["checkpoint"],) if path]
    for path in kept:
        check_output(path, *inputs)
    motion.check(*inputs, output, *kept, overwrite=overwrite)
    check_report(report, inputs, output, overwrite=overwrite)
    from warpsplat.cli.run import leave, run_file

    result = run_file(request, output, settings, data, motion=motion, **keeping)
    motion.finish(result, quiet=request.quiet, device=request.device, threads=request.threads)
    if as_uri:
        from warpsplat.svg.uri import data_uri

        say(data_uri(result.svg))
    values = {"image": str(image), "output": str(output), "device": request.device, **result.as_dict()}
    if report:
        values["report"] = str(report)
    aside = as_uri or output == STANDARD
    if request.as_json:
        say(json.dumps(values), err=aside)
    elif not request.quiet:
        say(summary(output, values), err=aside)
    if report:
        from warpsplat.pages.reports.command import vectorize_command

        line = vectorize_command(settings, str(image), str(output), *request.flags)
        write_report(
            report, result, image, data, output, line, device=request.device, threads=request.threads
        )
    leave(result)


def several(
    images: tuple[Path, ...], output: Path | None, given: dict[str, Any], manner: Manner, *, as_uri: bool
) -> None:
    """Make an SVG of each image, in the folder ``output``, or here.

    Raises:
        UsageError: what can be said of one image only.
    """
    from warpsplat.batch.names import is_pattern
    from warpsplat.files.inputs import STANDARD

    if as_uri:
        raise UsageError("--data-uri takes one image")
    if STANDARD in images or STANDARD in (output, given["importance"]):
        raise UsageError(
            "of several images none can come from the standard input, or go to the standard output"
        )
    if output is not None and is_pattern(str(output)) and "{stem}" not in str(output):
        raise UsageError(f"{output}: is not a folder, and of {len(images)} images each has a result")
    perform(list(map(str, images)), {**flags_of(given), "output": str(output or ".")}, (), manner)
