"""``warpsplat eval``."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import click

from warpsplat.cli.echo import echo
from warpsplat.cli.hooks import Done, Hooks, hook_options
from warpsplat.cli.options import INPUT, Request, json_option, overwrite_option
from warpsplat.errors import UsageError


@click.command("eval")
@click.argument("image", type=INPUT)
@click.argument("svg", type=INPUT)
@hook_options("eval")
@overwrite_option
@json_option
def command(image: Path, svg: Path, **given: Any) -> None:
    """Compare any SVG, as a viewer shows it, with IMAGE.

    The SVG is rendered at the image's size, on white; where the image has
    opacity, on black and on white, and the lower figures are given.
    SSIMULACRA2 is given for images of up to 4 million pixels. One of the
    two may be - for the standard input.
    """
    import warpsplat
    from warpsplat.files.inputs import STANDARD, read_input
    from warpsplat.files.output import SVG_ENDINGS
    from warpsplat.files.remote import is_remote

    if image == svg == STANDARD:
        raise UsageError("only one of image and SVG can come from the standard input")
    if image.suffix.lower() in SVG_ENDINGS:
        raise UsageError(f"{image}: is an SVG; eval takes the image first, then the SVG")
    hooks, request = Hooks("eval", given), Request.taken(image, given)
    hooks.check([image, svg], [], overwrite=request.overwrite)
    # The standard input can be read once, and a URL should be.
    shown = read_input(image) if image == STANDARD or is_remote(image) else image
    text = read_input(svg, "an SVG") if svg == STANDARD or is_remote(svg) else svg
    values = warpsplat.score(text, shown).as_dict()
    hooks.finish(Done(request, shown, [(svg, text)]))
    if request.as_json:
        echo(json.dumps({"image": str(image), "svg": str(svg), **values, **hooks.as_dict()}))
        return
    for name in ("psnr", "ssim", "ms_ssim", "ssimulacra2", "paths", "nodes", "bytes", "gzip_bytes"):
        value = f"{values[name]} dB" if name == "psnr" else values[name]
        missing = "exact" if name == "psnr" else "-"
        echo(f"{name:12}{missing if values[name] is None else value}")
