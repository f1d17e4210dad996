"""``--suggest``: how many shapes an image is worth."""

from __future__ import annotations

import json
import textwrap
from dataclasses import replace
from itertools import zip_longest
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from warpsplat.cli.echo import echo
from warpsplat.cli.help import option_in
from warpsplat.errors import UsageError, counted

if TYPE_CHECKING:
    from warpsplat.cli.options import Request
    from warpsplat.run.suggest import Suggestion

NOTHING_ELSE = "--suggest takes one image, and writes nothing"

suggest_option = option_in(
    "What to make",
    "--suggest",
    is_flag=True,
    help="Suggest how many shapes the image is worth, and why, instead of making a file.",
)


def suggest_number(request: Request, given: dict[str, Any]) -> None:
    """Print a suggestion, its reasons, and the command that follows it."""
    if request.output:
        raise UsageError(NOTHING_ELSE)
    if given["curves"] is not None:
        raise UsageError("--suggest and --curves cannot be combined")
    from warpsplat.cli.run import watched
    from warpsplat.files.inputs import STANDARD, input_name, read_input
    from warpsplat.run.command_line import vectorize_command
    from warpsplat.run.options import settings_from
    from warpsplat.run.suggest import check_suggesting, suggest

    image = request.inputs[0]
    settings = settings_from(given)
    check_suggesting(settings)
    data = read_input(image)
    with watched(request, image) as (report, stop):
        made = suggest(data, settings=settings, callback=report, stop=stop, **request.source)
    if made is None:
        raise click.Abort  # prints "interrupted"
    output = "FILE.svg" if image == STANDARD else str(Path(image.name).with_suffix(".svg"))
    chosen = settings if made.curves is None else replace(settings, curves=made.curves, simplify=False)
    command = vectorize_command(chosen, str(image), output, *request.flags)
    if request.as_json:
        echo(json.dumps({"image": str(image), "command": command, **made.as_dict()}))
    else:
        echo("\n".join([*_lines(input_name(image), made), f"  {command}"]))


def _lines(name: str, made: Suggestion) -> list[str]:
    """Return a suggestion as text."""
    if made.curves is None:
        return [f"{name}: {made.why}"]
    lines = [f"{name}: {counted(made.curves, 'shape')}", "    shapes     dB      kB   twice as many buy"]
    for one, more in zip_longest(made.expected, made.expected[1:]):
        buys = ""
        if more:
            buys = f"{more.psnr - one.psnr:+.1f} dB for {(more.bytes - one.bytes) / 1000:.0f} kB more"
        mark = "->" if one.shapes == made.curves else "  "
        lines.append(f"  {mark}{one.shapes:6}  {one.psnr:5.1f}  {one.bytes / 1000:6.1f}   {buys}".rstrip())
    return [*lines, *(f"  {sentence}" for sentence in textwrap.wrap(made.why, 76))]
