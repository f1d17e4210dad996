"""A page that compares several versions of one image, made by ``--curves 50,200,1000``."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from warpsplat.errors import counted, printable
from warpsplat.files.sources import ImageSource, held
from warpsplat.pages.environment import page
from warpsplat.pages.plot import Mark, Plot, plot
from warpsplat.pages.reports.pictures import capacity_of, encoded, original_entry, picture_alone, shown_image
from warpsplat.pages.reports.single import Facts, headline, notes
from warpsplat.run.result import Result

Floats = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Version:
    """A result and the file name of its download."""

    result: Result
    file: str

    @property
    def shapes(self) -> int:
        """Number of shapes."""
        return int(self.result.as_dict()["shapes"])

    @property
    def bytes(self) -> int:
        """Size of the file."""
        return len(self.result.svg.encode())

    @property
    def psnr(self) -> float:
        """Its PSNR [dB]; infinite if the file is exact, NaN if it was not measured."""
        return self.result.score.psnr if self.result.score else math.nan


def versions_of(results: Sequence[Result], svg_name: str) -> list[Version]:
    """Return results, ascending by their shapes, with the number of shapes inserted into ``svg_name``."""
    stem = Path(svg_name).stem
    versions = [Version(result, f"{stem}-{result.as_dict()['shapes']}.svg") for result in results]
    return sorted(versions, key=lambda version: version.shapes)


def several_page(versions: Sequence[Version], image: ImageSource, *, name: str, command: str = "") -> str:
    """Return the page on ``versions`` of an image, ascending by their shapes; ``command`` makes them again.

    Raises:
        ImageError: the image cannot be read.
        TypeError: the image has an unknown form.
    """
    image = held(image)
    shown = shown_image(image, name)
    at = knee_of(versions)
    cards = [
        {
            "key": f"version-{number}",
            "label": f"{version.shapes:,} shape{'s' * (version.shapes != 1)}".replace(",", "\N{THIN SPACE}"),
            "file": printable(version.file),
            "knee": number == at,
            "figures": [one for one in headline(version.result.as_dict()) if one[0] != "Shapes"],
        }
        for number, version in enumerate(versions)
    ]
    sentences = [note for version in versions for note in notes(Facts.of(version.result))]
    return page(
        "several.html.j2",
        assets=("viewer.css", "report.css", "several.css", "viewer.js", "several.js"),
        name=printable(name),
        versions=cards,
        pictures=[
            original_entry(encoded(shown.pixels, capacity_of(image))),
            *({"name": card["key"], "label": card["label"], "url": "", "pixels": False} for card in cards),
        ],
        width=shown.width,
        height=shown.height,
        reduced=shown.reduced_size,
        transparent=shown.pixels.shape[2] == 4,
        notes=list(dict.fromkeys(sentences)),
        plots=plots(versions, at),
        knee=_explanation(versions, at),
        command=command,
        data={
            str(card["key"]): picture_alone(version.result.svg, shown)[0]
            for card, version in zip(cards, versions, strict=True)
        },
    )


def knee(cost: Floats, gain: Floats) -> int | None:
    """Return the knee of a curve that rises ever more slowly (Satopää et al. 2011).

    It is the point farthest above the chord from the first to the last point, where the curve is as steep as
    on average: before it a unit of cost buys more, after it less.

    Args:
        cost: ascending, shape (point,).
        gain: at these costs, in any unit, shape (point,).

    Returns:
        its index; None if no point lies above the chord.
    """
    if len(cost) < 3 or gain[-1] <= gain[0]:
        return None
    across = (cost - cost[0]) / (cost[-1] - cost[0])
    above = (gain - gain[0]) / (gain[-1] - gain[0]) - across
    best = int(above.argmax())
    return best if above[best] > 1e-6 and 0 < best < len(cost) - 1 else None  # less is rounding


def knee_of(versions: Sequence[Version]) -> int | None:
    """Return the version at the knee of PSNR against bytes; None if there is none."""
    sizes = np.array([version.bytes for version in versions], np.float64)
    decibels = np.array([version.psnr for version in versions])
    if not np.isfinite(decibels).all() or (np.diff(sizes) <= 0).any():
        return None
    return knee(sizes, decibels)


def plots(versions: Sequence[Version], at: int | None) -> list[Plot]:
    """Return plots of the PSNR against shapes and against bytes, with the version ``at`` the knee marked."""
    decibels = [version.psnr for version in versions]
    if not all(map(math.isfinite, decibels)):
        return []
    found = []
    for title, label, across in (
        ("PSNR by shapes", "shapes", [float(version.shapes) for version in versions]),
        ("PSNR by size", "size [kB]", [version.bytes / 1000 for version in versions]),
    ):
        marks = [
            Mark(x, y, f"{version.shapes}", strong=number == at)
            for number, (x, y, version) in enumerate(zip(across, decibels, versions, strict=True))
        ]
        found.append(plot(title, across, decibels, (label, "PSNR [dB]"), marks=marks))
    return [one for one in found if one]


def _explanation(versions: Sequence[Version], at: int | None) -> str:
    """Return a sentence on the knee; empty if there is none."""
    if at is None:
        return ""
    before, here, after = versions[at - 1 : at + 2]
    bought, next_bought = (
        1000 * (two.psnr - one.psnr) / (two.bytes - one.bytes) for one, two in ((before, here), (here, after))
    )
    return (
        f"The knee is at {counted(here.shapes, 'shape')}: up to there a kB buys {bought:.2g} dB, "
        f"beyond it {next_bought:.2g} dB."
    )
