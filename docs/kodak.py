"""Measure what the README says of the Kodak photographs: ``python docs/kodak.py FOLDER [NAME ...]``.

The folder has the images ``kodimNN.png`` of the Kodak Lossless True Color Image Suite, which are not ours to
give away. Their figures go into the records (``records.py``), the means of all images in the folder.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Sequence
from pathlib import Path
from statistics import fmean
from typing import Any

import records

import warpsplat

RUNS: dict[str, dict[str, Any]] = {
    "512-draft": {"curves": 512, "closed": True, "quality": "draft"},
    "256": {"curves": 256, "closed": True},
    "512": {"curves": 512, "closed": True},
    "1024": {"curves": 1024, "closed": True},
    "512-strokes": {"curves": 512, "open": True},
    "256-strokes": {"curves": 256, "open": True},
    "1024-strokes": {"curves": 1024, "open": True},
}
"""Keywords of ``warpsplat.vectorize``, by the names of the records."""


def measure(images: Sequence[Path], settings: dict[str, Any]) -> dict[str, Any]:
    """Return the mean figures of the files of all images, and of the time that a run takes [s]."""
    kept = ("psnr", "ssim", "ssimulacra2", "bytes")
    rows: list[dict[str, float]] = []
    for image in images:
        cpu, wall = time.process_time(), time.monotonic()
        figures = warpsplat.vectorize(image, **settings, device="cpu").as_dict()
        times = {"cpu_seconds": time.process_time() - cpu, "seconds": time.monotonic() - wall}
        rows.append({**{name: figures[name] for name in kept}, **times})
    means = {name: round(fmean(row[name] for row in rows), 3) for name in rows[0]}
    return {"images": len(images), **means}


def main(folder: Path, names: Sequence[str] = ()) -> None:
    """Measure the runs of these names, or those that are out of date, and write their records."""
    images = sorted(folder.glob("kodim*.png"))
    if not images:
        raise SystemExit(f"{folder} has no kodimNN.png")
    known = records.read("kodak")
    stale = [name for name in RUNS if name not in known or not records.is_current(known[name])]
    for name in names or stale:
        made = measure(images, RUNS[name])
        print(name, made, flush=True)
        records.write("kodak", name, {**records.stamp("photo"), **made})


if __name__ == "__main__":
    main(Path(sys.argv[1]), sys.argv[2:])
    records.fill_pages()
