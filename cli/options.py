"""Options that commands share.

Defaults are those of ``warpsplat.fit.settings``: an option not given is None.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import click

from warpsplat.cli.say import set_voice
from warpsplat.fit.settings import DEFAULT_QUALITY, QUALITIES, Settings, make_settings
from warpsplat.scene import Kind

Function = TypeVar("Function", bound=Callable[..., Any])
_defaults = Settings()


FILE: click.Path = click.Path(path_type=Path, readable=False)
"""A file's name. Whether it can be read is for the command to say, with the exit code that is due."""

threads_option = click.option(
    "--threads",
    type=click.IntRange(min=1),
    metavar="N",
    help="CPU threads, 8 a core at most; the result is the same for any number.  [default: all cores]",
)

overwrite_option = click.option(
    "--overwrite", is_flag=True, help="Replace files that warpsplat did not write as well."
)


def voice_options(function: Function) -> Function:
    """``-v`` and ``-q``."""

    def follow(context: click.Context, parameter: click.Parameter, value: int | bool) -> int | bool:
        if value:
            set_voice(quiet=parameter.name == "quiet")
        return value

    options = [
        click.option("-v", "--verbose", count=True, callback=follow, help="Say more, on stderr."),
        click.option("-q", "--quiet", is_flag=True, callback=follow, help="Say nothing but errors."),
    ]
    for option in reversed(options):
        function = option(function)
    return function


def quality_options(function: Function) -> Function:
    """What decides the result."""
    options = [
        click.option(
            "--curves",
            type=int,
            metavar="N",
            help=f"Number of shapes.  [default: {_defaults.curves}; fewer for a simple image]",
        ),
        click.option(
            "--closed", "kind", flag_value=Kind.FILL, type=click.UNPROCESSED, help="Filled shapes.  [default]"
        ),
        click.option("--open", "kind", flag_value=Kind.STROKE, type=click.UNPROCESSED, help="Strokes."),
        click.option(
            "--quality", type=click.Choice(QUALITIES), help=f"Effort.  [default: {DEFAULT_QUALITY}]"
        ),
        click.option(
            "--renderer",
            type=click.Choice(["exact", "splat"]),
            help=f"Model of coverage: the file's, or the paper's Gaussians.  [default: {_defaults.renderer}]",
        ),
        click.option("--iterations", type=int, metavar="N", help="Steps; overrides the effort's number."),
        click.option("--target-psnr", type=float, metavar="DB", help="Stop once this is reached."),
        click.option("--time-budget", metavar="TIME", help="Size the run to end within 60s, 2m ..."),
        click.option("--max-bytes", metavar="SIZE", help="Largest file, 100KB ...; fewer curves if need be."),
        click.option("--seed", type=int, metavar="N", help=f"Random seed.  [default: {_defaults.seed}]"),
        click.option(
            "--precision",
            type=int,
            metavar="N",
            help=f"Decimals of coordinates.  [default: {_defaults.precision}]",
        ),
    ]
    for option in reversed(options):
        function = option(function)
    return function


def run_options(function: Function) -> Function:
    """What does not change the result."""
    options = [
        click.option(
            "--device",
            default="auto",
            show_default=True,
            help="auto (a GPU if there is one), cpu, or cuda:N.",
        ),
        threads_option,
        voice_options,
    ]
    for option in reversed(options):
        function = option(function)
    return function


def settings_from(given: dict[str, Any]) -> Settings:
    """Settings from options; those not given come from the preset.

    Raises:
        UsageError: a value is out of range.
    """
    quality = given.pop("quality", None) or DEFAULT_QUALITY
    return make_settings(quality, **given)
