"""Options that commands share. Those that decide the result are made from the table of ``Settings``."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, TypeVar

import click

from warpsplat.cli.echo import set_verbosity
from warpsplat.cli.help import option_in
from warpsplat.errors import UsageError, shown
from warpsplat.files.inputs import STANDARD, input_name
from warpsplat.files.remote import is_url, path_of
from warpsplat.fit.options import Option, nearest
from warpsplat.run.options import OPTIONS, preset_names

Function = TypeVar("Function", bound=Callable[..., Any])


class InputFile(click.Path):
    """The path or URL of a file. The command checks whether it can be read, for the right exit code."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Path:
        """Return the path; raise ``UsageError`` for a URL without the package that reads it."""
        if value == "":
            self.fail("the name of the file is empty", param, ctx)
        return path_of(value)


class OutputFile(click.Path):
    """The path of a file to write, on this machine."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Path:
        """Return the path; raise ``click.BadParameter`` for a URL."""
        if is_url(str(value)):
            self.fail(f"{value}: only warpsplat batch writes to URLs", param, ctx)
        return Path(value)


INPUT, OUTPUT = InputFile(), OutputFile()

threads_option = option_in(
    "Run",
    "--threads",
    type=click.IntRange(min=1),
    metavar="N",
    help="CPU threads, at most 8 per core; the result is the same.  [default: one a core, up to 8]",
)

importance_option = option_in(
    "Fitting",
    "--importance",
    type=INPUT,
    metavar="MASK",
    help="Image of the same proportions: errors count most where it is white, least where it is black.",
)

preset_option = option_in(
    "What to make",
    "--preset",
    common=True,
    values=preset_names,
    files=True,
    metavar="NAME",
    help="Options for a style (brush, ink, low-poly, placeholder, poster, stained-glass) or a machine"
    " (embroidery, laser-cut, laser-engrave, plotter, stencil, vinyl), or of a YAML file; options beside"
    " it count more.",
)


def output_option(default: str) -> Callable[[Any], Any]:
    """Return ``-o`` of a command that writes one file; ``default``: its name, for the help."""
    formats = "File to write: .svg, .svgz, .png, .pdf, .dxf or .eps; - is stdout."
    return option_in("Files", "-o", "--output", type=OUTPUT, common=True, help=f"{formats}{default}")


overwrite_option = option_in(
    "Files",
    "--overwrite",
    is_flag=True,
    help="Replace other programs' files, too; its own always are.",
)


json_option = option_in("Run", "--json", "as_json", is_flag=True, help="Print the result as one JSON object.")


def together(*options: Callable[[Any], Any]) -> Callable[[Function], Function]:
    """Return a decorator that adds options, in the order of the help."""

    def decorate(function: Function) -> Function:
        for option in reversed(options):
            function = option(function)
        return function

    return decorate


checkpoint_options = together(
    option_in(
        "Files",
        "--checkpoint",
        type=OUTPUT,
        metavar="FILE",
        help="Save the state of the run in FILE, which is removed when the run is done.",
    ),
    option_in(
        "Files",
        "--resume",
        is_flag=True,
        help="Continue from the checkpoint, to the same file as without a stop; without one, start.",
    ),
    option_in(
        "Files",
        "--checkpoint-every",
        default="30s",
        show_default=True,
        metavar="TIME",
        help="How often the state is kept.",
    ),
)


def _set_verbosity(context: click.Context, parameter: click.Parameter, value: int | bool) -> int | bool:
    if value:
        if context.params.get("verbose" if parameter.name == "quiet" else "quiet"):
            raise UsageError("-q and -v cannot be combined")
        set_verbosity(quiet=parameter.name == "quiet")
    return value


quiet_option = option_in(
    "Run", "-q", "--quiet", is_flag=True, callback=_set_verbosity, help="Print errors only."
)

verbosity_options = together(
    option_in("Run", "-v", "--verbose", count=True, callback=_set_verbosity, help="Print more, on stderr."),
    quiet_option,
)


def device_option(**declared: Any) -> Callable[[Function], Function]:
    """Return the flag of the device, with further arguments of ``click.option``."""
    words = "auto (a GPU if there is one), cpu, or cuda:N."
    values = ("auto", "cpu", "cuda:0")
    return option_in("Run", "--device", **{"help": words, "metavar": "NAME", "values": values, **declared})


run_options = together(
    device_option(default="auto", show_default=True),
    threads_option,
    verbosity_options,
)
"""Options that do not change the result."""


class Numbers(click.ParamType):
    """One number of shapes or several: ``512`` or ``50,200,1000``."""

    name = "N[,N]"

    def __init__(self, *, several: bool) -> None:
        """``several``: whether several are allowed."""
        self._several = several

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> int | tuple[int, ...]:
        """Return an int, or a tuple of several."""
        if isinstance(value, (int, tuple)):
            return value
        words = str(value).split(",")
        if not all(re.fullmatch(r"[+-]?\d{1,18}", word.strip(), re.ASCII) for word in words):
            self.fail(f"{shown(value)} is neither a whole number nor a list such as 50,200,1000", param, ctx)
        numbers = tuple(int(word) for word in words)
        if len(numbers) == 1:
            return numbers[0]
        if not self._several:
            numbers_of = ", ".join(map(str, numbers))
            self.fail(
                f"takes one number here; in a batch file, matrix: {{curves: [{numbers_of}]}}", param, ctx
            )
        return numbers


class Choice(click.Choice[str]):
    """One of several words."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> str:
        """Return the word; the message about another one suggests the nearest."""
        if value not in self.choices:
            self.fail(
                f"{shown(value)} is not one of {', '.join(self.choices)}{nearest(value, self.choices)}",
                param,
                ctx,
            )
        return str(value)


def flag(option: Option, *, several: bool = False) -> Callable[[Function], Function]:
    """Return the flag of an option in the table; ``several``: allow several numbers of shapes."""
    assert option.group
    name, group = f"--{option.name}", option.group
    default, words = option.default_text, option.help
    if option.value is not None:  # one of several flags for a field
        words += "  [default]" if default else ""
    elif default:
        words += f"  [default: {default}]"
    declared: dict[str, Any] = {"help": words, "common": option.common}
    if option.type is bool:
        return option_in(group, name, is_flag=True, default=None, **declared)
    kind: click.ParamType | type = str if option.parse else option.type
    if option.choices:
        kind = Choice(option.choices)
    if option.name == "curves":
        kind = Numbers(several=several)
    declared |= {"metavar": option.metavar or None, "values": option.values, "files": option.files}
    return option_in(group, name, type=kind, **declared)


def quality_options(*, several: bool = False, refine: bool = False) -> Callable[[Function], Function]:
    """Return a decorator that adds the options that decide the result, or those that ``refine`` has."""
    return together(*(flag(option, several=several) for option in OPTIONS if option.refine or not refine))


@dataclass(frozen=True)
class Request:
    """One image, and the options of its command that are not settings."""

    image: Path
    output: Path | None = None
    importance: Path | None = None
    """File of a mask."""
    overwrite: bool = False
    device: str = "auto"
    threads: int | None = None
    verbose: int = 0
    quiet: bool = False
    as_json: bool = False

    @classmethod
    def taken(cls, image: Path, given: dict[str, Any]) -> Request:
        """Take the values of the options out of those of a command."""
        names = [field.name for field in fields(cls) if field.name in given]
        return cls(image, **{name: given.pop(name) for name in names})

    def output_for(self, source: Path, ending: str) -> Path:
        """Return the output, or the name of ``source`` with another ending, in the current folder.

        Raises ``UsageError`` if there is no output, and the source is the standard input.
        """
        if self.output is None and source == STANDARD:
            raise UsageError(f"the standard input has no name: give -o FILE{ending}, or -o -")
        return self.output or Path(f"{Path(source.name).stem}{ending}")

    @property
    def inputs(self) -> tuple[Path, ...]:
        """Return the files that are read; raise ``UsageError`` if two of them are the standard input."""
        if self.image == self.importance == STANDARD:
            raise UsageError("only one of image and mask can come from the standard input")
        return (self.image,) if self.importance is None else (self.image, self.importance)

    @property
    def source(self) -> dict[str, Any]:
        """Return keyword arguments for the library's functions, in addition to the image and the settings."""
        return {
            "name": input_name(self.image),
            "importance": self.importance,
            "device": self.device,
            "threads": self.threads,
        }

    @property
    def flags(self) -> tuple[str, ...]:
        """Return the words of an equivalent command that are not settings."""
        return () if self.importance is None else ("--importance", str(self.importance))
