"""The pages of a batch: one for each result, and one that lists them."""

from __future__ import annotations

import contextlib
import hashlib
import html
import logging
import os
import re
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from warpsplat.batch.executors.tasks import Outcome
from warpsplat.errors import OutputError, UsageError, printable
from warpsplat.files.output import check_output, make_folder, may_replace, write_result
from warpsplat.files.remote import is_remote

log = logging.getLogger(__name__)

INDEX_NAME = "index.html"
"""Name of the list in a folder."""

ENDINGS = (".html", ".htm")

HEAD = 40_000
"""Bytes at the start of a report in which its thumbnail stands."""

THUMBNAIL = re.compile(r'<meta name="thumbnail" content="(data:image/webp;base64,[\w+/=&#;]+)">')


@dataclass(frozen=True)
class Reports:
    """Places of a batch's pages."""

    index: Path
    """The list; reports are in a folder beside it with its name."""
    home: Path
    """Folder that results are relative to."""
    overwrite: bool = False
    """Whether to replace files that warpsplat did not write."""

    @staticmethod
    def at(place: Path, home: Path, *, taken: Iterable[Path] = (), overwrite: bool) -> Reports:
        """Return the pages in a folder, or with a list of that name; ``taken``: other files of the batch.

        Raises:
            UsageError: the list cannot be written, or is one of these files.
            OutputError: the folder cannot be made.
        """
        index = place if place.suffix.lower() in ENDINGS else place / INDEX_NAME
        if os.path.realpath(place) in {os.path.realpath(path) for path in taken if not is_remote(path)}:
            raise UsageError(f"{place}: is another file of this batch; give the report another name")
        if place != index and place.exists() and not place.is_dir():
            raise UsageError(f"{place}: is a file, not a folder; name a page .html")
        make_folder(index.parent)
        check_output(index, overwrite=overwrite)
        return Reports(index, home, overwrite)

    @property
    def folder(self) -> Path:
        """Folder of the reports."""
        return self.index.parent / f"{self.index.stem}-pages"

    def report_of(self, output: Path) -> Path:
        """Return the path of a result's report."""
        if not is_remote(output):
            with contextlib.suppress(ValueError):  # on another drive
                inside = Path(os.path.relpath(output, self.home))
                if ".." not in inside.parts:
                    return self.folder / inside.parent / f"{inside.name}.html"
        digest = hashlib.sha256(os.fsencode(str(output))).hexdigest()[:8]
        return self.folder / f"{digest}-{output.name}.html"

    def link_to_index(self, output: Path) -> str:
        """Return the relative path from the report of a result to the list."""
        return Path(os.path.relpath(self.index, self.report_of(output).parent)).as_posix()

    def lacks(self, output: Path) -> bool:
        """Return whether a result has no report, or only an older one."""
        try:
            made = os.stat(self.report_of(output)).st_mtime
            return not is_remote(output) and made < os.stat(output).st_mtime
        except OSError:
            return True

    def keep(self, output: Path, outcome: Outcome) -> None:
        """Write the report of an outcome; errors are only logged."""
        error = outcome.report_error
        path = self.report_of(output)
        if outcome.report:
            try:
                make_folder(path.parent)
                if not self.overwrite and not may_replace(path):
                    raise OutputError(f"{path}: exists and was not written by warpsplat")
                write_result(path, outcome.report.encode())
            except (OutputError, OSError) as failed:
                error = str(failed)
        if error:
            log.warning("no report: %s", printable(error))

    def thumbnail_of(self, output: Path) -> str:
        """Return the thumbnail in a result's report, as a data URI; empty if there is none."""
        try:
            with self.report_of(output).open("rb") as file:
                found = THUMBNAIL.search(file.read(HEAD).decode("utf-8", "replace"))
        except OSError:
            return ""
        return html.unescape(found[1]) if found else ""
