"""The tables of docs/comparison.md: ``python docs/comparison.py FOLDER``, by ``warpsplat compare``.

The folder, or one in it, has the images. The page names their sources; they are not ours to give away.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from statistics import fmean
from typing import Any

import records

from warpsplat.compare.comparison import OURS
from warpsplat.compare.tables import table

Row = dict[str, Any]

GROUPS: dict[str, tuple[str, str, tuple[str, ...]]] = {
    "photographs": ("photo", "64,256,512", ("kodim07.png", "kodim13.png", "kodim23.png")),
    "drawings": (
        "drawing",
        "16,64,256",
        ("gopher_vector_hiking.png", "gopher_sketch_flying.png", "noto_1f981.png", "noto_1f30d.png"),
    ),
    "logos": ("drawing", "16,64,256", ("flag_BR.png", "flag_NP.png", "structlog_logo_small.png")),
}
"""Subject, numbers of shapes and images, by name."""

SHOWN = ("psnr", "ssim", "ssimulacra2", "bytes", "gzip_bytes", "paths", "nodes", "cpu_seconds")
"""Figures of the tables."""


def compare(images: Sequence[Path], curves: str) -> dict[str, Any]:
    """Return what ``warpsplat compare`` says of images."""
    with tempfile.TemporaryDirectory() as folder:
        line = [*map(str, images), "--against", "vtracer", "--curves", curves, "-o", folder, "--json", "-q"]
        command = [sys.executable, "-m", "warpsplat", "compare", *line]
        made = subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True)
    found: dict[str, Any] = json.loads(made.stdout)
    return found


def tables(rows: Sequence[Row], name: str) -> Iterator[str]:
    """Yield the table of the means, and those of the images."""
    images = [*dict.fromkeys(row["image"] for row in rows)]
    settings = [*dict.fromkeys((row["program"], row["setting"]) for row in rows)]
    means = []
    for program, setting in settings:
        group = [row for row in rows if (row["program"], row["setting"]) == (program, setting)]
        figures: dict[str, float | None] = {key: fmean(row[key] for row in group) for key in SHOWN}
        means.append((program, setting, figures))
    yield f"### Mean of {len(images)} {name}\n\n{table(means)}"
    for image in images:
        found = [row for row in rows if row["image"] == image]
        yield f"### {image}\n\n{table([*merged(found)])}"


def merged(rows: Sequence[Row]) -> Iterator[tuple[str, str, dict[str, float | None]]]:
    """Yield rows of a table, one for settings of ours that give the same file."""
    groups: dict[tuple[Any, ...], list[Row]] = {}
    for row in rows:
        which = (row["psnr"], row["bytes"], row["nodes"]) if row["program"] == OURS else (row["setting"],)
        groups.setdefault((row["program"], *which), []).append(row)
    for group in groups.values():
        figures: dict[str, float | None] = {key: group[0][key] for key in SHOWN}
        yield group[0]["program"], ", ".join(row["setting"] for row in group), figures


def main(folder: Path, names: Sequence[str] = ()) -> None:
    """Compare the groups of these names, or those that are out of date, and write their records."""
    known = records.read("comparison")
    stale = [name for name in GROUPS if name not in known or not records.is_current(known[name])]
    for name in names or stale:
        subject, curves, images = GROUPS[name]
        found = compare([next(folder.rglob(image)) for image in images], curves)
        text = "\n\n".join(tables(found["results"], name))
        record = {**records.stamp(subject), "other": found["VTracer"]["version"], "tables": text}
        records.write("comparison", name, record)
        print(name, flush=True)


if __name__ == "__main__":
    main(Path(sys.argv[1]), sys.argv[2:])
    records.fill_pages()
