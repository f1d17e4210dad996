"""Find out which results of a batch exist, and whether a file may be replaced."""

from __future__ import annotations

import contextlib
import os
import stat
from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

from warpsplat.batch.manifest import Entry, Manifest, digest
from warpsplat.batch.plan import BatchJob
from warpsplat.errors import ImageError, UsageError
from warpsplat.files.inputs import MAX_INPUT
from warpsplat.files.marks import GZIP, HEAD, picture_key
from warpsplat.files.output import may_replace
from warpsplat.files.remote import exists, is_remote, listed, read_remote
from warpsplat.svg.inspect import svg_text
from warpsplat.svg.write import read_metadata

MOST_NAMES = 20
"""Maximum number of files that one message names."""


class ResultState(NamedTuple):
    """Whether a result exists."""

    made: bool
    entry: Entry | None
    """Its entry in the manifest: how an existing result was made, or that the job failed."""


def result_state(job: BatchJob, key: str, manifest: Manifest) -> ResultState:
    """Look for the complete result of ``key``, by the key in the file or its digest in the manifest."""
    entries = [entry for entry in manifest.entries(job.output) if entry.key == key]
    latest = entries[-1] if entries else None
    if is_remote(job.output) and latest and latest.event == "made" and exists(job.output):
        # The manifest is trusted: fetching each result would take longer than many take to make.
        return ResultState(True, latest)
    data = read_result(job.output)
    if data is not None:
        same = [entry for entry in entries if entry.digest == digest(data)]
        # A result that was about to be written and exists has been made.
        known = [entry for entry in same if entry.event == "made" or entry.figures]
        if known:
            return ResultState(True, known[-1])
        if same or marked_key(data) == key:
            return ResultState(True, None)
    return ResultState(False, latest if latest and latest.event == "failed" else None)


def read_result(path: Path) -> bytes | None:
    """Return the bytes of a result, or None if there is none or it is no regular file."""
    if is_remote(path):
        return read_remote(path, MAX_INPUT) if listed(path) else None
    with contextlib.suppress(OSError):
        found = os.stat(path)
        if stat.S_ISREG(found.st_mode) and found.st_size <= MAX_INPUT:  # reading a pipe would block
            return path.read_bytes()
    return None


def marked_key(data: bytes) -> str:
    """Return the key in a complete result; empty if it has none or is incomplete."""
    if data.startswith(GZIP):
        try:
            data = svg_text(data, "").encode()
        except ImageError:
            return ""
    if data.endswith(b"</svg>\n"):
        return read_metadata(data[:HEAD].decode("utf-8", "replace"))
    return picture_key(data)


def check_replaceable(jobs: Iterable[BatchJob], manifest: Manifest) -> None:
    """Raise ``UsageError`` if a result would replace a file that warpsplat did not write."""
    found = [job.output for job in jobs if not _may_replace(job.output, manifest)]
    if found:
        names = ", ".join(map(str, found[:MOST_NAMES])) + (", ..." if len(found) > MOST_NAMES else "")
        count = "a result exists and was" if len(found) == 1 else f"{len(found)} results exist and were"
        hint = "-o gives results other names, --overwrite replaces them"
        raise UsageError(f"{count} not written by warpsplat; {hint}: {names}")


def _may_replace(output: Path, manifest: Manifest) -> bool:
    if is_remote(output) and (not listed(output) or manifest.entries(output)):
        return True
    with contextlib.suppress(OSError):
        if may_replace(output):
            return True
    data = read_result(output)
    return data is not None and any(entry.digest == digest(data) for entry in manifest.entries(output))
