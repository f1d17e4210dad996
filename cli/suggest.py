"""``--suggest``: how many shapes an image is worth."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from warpsplat.cli.echo import echo
from warpsplat.errors import UsageError

if TYPE_CHECKING:
    from warpsplat.cli.options import Request
    from warpsplat.fit.settings import Settings
    from warpsplat.run.suggest import Suggestion

suggest_option = click.option(
    "--suggest",
    is_flag=True,
    help="Suggest how many shapes the image is worth, and why, instead of making a file.",
)


def suggest_number(request: Request, given: dict[str, Any]) -> None:
    """Print a suggestion, its reasons, and the command that follows it.

    Raises:
        UsageError: settings that fix the number of shapes, or an output.
        Abort: interrupted.
    """
    if request.output:
        raise UsageError(NOTHING_ELSE)
    if given["curves"] is not None:
        raise UsageError("--suggest and --curves do not go together")
    from warpsplat.cli.run import suggest_file
    from warpsplat.files.inputs import input_name, read_input
    from warpsplat.run.options import settings_from
    from warpsplat.run.suggest import check_suggesting

    image, _ = request.image, request.inputs
    settings = settings_from(given)
    check_suggesting(settings)
    made = suggest_file(request, settings, read_input(image))
    if made is None:
        raise click.Abort  # prints "interrupted"
    command = _command(request, settings, made)
    if request.as_json:
        echo(json.dumps({"image": str(image), "command": command, **made.as_dict()}))
    else:
        echo("\n".join([*_lines(input_name(image), made), f"  {command}"]))


NOTHING_ELSE = "--suggest takes one image, and writes nothing"


def _command(request: Request, settings: Settings, made: Suggestion) -> str:
    """Return the command that follows the suggestion."""
    from dataclasses import replace

    from warpsplat.files.inputs import STANDARD
    from warpsplat.run.command_line import vectorize_command

    image = request.image
    output = "FILE.svg" if image == STANDARD else str(Path(image.name).with_suffix(".svg"))
    chosen = settings if made.curves is None else replace(settings, curves=made.curves, simplify=False)
    return vectorize_command(chosen, str(image), output, *request.flags)


def _lines(name: str, made: Suggestion) -> list[str]:
    """Return a suggestion as text."""
    if made.curves is None:
        return [f"{name}: {made.why}"]
    lines = [f"{name}: {made.curves} shapes", "    shapes     dB      kB   twice as many buy"]
    for i, one in enumerate(made.expected):
        more = made.expected[i + 1] if i + 1 < len(made.expected) else None
        buys = ""
        if more and more.shapes >= TWICE * one.shapes:
            buys = f"{more.psnr - one.psnr:+.1f} dB for {(more.bytes - one.bytes) / 1000:.0f} kB more"
        mark = "->" if one.shapes == made.curves else "  "
        lines.append(f"  {mark}{one.shapes:6}  {one.psnr:5.1f}  {one.bytes / 1000:6.1f}   {buys}".rstrip())
    return [*lines, *(f"  {sentence}" for sentence in _wrapped(made.why))]


TWICE = 1.9
"""Ratio of shapes from which a row has about twice as many as the row before."""


def _wrapped(text: str) -> list[str]:
    import textwrap

    return textwrap.wrap(text, 76)
