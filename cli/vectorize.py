"""``warpsplat vectorize``."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import click

from warpsplat.cli.options import (
    FILE,
    importance_option,
    overwrite_option,
    quality_options,
    run_options,
)
from warpsplat.cli.say import say
from warpsplat.errors import UsageError
from warpsplat.jobs.options import settings_from


def summary(output: Path, values: dict[str, Any]) -> str:
    """One line on the result, for people."""
    from warpsplat.jobs.formats import PICTURE_ENDINGS

    name = "standard output" if str(output) == "-" else output
    note = f", stopped after {values['iterations']} iterations" if values["stopped"] else ""
    picture = " as an SVG" if output.suffix.lower() in PICTURE_ENDINGS else ""
    if values["paths"] is None:
        size = f"{values['bytes'] / 1000:.1f} kB{picture}"
        return f"{name}: figures not measured, {size}, {values['seconds']:.1f} s{note}"
    ssim = "" if values["ssim"] is None else f", SSIM {values['ssim']:.3f}"
    ssim += "" if values["ms_ssim"] is None else f", MS-SSIM {values['ms_ssim']:.3f}"
    ssim += "" if values["ssimulacra2"] is None else f", SSIMULACRA2 {values['ssimulacra2']:.1f}"
    psnr = "exact" if values["psnr"] is None else f"{values['psnr']:.2f} dB"
    if values["renderer"] == "gaussian":
        psnr = f"the soft render {values['render_psnr']:.2f} dB, the file {psnr}"
    levels = ", ".join(_level(level) for level in values["levels"][:-1])
    note += f"; the first {levels}" if levels else ""
    return (
        f"{name}: {psnr}{ssim}, {values['paths']} paths, {values['nodes']} nodes, "
        f"{values['bytes'] / 1000:.1f} kB ({values['gzip_bytes'] / 1000:.1f} kB gzipped){picture}, "
        f"{values['seconds']:.1f} s{note}"
    )


def _level(level: dict[str, Any]) -> str:
    """What a layered file shows up to the end of a level."""
    return f"{level['shapes']} shapes " + ("exact" if level["psnr"] is None else f"{level['psnr']:.2f} dB")


@click.command("vectorize", context_settings={"help_option_names": ["-h", "--help"]})
@click.argument("image", type=FILE)
@click.option(
    "-o",
    "--output",
    type=FILE,
    help="SVG to write, or .svgz, .png, .pdf; - is the standard output.  [default: IMAGE with .svg, here]",
)
@overwrite_option
@quality_options
@importance_option
@run_options
@click.option(
    "--data-uri", "as_uri", is_flag=True, help="Print the SVG as a data URI; the figures go to stderr."
)
@click.option("--json", "as_json", is_flag=True, help="Print the result as one JSON object.")
def command(
    image: Path,
    output: Path | None,
    overwrite: bool,
    importance: Path | None,
    device: str,
    threads: int | None,
    verbose: int,
    quiet: bool,
    as_uri: bool,
    as_json: bool,
    **given: Any,
) -> None:
    """Turn IMAGE (- is the standard input) into an SVG and say how good the file is.

    The figures are those of the file as a viewer shows it: PSNR and SSIM
    against the image, number of paths, size. They go to stderr where the SVG
    goes to stdout.
    """
    settings = settings_from(given)
    from warpsplat.files.inputs import STANDARD, read_input
    from warpsplat.files.output import check_output
    from warpsplat.jobs.formats import ENDINGS, check_format

    if output is None and image == STANDARD:
        raise UsageError("an image from the standard input has no name: give -o FILE.svg, or -o -")
    if as_uri and output == STANDARD:
        raise UsageError("the standard output takes one thing: -o - or --data-uri")
    if image == importance == STANDARD:
        raise UsageError("only one of image and mask can come from the standard input")
    data = read_input(image)
    output = output or Path(image.name).with_suffix(".svg")
    inputs = (image,) if importance is None else (image, importance)
    check_output(output, *inputs, endings=ENDINGS, overwrite=overwrite)
    check_format(output)
    from warpsplat.cli.run import leave, run_file

    result = run_file(
        image,
        output,
        settings,
        data=data,
        device=device,
        threads=threads,
        importance=importance,
        verbose=verbose,
        quiet=quiet,
    )
    if as_uri:
        from warpsplat.svg.uri import data_uri

        say(data_uri(result.svg))
    values = {"image": str(image), "output": str(output), "device": device, **result.as_dict()}
    aside = as_uri or output == STANDARD
    if as_json:
        say(json.dumps(values), err=aside)
    elif not quiet:
        say(summary(output, values), err=aside)
    leave(result)
