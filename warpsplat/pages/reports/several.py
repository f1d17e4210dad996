"""A page that compares several versions of one image: those of ``--curves 50,200,1000``."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from warpsplat.errors import printable
from warpsplat.files.sources import ImageSource, held
from warpsplat.pages import page
from warpsplat.pages.plot import Mark, Plot, plot
from warpsplat.pages.reports.knee import knee
from warpsplat.pages.reports.pictures import ROOM, ROOM_SHARE, encoded, shown_image
from warpsplat.pages.reports.single import Facts, headline, notes
from warpsplat.run.result import Result
from warpsplat.svg.page import picture_view, with_view

ASSETS = ("viewer.css", "report.css", "several.css", "viewer.js", "copy.js", "several.js")

FIGURES = ("PSNR", "SSIM", "SSIMULACRA2", "Size", "Shapes", "Time")
"""Of a version, that its card shows."""


@dataclass(frozen=True)
class Version:
    """A result and the name that its file is downloaded as."""

    result: Result
    file: str

    @property
    def shapes(self) -> int:
        """That it has."""
        return int(self.result.as_dict()["shapes"])

    @property
    def is_measured(self) -> bool:
        """Whether it has decibels: neither those of an exact file nor none."""
        return self.result.score is not None and math.isfinite(self.result.score.psnr)


def several_page(results: Sequence[Version], image: ImageSource, *, name: str, command: str = "") -> str:
    """The page.

    Args:
        results: of the image, ascending by their shapes.
        image: what they show.
        name: of the image, for people.
        command: that makes them again.

    Raises:
        ImageError: the image cannot be read.
        TypeError: an image of no known form.
    """
    image = held(image)
    shown = shown_image(image, name)
    height, width = shown.pixels.shape[:2]
    room = ROOM + ROOM_SHARE * len(image) if isinstance(image, bytes) else math.inf
    at = knee_of(results)
    versions = [_card(version, number, is_knee=number == at) for number, version in enumerate(results)]
    pictures: list[dict[str, Any]] = [
        {"name": "image", "label": "Original", "url": encoded(shown.pixels, room), "pixels": True}
    ]
    pictures += [
        {"name": card["key"], "label": card["label"], "url": "", "pixels": False} for card in versions
    ]
    sentences = [note for version in results for note in notes(Facts.of(version.result))]
    return page(
        "several.html.j2",
        assets=ASSETS,
        name=printable(name),
        versions=versions,
        pictures=pictures,
        width=shown.width,
        height=shown.height,
        reduced=f"{width}×{height}" if shown.is_reduced else "",
        transparent=shown.pixels.shape[2] == 4,
        notes=list(dict.fromkeys(sentences)),
        plots=[one for one in plots(results, at) if one],
        knee=_words(results, at),
        command=command,
        data={
            card["key"]: _shown(version.result.svg, shown.width, shown.height)
            for card, version in zip(versions, results, strict=True)
        },
    )


def knee_of(results: Sequence[Version]) -> int | None:
    """The version at the knee of quality against bytes; None where there is none."""
    if not all(version.is_measured for version in results):
        return None
    sizes = np.array([len(version.result.svg.encode()) for version in results], np.float64)
    if (np.diff(sizes) <= 0).any():
        return None
    return knee(sizes, np.array([_psnr(version) for version in results]))


def _psnr(version: Version) -> float:
    assert version.result.score
    return version.result.score.psnr


def _card(version: Version, number: int, *, is_knee: bool) -> dict[str, Any]:
    return {
        "key": f"version-{number}",
        "label": f"{version.shapes:,} shapes".replace(",", "\N{THIN SPACE}"),
        "file": printable(version.file),
        "knee": is_knee,
        "figures": [one for one in headline(version.result.as_dict()) if one[0] != "Shapes"],
    }


def _shown(svg: str, width: int, height: int) -> str:
    """A file as it is shown and downloaded; one on a sheet as its picture alone."""
    view = picture_view(svg, width, height)
    return svg if view is None else with_view(svg, view, width, height)


def plots(results: Sequence[Version], at: int | None) -> list[Plot | None]:
    """Decibels against shapes and against bytes, with the knee marked."""
    if len(results) < 2 or not all(version.is_measured for version in results):
        return []
    decibels = [_psnr(version) for version in results]
    kilobytes = [len(version.result.svg.encode()) / 1000 for version in results]

    def drawn(title: str, across: list[float], label: str) -> Plot | None:
        marks = [
            Mark(x, y, f"{version.shapes}", strong=number == at)
            for number, (x, y, version) in enumerate(zip(across, decibels, results, strict=True))
        ]
        return plot(title, across, decibels, (label, "PSNR [dB]"), marks=marks)

    return [
        drawn("PSNR by shapes", [float(version.shapes) for version in results], "shapes"),
        drawn("PSNR by size", kilobytes, "size [kB]"),
    ]


def _words(results: Sequence[Version], at: int | None) -> str:
    """What the knee is; empty where there is none."""
    if at is None:
        return ""
    before, here, after = results[at - 1], results[at], results[at + 1]

    def bought(one: Version, two: Version) -> float:
        return 1000 * (_psnr(two) - _psnr(one)) / (len(two.result.svg) - len(one.result.svg))

    return (
        f"Of these, {here.shapes} shapes are at the knee: up to there a kB buys "
        f"{bought(before, here):.2g} dB, beyond it {bought(here, after):.2g} dB."
    )


def versions_of(results: Sequence[Result], svg_name: str) -> list[Version]:
    """Results, ascending by their shapes, that are downloaded as ``svg_name`` with these numbers in it."""
    stem = Path(svg_name).stem
    made = [Version(result, f"{stem}-{result.as_dict()['shapes']}.svg") for result in results]
    return sorted(made, key=lambda version: version.shapes)
