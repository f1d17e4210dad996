"""Entry point. Nothing heavy is imported, so that ``--help`` answers at once."""

from __future__ import annotations

import atexit
import contextlib
import gc
import itertools
import json
import os
import re
import shlex
import signal
import sys
import traceback
from typing import Any, Literal, NoReturn

import click
from click.shell_completion import CompletionItem

from warpsplat._version import __version__
from warpsplat.cli.echo import echo, notices, open_standard_streams, silence
from warpsplat.cli.signals import Interrupt, handled, leave_compiler
from warpsplat.errors import LONGEST_MESSAGE, ExitCode, ImageError, OutputError, cut, explain, printable
from warpsplat.extensions import Command, declared, load
from warpsplat.files.remote import is_url
from warpsplat.fit.options import nearest

COMMANDS: dict[str, Command] = {
    "vectorize": Command("Turn an image into an SVG.", "warpsplat.cli.vectorize:command"),
    "refine": Command("Improve an SVG against an image.", "warpsplat.cli.refine:command"),
    "eval": Command("Measure any SVG against an image.", "warpsplat.cli.evaluate:command"),
    "render": Command("Render an SVG to a PNG, PDF, DXF or EPS.", "warpsplat.cli.render:command"),
    **declared("commands"),
}
"""All commands: those of the core, then those of the extensions."""


FOR_SVG = ("render FILE.svg", "refine FILE.svg IMAGE", "eval IMAGE FILE.svg")
FOR_YAML = ("batch FILE.yaml",)
FOR_FILES = {".svg": FOR_SVG, ".svgz": FOR_SVG, ".yaml": FOR_YAML, ".yml": FOR_YAML}
"""Commands for files that are not images."""


class LazyGroup(click.Group):
    """Imports a command when it is used; the table above is enough for ``--help``."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Return the names in the order of ``COMMANDS``."""
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Return the command, or None for an unknown name."""
        return load(COMMANDS[cmd_name].target) if cmd_name in COMMANDS else None

    def shell_complete(self, ctx: click.Context, incomplete: str) -> list[CompletionItem]:
        """Return the commands that begin as what is typed, and files: images need no command."""
        if incomplete.startswith("-"):
            return super().shell_complete(ctx, incomplete)
        found = [CompletionItem(n, help=c.help) for n, c in COMMANDS.items() if n.startswith(incomplete)]
        return [CompletionItem(incomplete, type="file"), *found]  # bash forgets what comes before files

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """Return the command and its arguments; an image in place of a command is vectorized.

        Raises ``click.UsageError`` for an unknown command, ``ImageError`` for a missing file.
        """
        name = args[0]
        if name in COMMANDS or ctx.resilient_parsing:
            return super().resolve_command(ctx, args)
        if os.path.isdir(name) and "batch" in COMMANDS:
            ctx.fail(f"{name}: is a folder; warpsplat batch {shlex.quote(name)} vectorizes its images")
        if not os.path.isfile(name) and not is_url(name):
            if os.path.splitext(name)[1] or os.path.basename(name) != name:
                raise ImageError(f"{name}: no such file")
            hint = nearest(name, [*COMMANDS, "--help"]) or f"; commands are {', '.join(COMMANDS)}"
            ctx.fail(f"no such command or file: {name}{hint}")
        commands = FOR_FILES.get(os.path.splitext(name)[1].lower(), ())
        others = [words for words in commands if words.split()[0] in COMMANDS]
        if others:
            ctx.fail(f"{name}: with which command? " + " or ".join(f"warpsplat {o}" for o in others))
        echo(
            f"warpsplat: {name}: no command given, so it is vectorized (warpsplat vectorize {name})", err=True
        )
        return super().resolve_command(ctx, ["vectorize", *args])

    def invoke(self, ctx: click.Context) -> Any:
        """Run the command, and report a closed stdout, which click would ignore."""
        try:
            return super().invoke(ctx)
        except KeyboardInterrupt as error:
            raise click.exceptions.Abort from error  # or click would print an empty line
        except BrokenPipeError as error:
            silence(sys.stdout)
            raise OutputError("standard output: closed by its reader") from error

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the list without importing the commands."""
        with formatter.section("Commands"):
            formatter.write_dl([(name, command.help) for name, command in COMMANDS.items()])


EXIT_CODES = """\b
Exit codes: 0 done, 1 internal error, 2 wrong usage, 3 unreadable image, SVG
or checkpoint, 4 result could not be written, 5 some images of a batch failed,
6 a goal was missed, 7 not enough memory, threads or kernel cache, or a GPU
that cannot be used or failed, 130 interrupted, 143 terminated.
"""


@click.group(cls=LazyGroup, epilog=EXIT_CODES, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__, prog_name="warpsplat")
def cli() -> None:
    """Turn photos, logos and drawings into SVGs.

    \b
    warpsplat photo.jpg              writes photo.svg
    warpsplat photo.jpg --curves 64  with 64 shapes
    warpsplat COMMAND --help         says what a command can do
    """  # noqa: D301


def main(arguments: list[str] | None = None) -> NoReturn:
    """Run the command line; any exception becomes one line on stderr and an exit code.

    After a signal the exit code is always the signal's, so that a shell's loop stops.
    """
    # NumPy's linear algebra, which is not used, would start threads.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    # The objects of all imports are checked for cycles again and again: a quarter of the time that they take.
    garbage = 500_000  # objects that are made, over those that are freed, before Python looks for cycles
    gc.set_threshold(garbage)
    # As the process ends, the objects of all modules would be checked once more: a quarter of a second.
    atexit.register(gc.freeze)
    code: Any = ExitCode.INTERNAL
    given = sys.argv[1:] if arguments is None else arguments
    try:
        with handled():
            open_standard_streams()
            with notices():
                code = cli.main(args=arguments, prog_name="warpsplat", standalone_mode=False) or 0
            sys.stdout.flush()
    except SystemExit as error:
        code = error.code
    except BaseException as error:
        code = report_error(error, json_stream(given))
    if Interrupt.received:
        code = 128 + Interrupt.received
    leave_compiler(int(code or 0))
    sys.exit(int(code or 0))


def json_stream(arguments: list[str]) -> Literal["stdout", "stderr"] | None:
    """Return where ``--json`` prints: stderr if a file goes to stdout. None without the flag.

    Reads the raw arguments, since it is needed even if they cannot be parsed.
    """
    words = arguments[: arguments.index("--")] if "--" in arguments else arguments
    if "--json" not in words:
        return None
    outputs = [after for word, after in itertools.pairwise(words) if word in {"-o", "--output"}]
    aside = "-" in outputs or "--data-uri" in words or {"-o-", "--output=-"} & set(words)
    return "stderr" if aside else "stdout"


def report_error(error: BaseException, objects: Literal["stdout", "stderr"] | None = None) -> int:
    """Print an exception, also as a JSON object if ``objects`` says where, and return its exit code."""
    if isinstance(error, click.exceptions.NoArgsIsHelpError):
        click.echo(error.format_message())
        return ExitCode.USAGE
    message, code = message_of(error)
    if isinstance(error, OSError) and error.filename is None:
        silence(sys.stdout)  # what is left in its buffer cannot be written either
    echo(f"warpsplat: {message}", err=True)
    if objects:
        with contextlib.suppress(Exception):  # stdout itself may have failed
            echo(json.dumps({"error": message, "exit_code": int(code)}), err=objects == "stderr")
    return code


NUMBERS = {"integer": "a whole number", "float": "a number"}
NUMBER = re.compile("a valid (integer|float)(?: range)?")
"""Types of numbers in the words of click, and in ours."""

RANGE = re.compile(r"is not in the range (?:(\S+?)<=?x<=?(\S+)|x>=(\S+))")
"""Ranges in the words of click."""


QUOTED = re.compile(r"""(["'])([^"']*)\1""")
"""Values in click's messages."""


def message_of(error: BaseException) -> tuple[str, int]:
    """Return the message for an exception, and the exit code."""
    number = Interrupt.received or (signal.SIGINT if isinstance(error, KeyboardInterrupt) else None)
    if os.environ.get("WARPSPLAT_TRACEBACK"):
        traceback.print_exception(error)
    if number or isinstance(error, click.exceptions.Abort):
        # An interrupted library may raise something else, such as an ImportError.
        return "interrupted", 128 + (number or signal.SIGINT)
    if isinstance(error, click.ClickException):
        context = getattr(error, "ctx", None)
        help_of = f" (see {context.command_path} --help)" if context else ""
        message = " ".join(error.format_message().split()).rstrip(".")
        message = message[:1].lower() + message[1:]
        if isinstance(error, click.NoSuchOption) and context:
            if context.command is cli:
                help_of = " (options follow a command: warpsplat vectorize IMAGE ...)"
            known = [each.opts[-1] for each in context.command.get_params(context)]
            message = f"no such option: {error.option_name}{nearest(error.option_name, known, '--')}"
        if isinstance(error, click.BadOptionUsage):
            from warpsplat.run.options import BY_NAME

            option = BY_NAME.get(error.option_name.lstrip("-"))
            message += option.hint if option else ""
        if isinstance(error, click.BadParameter):
            message = RANGE.sub(
                lambda found: (
                    f"is less than {found[3]}" if found[3] else f"is not between {found[1]} and {found[2]}"
                ),
                message,
            )
            message = NUMBER.sub(lambda found: NUMBERS[found[1]], message)
            message = QUOTED.sub(lambda found: f"{found[1]}{cut(found[2])}{found[1]}", message)
        return printable(cut(message, LONGEST_MESSAGE)) + help_of, error.exit_code
    return explain(error)
