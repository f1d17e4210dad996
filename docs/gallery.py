"""The gallery's SVGs and their figures: ``python docs/gallery.py [--only NAME ...] [--force]``.

``docs/gallery/gallery.yaml`` lists the images with their settings. What is up to date (image, settings, the
golden files of its subject, and the SVG itself) is left alone. Pages and reports are made when the site is
built (``gallery_pages.py``, ``gallery_reports.py``).
"""

from __future__ import annotations

import json
import shlex
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, get_args

import click
import records
import yaml
from records import digest

import warpsplat
from warpsplat.fit.settings import Subject

ROOT = Path(__file__).parents[1]
FOLDER = ROOT / "docs" / "gallery"
SUBJECTS = tuple(name for name in get_args(Subject) if name not in {"auto", "silhouette"})

MOST_POINTS = 24
"""Of a history, in its record: as many as a small plot shows."""


@dataclass(frozen=True)
class Entry:
    """An image of the gallery, where it is from, and the settings that it is shown with."""

    subject: str
    """By which the gallery is sorted; one of ``SUBJECTS``."""
    name: str
    title: str
    what: str
    """What the settings show, as a sentence."""
    settings: Mapping[str, Any]
    """Keywords of ``warpsplat.vectorize``."""
    author: str
    licence: str
    package: str
    """Where the image was found ..."""
    file: str = ""
    """... and under which name."""
    changes: str = ""
    """What was done to it; empty: nothing."""
    folder: Path = field(default=FOLDER, repr=False)

    @property
    def image(self) -> Path:
        """The image.

        Raises:
            FileNotFoundError: there is none.
        """
        for suffix in (".jpg", ".png"):
            path = self.folder / "images" / self.subject / (self.name + suffix)
            if path.exists():
                return path
        raise FileNotFoundError(f"no image of {self.subject}/{self.name} in {self.folder}")

    @property
    def svg(self) -> Path:
        """What is made of it."""
        return self.folder / "images" / self.subject / f"{self.name}.svg"

    @property
    def record(self) -> Path:
        """The figures."""
        return self.folder / "records" / self.subject / f"{self.name}.json"

    @property
    def report(self) -> str:
        """Where the site has its report, below the gallery's pages."""
        return f"reports/{self.name}.html"

    @property
    def command(self) -> str:
        """The line of a shell that makes the SVG."""
        words = ["warpsplat", "vectorize", self.image.name]
        for name, value in self.settings.items():
            words.append(f"--{name.replace('_', '-')}")
            if value is not True:
                words.append(str(value))
        return shlex.join(words)

    def figures(self) -> dict[str, Any]:
        """What the record says."""
        found: dict[str, Any] = json.loads(self.record.read_text("utf-8"))
        return found

    def inputs(self) -> dict[str, str]:
        """What the SVG was made of, as a record says it: but for the code."""
        settings = json.dumps(self.settings, sort_keys=True)
        return {"image": digest(self.image.read_bytes()), "settings": digest(settings.encode())}


def entries(folder: Path = FOLDER) -> tuple[Entry, ...]:
    """All images of the list, in its order."""
    listed = yaml.safe_load((folder / "gallery.yaml").read_text("utf-8"))
    return tuple(
        Entry(
            subject=subject,
            name=name,
            folder=folder,
            package=listed["packages"].get(source["package"], source["package"]),
            file=source.get("file", ""),
            **{key: value for key, value in values.items() if key != "source"},
        )
        for subject in SUBJECTS
        for name, values in listed[subject].items()
        for source in (values["source"],)
    )


def licences(folder: Path = FOLDER) -> dict[str, str]:
    """Where the text of each licence is."""
    found: dict[str, str] = yaml.safe_load((folder / "gallery.yaml").read_text("utf-8"))["licences"]
    return found


def is_current(entry: Entry) -> bool:
    """Whether the SVG is what a run would make now."""
    if not (entry.record.exists() and entry.svg.exists()):
        return False
    made = {**entry.inputs(), "svg": digest(entry.svg.read_bytes())}
    record = entry.figures()
    return record["made_of"] == made and records.is_current(record)


def make(entry: Entry) -> dict[str, Any]:
    """Run the entry's command; write its SVG and its record.

    Returns:
        the record.
    """
    started = time.process_time()
    result = warpsplat.vectorize(entry.image, **entry.settings, device="cpu", threads=1)
    seconds = time.process_time() - started
    result.save(entry.svg)
    figures = result.as_dict()
    kept = (
        "psnr",
        "ssim",
        "ssimulacra2",
        "bytes",
        "shapes",
        "paths",
        "nodes",
        "why",
        "iterations",
    )
    record = {
        **records.stamp(result.subject),
        "made_of": {**entry.inputs(), "svg": digest(entry.svg.read_bytes())},
        "seconds": round(seconds, 1),
        **{name: figures[name] for name in kept if figures.get(name) is not None},
        "bytes": entry.svg.stat().st_size,  # on its sheet
        "levels": figures["levels"],
        "history": thinned(result.history),
    }
    entry.record.parent.mkdir(parents=True, exist_ok=True)
    lines = (f' "{name}": {json.dumps(value, ensure_ascii=False)}' for name, value in record.items())
    entry.record.write_text("{\n" + ",\n".join(lines) + "\n}\n", "utf-8")
    return record


def thinned(history: Sequence[warpsplat.Progress]) -> dict[str, list[Any]]:
    """A few reports of a run, the last of them among these, by what they say."""
    step = max(1, -(-len(history) // MOST_POINTS))
    kept = history[::-step][::-1]
    return {
        "step": [report.step for report in kept],
        "seconds": [round(report.seconds, 2) for report in kept],
        "psnr": [round(report.psnr, 2) for report in kept],
        "shapes": [report.shapes for report in kept],
        "fine": [report.fine for report in kept],
    }


def make_all(names: Sequence[str] = (), *, force: bool = False) -> None:
    """Make what is out of date, or all, of these names or of all, one after the other on one thread."""
    for entry in entries():
        if (names and entry.name not in names) or (is_current(entry) and not force):
            continue
        made = make(entry)
        psnr = "exact" if made.get("psnr") is None else f"{made['psnr']:.2f} dB"
        line = f"{entry.subject}/{entry.name}: {psnr}, {made['shapes']} shapes, {made['bytes']} bytes"
        click.echo(f"{line}, {made['seconds']} s, taken for {made['subject']}")


@click.command()
@click.option(
    "--only", "names", multiple=True, metavar="NAME", help="This image; may be given several times."
)
@click.option("--force", is_flag=True, help="Also what is up to date.")
def main(names: tuple[str, ...], *, force: bool) -> None:
    """Make the SVGs and the records of the gallery."""
    if unknown := set(names) - {entry.name for entry in entries()}:
        raise click.UsageError(f"the gallery has no {', '.join(sorted(unknown))}")
    make_all(names, force=force)


if __name__ == "__main__":
    main()
