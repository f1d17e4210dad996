"""The option ``--report`` of ``vectorize``, ``refine`` and ``eval``."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from warpsplat.cli.help import option_in
from warpsplat.cli.hooks import Done, RunHook
from warpsplat.cli.options import OUTPUT
from warpsplat.errors import UsageError
from warpsplat.files.inputs import STANDARD
from warpsplat.files.output import check_output


class ReportHook(RunHook):
    """Writes a page on one result, or one that compares several numbers of shapes."""

    commands = ("vectorize", "refine", "eval")
    modes = ("one file", "several images", "several numbers")
    options = {  # noqa: RUF012 - declared in the base class
        "report": option_in(
            "Files",
            "--report",
            common=True,
            type=OUTPUT,
            metavar="FILE.html",
            help="Page on the result: image and SVG under a slider, error map, shapes, figures.",
        )
    }

    def __init__(self, report: Path | None) -> None:
        """``report``: path of the page; None: none is written."""
        self._page = report

    def flag(self) -> str | None:
        """See ``RunHook``."""
        return "--report" if self._page else None

    def check(self, inputs: Sequence[Path], outputs: Sequence[Path], *, overwrite: bool) -> None:
        """Check that the page can be written, and is not another file of the run."""
        if self._page is None:
            return
        if self._page == STANDARD:
            raise UsageError("a report is a file, not the standard output")
        taken = {os.path.realpath(path) for path in outputs if path != STANDARD}
        if os.path.realpath(self._page) in taken:
            raise UsageError(f"{self._page}: is the result; give the report another name")
        check_output(self._page, *inputs, endings=(".html", ".htm"), overwrite=overwrite)

    def finish(self, done: Done) -> None:
        """Write the page."""
        if self._page is None or not done.made:
            return
        image = done.request.image
        name = "image" if image == STANDARD else image.name
        if done.several:
            _write_comparison(self._page, done, name)
            return
        from warpsplat.pages.report import report

        ((output, result),) = done.made
        report(
            result,
            done.data,
            self._page,
            command=done.command,
            name=name,
            svg_name=f"{Path(name if output == STANDARD else output.name).stem}.svg",
            device=done.request.device,
            threads=done.request.threads,
        )

    def as_dict(self) -> dict[str, Any]:
        """See ``RunHook``."""
        return {"report": str(self._page)} if self._page else {}


def _write_comparison(page: Path, done: Done, name: str) -> None:
    """Write the page that compares several results of one image."""
    from warpsplat.files.output import write_result
    from warpsplat.pages.reports.several import Version, several_page
    from warpsplat.run.result import Result

    versions = [  # the output itself may be a picture
        Version(result, f"{path.stem}.svg") for path, result in done.made if isinstance(result, Result)
    ]
    versions.sort(key=lambda version: version.shapes)
    write_result(page, several_page(versions, done.data, name=name, command=done.command).encode())
