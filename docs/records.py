"""What made the figures and pictures of the pages: a record of each run, and the pages' text from these.

A record has the version and the day of its run, and a digest of the golden files of its subject
(tests/golden): while these are the same, the run would make the same file today. A page has figures between
two comments, of which the first names a record,

    <!-- =tutorial/16 {psnr:.1f} dB, {kB:.1f} kB -->22.4 dB, 1.8 kB<!-- = -->

and ``python docs/remake.py`` writes them. A test holds the pages against their records, so that a page shows
what the code makes, or says (``{age}``) that it is older.
"""

from __future__ import annotations

import datetime
import hashlib
import json
import re
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from warpsplat._version import __version__

ROOT = Path(__file__).parents[1]
FOLDER = Path(__file__).parent / "records"
GOLDEN = ROOT / "tests" / "golden" / "digests.json"

FIGURES = re.compile(r"(<!-- =(?P<group>\w+)/(?P<name>\S+) ?(?P<form>.*?) ?-->).*?(<!-- = -->)", re.DOTALL)
"""A record's name, the form of its figures, and the text that shows them."""

Record = Mapping[str, Any]


def digest(data: bytes) -> str:
    """Return a short hash."""
    return hashlib.sha256(data).hexdigest()[:16]


def golden(subject: str) -> str:
    """Return a digest of the golden files of a subject."""
    known = json.loads(GOLDEN.read_text("utf-8"))
    return digest(json.dumps(sorted(one for one in known.items() if one[0].startswith(subject))).encode())


def stamp(subject: str) -> dict[str, str]:
    """Return what a record says of the code that makes it."""
    today = datetime.datetime.now(datetime.timezone.utc).date().isoformat()
    return {"subject": subject, "version": __version__, "date": today, "golden": golden(subject)}


def is_current(record: Record) -> bool:
    """Return whether the code makes the same today."""
    return bool(record["golden"] == golden(record["subject"]))


def age(records: Iterable[Record]) -> str:
    """Return the version and the day of the oldest of records, and whether results changed since any."""
    made = [*records]
    oldest = min(made, key=lambda record: str(record["date"]))
    older = "" if all(map(is_current, made)) else ", before the last change of results"
    return f"version {oldest['version']}, {oldest['date']}{older}"


def read(group: str) -> dict[str, dict[str, Any]]:
    """Return the records of a group by name; none if it has no file."""
    path = FOLDER / f"{group}.json"
    found: dict[str, dict[str, Any]] = json.loads(path.read_text("utf-8")) if path.exists() else {}
    return found


def write(group: str, name: str, record: Record) -> None:
    """Put a record into its group's file, a line for each."""
    found = {**read(group), name: record}
    lines = (f"{json.dumps(key)}: {json.dumps(found[key], ensure_ascii=False)}" for key in sorted(found))
    FOLDER.mkdir(exist_ok=True)
    (FOLDER / f"{group}.json").write_text("{\n" + ",\n".join(lines) + "\n}\n", "utf-8")


def filled(text: str) -> str:
    """Return a page with the figures of its records. ``GROUP/*`` stands for all of a group, for their age."""
    return FIGURES.sub(lambda found: found[1] + _figures(**found.groupdict()) + found[5], text)


def _figures(group: str, name: str, form: str) -> str:
    known = read(group)
    if name == "*":
        return form.format(age=age(known.values()))
    record = known[name]
    values = {**record, "age": age([record]), "kB": record.get("bytes", 0) / 1000}
    return form.format(**values)


def pages() -> Iterator[Path]:
    """Yield the pages that show figures of records."""
    for page in (ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))):
        if FIGURES.search(page.read_text("utf-8")):
            yield page


def fill_pages() -> None:
    """Write the figures into all pages."""
    for page in pages():
        page.write_text(filled(page.read_text("utf-8")), "utf-8")
