"""``--report``: a page on what was made."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

import click

from warpsplat.cli.options import FILE
from warpsplat.errors import UsageError
from warpsplat.files.inputs import STANDARD
from warpsplat.files.output import check_output

if TYPE_CHECKING:
    from warpsplat.run.result import Result

ENDINGS = (".html", ".htm")
"""Of names of pages."""

report_option = click.option(
    "--report",
    type=FILE,
    metavar="FILE.html",
    help="Page on the result, to look at: image and SVG under a slider, errors, shapes, figures.",
)

index_option = click.option(
    "--report",
    type=FILE,
    metavar="DIR",
    help="Pages on the results, and DIR/index.html, which lists them; or a name that ends with .html.",
)


def check_report(report: Path | None, inputs: tuple[Path, ...], output: Path, *, overwrite: bool) -> None:
    """Find out before the work whether a report can be written, and may be.

    Raises:
        UsageError: it cannot, is one of the inputs, the result, or somebody else's.
    """
    if report is None:
        return
    if report == STANDARD:
        raise UsageError("a report is a file, not the standard output")
    if output != STANDARD and os.path.realpath(report) == os.path.realpath(output):
        raise UsageError(f"{report}: is the result; give the report another name")
    check_output(report, *inputs, endings=ENDINGS, overwrite=overwrite)


def write_report(
    report: Path | None,
    result: Result,
    image: Path,
    data: bytes,
    output: Path,
    command: str,
    *,
    device: str,
    threads: int | None,
) -> None:
    """Write the page, if there is to be one, on what was made of ``image``, whose bytes are ``data``.

    Raises:
        OutputError: it cannot be written.
    """
    if report is None:
        return
    import warpsplat

    name = "image" if image == STANDARD else image.name
    stem = Path(name if output == STANDARD else output.name).stem
    warpsplat.report(
        result,
        data,
        report,
        command=command,
        name=name,
        svg_name=f"{stem}.svg",
        device=device,
        threads=threads,
    )
