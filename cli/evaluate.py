"""``warpsplat eval``."""

from __future__ import annotations

import json
from pathlib import Path

import click

from warpsplat.cli.options import FILE
from warpsplat.cli.say import say
from warpsplat.errors import UsageError


@click.command("eval", context_settings={"help_option_names": ["-h", "--help"]})
@click.argument("image", type=FILE)
@click.argument("svg", type=FILE)
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def command(image: Path, svg: Path, as_json: bool) -> None:
    """Measure SVG (any, not only ours) against IMAGE, as a viewer shows it.

    The SVG is rendered at the image's size, on white; where the image has
    opacity, on black and on white, and the lower figures are given.
    SSIMULACRA2 is given where its package is installed (the extra "eyes"),
    for images of up to 4 million pixels. One of the two may be - for the
    standard input.
    """
    from warpsplat.api import score
    from warpsplat.files.inputs import STANDARD

    if image == svg == STANDARD:
        raise UsageError("only one of image and SVG can come from the standard input")
    values = score(svg, image).as_dict()
    if as_json:
        say(json.dumps({"image": str(image), "svg": str(svg), **values}))
        return
    for name in ("psnr", "ssim", "ms_ssim", "ssimulacra2", "paths", "nodes"):
        unit = " dB" if name == "psnr" else ""
        shown = "-" if values[name] is None else values[name]
        say(f"{name:12}{shown}{unit if values[name] is not None else ''}")
    say(f"{'bytes':12}{values['bytes']}")
    say(f"{'gzip_bytes':12}{values['gzip_bytes']}")
