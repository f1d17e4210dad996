"""Where the pages of a batch lie: one for each result, and one that lists them."""

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

THUMBNAIL = re.compile(r'<meta name="thumbnail" content="(data:image/webp;base64,[\w+/=&#;]+)">')


@dataclass(frozen=True)
class Reports:
    """The pages of a batch."""

    index: Path
    """The list; reports lie in a folder beside it, which is named after it."""
    home: Path
    """Folder that results are named relative to."""
    overwrite: bool = False
    """Whether files that warpsplat did not write may be replaced."""

    @staticmethod
    def at(place: Path, home: Path, *, taken: Iterable[Path] = (), overwrite: bool) -> Reports:
        """Return pages in a folder, or with the given list, which must be none of the files ``taken``.

        Raises ``UsageError`` or ``OutputError`` if they cannot be written.
        """
        index = place if place.suffix.lower() in (".html", ".htm") else place / "index.html"
        if os.path.realpath(place) in {os.path.realpath(path) for path in taken if not is_remote(path)}:
            raise UsageError(f"{place}: is another file of this batch; give the report another name")
        if place != index and place.exists() and not place.is_dir():
            raise UsageError(f"{place}: is a file, not a folder; name a page .html")
        make_folder(index.parent)
        check_output(index, overwrite=overwrite)
        return Reports(index, home, overwrite)

    def report_of(self, output: Path) -> Path:
        """Return the path of the report of a result."""
        folder = self.index.parent / f"{self.index.stem}-pages"
        if not is_remote(output):
            with contextlib.suppress(ValueError):  # on another drive
                inside = Path(os.path.relpath(output, self.home))
                if ".." not in inside.parts:
                    return folder / inside.parent / f"{inside.name}.html"
        digest = hashlib.sha256(os.fsencode(str(output))).hexdigest()[:8]
        return folder / f"{digest}-{output.name}.html"

    def link_back(self, output: Path) -> str:
        """Return the relative path from the report of a result to the list."""
        return Path(os.path.relpath(self.index, self.report_of(output).parent)).as_posix()

    def outdated(self, output: Path) -> bool:
        """Return whether an existing result has no report, or an older one."""
        try:
            made = os.stat(self.report_of(output)).st_mtime
            return not is_remote(output) and made < os.stat(output).st_mtime
        except OSError:
            return True

    def keep(self, output: Path, outcome: Outcome) -> None:
        """Write the report of an outcome; if that fails, the batch goes on after a warning."""
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
        """Return the thumbnail in the report of a result as a data URI; empty if there is none."""
        try:
            with self.report_of(output).open("rb") as file:
                found = THUMBNAIL.search(file.read(40_000).decode("utf-8", "replace"))
        except OSError:
            return ""
        return html.unescape(found[1]) if found else ""
