"""``vectorize`` with several numbers of shapes: name the files, make them, and print a table."""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from warpsplat.cli.echo import echo
from warpsplat.cli.hooks import Done, Hooks
from warpsplat.cli.options import Request
from warpsplat.cli.run import PLURALS, echo_notes, watched
from warpsplat.errors import UsageError, printable
from warpsplat.files.inputs import STANDARD, read_input
from warpsplat.files.output import check_output
from warpsplat.fit.settings import Settings
from warpsplat.run.command_line import several_command
from warpsplat.run.formats import ENDINGS
from warpsplat.run.names import ErrorAt, FoundImage, ResultRequest, check_outputs, fields_of, name_results
from warpsplat.run.options import settings_from
from warpsplat.run.result import Result
from warpsplat.run.several import check_several, vectorize_several

COLUMNS = (
    ("shapes", "shapes", 0, 1),
    ("dB", "psnr", 2, 1),
    ("SSIM", "ssim", 3, 1),
    ("kB", "bytes", 1, 1e-3),
    ("gzip kB", "gzip_bytes", 1, 1e-3),
    ("seconds", "seconds", 1, 1),
)
"""Columns of the table: heading, name in ``Result.as_dict``, decimal places, factor."""


def make_several(request: Request, numbers: Sequence[int], given: dict[str, Any], hooks: Hooks) -> None:
    """Make a file for each number of shapes, and print their figures."""
    inputs, image = request.inputs, request.image
    settings = settings_from({**given, "curves": max(numbers)})
    check_several(settings, numbers)
    outputs = named(image, request.output, numbers, settings)
    data = read_input(image)
    check_outputs([_error_at(request.output)] * len(outputs), outputs)
    for path in outputs:
        if path.parent.exists():
            check_output(path, *inputs, endings=ENDINGS, overwrite=request.overwrite)
    hooks.check(inputs, outputs, overwrite=request.overwrite)
    shapes = f"{', '.join(map(str, numbers))} {PLURALS[settings.kind]}"
    with watched(request, image, shapes) as (report, stop):
        results = vectorize_several(
            data, numbers, settings=settings, outputs=outputs, callback=report, stop=stop, **request.source
        )
    begun = sorted(numbers)[: len(results)]  # an interrupted run has made the smallest ones
    paths = [path for path, number in zip(outputs, numbers, strict=True) if number in begun]
    made = list(zip(paths, results, strict=True))
    if not request.quiet and results:
        echo_notes(image, settings, results[-1], verbose=request.verbose)
    left = ", ".join(str(number) for number in numbers if number not in begun)
    missing = f"interrupted: no file for --curves {left}" if left else ""
    if request.as_json:
        each = [{"image": str(image), "output": str(p), **r.as_dict()} for p, r in made]
        echo(json.dumps(each))
        if missing:
            echo(f"warpsplat: {missing}", err=True)
    elif not request.quiet:
        echo("\n".join(filter(None, [table(made) if made else "", missing])))
    line = several_command(settings, numbers, str(image), request.output, *request.flags)
    hooks.finish(Done(request, data, made, line, several=True))


def named(image: Path, output: Path | None, numbers: Sequence[int], settings: Settings) -> list[Path]:
    """Return the file of each number: ``photo-50.svg`` here, in the given folder, or by the given pattern.

    Raises ``UsageError`` if two files would have one name, or one could not be written.
    """
    if STANDARD in (output, image) and (output is None or output == STANDARD):
        raise UsageError("several numbers of shapes make several files: give -o 'NAME-{curves}.svg'")
    pattern = output or Path()
    if pattern.suffix.lower() not in ENDINGS:
        pattern = Path(_literal(str(pattern)), _literal(image.stem) + "-{curves}.svg")
    elif not re.search(r"(?<!\{)\{[^{}]", str(pattern)):
        pattern = pattern.with_name(f"{pattern.stem}-{{curves}}{pattern.suffix}")

    found, error_at = FoundImage(image, image.parent), _error_at(output)
    return name_results(
        [
            ResultRequest(found, pattern, settings, {**fields_of(settings, {}), "curves": number}, error_at)
            for number in numbers
        ]
    )


def _error_at(output: Path | None) -> ErrorAt:
    """Return a function that returns errors about ``-o``."""
    return lambda message: UsageError(f"-o {output or '.'}: {message.removeprefix('output: ')}")


def _literal(text: str) -> str:
    """Escape the braces of a text, so that a name pattern contains it literally."""
    return text.replace("{", "{{").replace("}", "}}")


def table(made: Sequence[tuple[Path, Result]]) -> str:
    """Return a table of results."""
    rows = [["", *(heading for heading, *_ in COLUMNS)]]
    for path, result in made:
        values = result.as_dict()
        rows.append([printable(str(path))])
        for _, name, digits, factor in COLUMNS:
            missing = "exact" if name == "psnr" and values["exact"] else "-"
            rows[-1].append(missing if values[name] is None else f"{factor * values[name]:.{digits}f}")
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    lines = ["  ".join([row[0].ljust(widths[0]), *map(str.rjust, row[1:], widths[1:])]) for row in rows]
    return "\n".join(lines + [f"{path}: stopped, not finished" for path, result in made if result.stopped])
