"""Entry point. Imports nothing heavy: ``--help`` must answer at once."""

from __future__ import annotations

import importlib
import sys
from typing import Any

import click

from warpsplat._version import __version__
from warpsplat.errors import ExitCode, WarpsplatError

COMMANDS = {
    "vectorize": "Turn an image into an SVG.",
    "batch": "Vectorize many images by a YAML file.",
    "refine": "Improve an SVG against an image.",
    "eval": "Measure any SVG against an image.",
    "render": "Render an SVG to a PNG.",
    "bench": "Time the stages of a training step.",
    "info": "Show version and devices.",
}


MODULES = {"eval": "evaluate"}
"""Commands whose file has another name: ``eval`` is a built-in function."""


class LazyGroup(click.Group):
    """Imports a command's file when the command is asked for; the list above is enough for ``--help``."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """In the order of use."""
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """The command, or None for an unknown name."""
        if cmd_name not in COMMANDS:
            return None
        return getattr(importlib.import_module(f"warpsplat.cli.{MODULES.get(cmd_name, cmd_name)}"), "command")  # noqa: B009

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """The list, without importing the commands."""
        with formatter.section("Commands"):
            formatter.write_dl(list(COMMANDS.items()))


@click.group(cls=LazyGroup, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__, prog_name="warpsplat")
def cli() -> None:
    """Turn raster images into SVGs of Bézier shapes by gradient descent.

    \b
    Exit codes: 0 done, 2 wrong usage, 3 unreadable image, 4 result could not
    be written, 5 some images of a batch failed, 6 a goal was missed, 130 interrupted.
    """  # noqa: D301


def main(arguments: list[str] | None = None) -> Any:
    """Run the command line; errors end in one line on stderr and the exit code of their kind."""
    try:
        sys.exit(cli.main(args=arguments, prog_name="warpsplat", standalone_mode=False) or 0)
    except click.exceptions.Abort:
        click.echo("warpsplat: interrupted", err=True)
        sys.exit(ExitCode.INTERRUPTED)
    except click.exceptions.NoArgsIsHelpError as error:
        click.echo(error.format_message())
        sys.exit(2)
    except click.ClickException as error:
        context = getattr(error, "ctx", None)
        help_of = f" (see {context.command_path} --help)" if context else ""
        click.echo(f"warpsplat: {error.format_message()}{help_of}", err=True)
        sys.exit(error.exit_code)
    except WarpsplatError as error:
        click.echo(f"warpsplat: {error}", err=True)
        sys.exit(error.exit_code)
    except BrokenPipeError:
        sys.stderr.close()
        sys.exit(1)
    except OSError as error:
        click.echo(f"warpsplat: {error.filename or 'output'}: {error.strerror or error}", err=True)
        sys.exit(ExitCode.OUTPUT)


if __name__ == "__main__":
    main()
