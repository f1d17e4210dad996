"""A report: one page on one file and the image that it shows."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from warpsplat.errors import ImageError, printable
from warpsplat.files.sources import ImageSource, held
from warpsplat.fit.progress import Progress
from warpsplat.pages import page
from warpsplat.pages.embed import image_uri
from warpsplat.pages.plot import Plot, plot
from warpsplat.pages.reports.pictures import (
    MOST_ERROR,
    PAGE_PIXELS,
    ROOM,
    ROOM_SHARE,
    SHORT_PIXELS,
    Shown,
    encoded,
    encoded_map,
    error_map,
    map_colors,
    shown_image,
    thumbnails,
)
from warpsplat.pages.reports.shapes import decibels, listing, matched
from warpsplat.rendering.backend import Backend
from warpsplat.run.result import Result
from warpsplat.svg.page import picture_view, with_view
from warpsplat.svg.read_kept import load_kept
from warpsplat.svg.strips import draw

ASSETS = ("viewer.css", "report.css", "viewer.js", "copy.js", "report.js")


@dataclass(frozen=True)
class Facts:
    """What is known of a result besides the file itself."""

    figures: Mapping[str, Any] = field(default_factory=dict)
    """As ``Result.as_dict`` or ``Score.as_dict`` has them; what is missing is not shown."""
    history: Sequence[Progress] = ()
    """Of the training."""
    command: str = ""
    """That makes the file again; empty: nothing is said."""
    before: float | None = None
    """Of a refined SVG, its own PSNR [dB]."""
    kept: str = ""
    """Of a refined SVG, what was kept as it is."""

    @staticmethod
    def of(result: Result, command: str = "") -> Facts:
        """Of what a run made."""
        return Facts(result.as_dict(), result.history, command, result.before, result.kept)


class Report(NamedTuple):
    """A page, and what lists show of it."""

    text: str
    thumbnail: str
    """The image and the file side by side, as a data URI; empty without an index."""


def report_page(
    svg: str,
    image: ImageSource,
    backend: Backend,
    facts: Facts,
    *,
    name: str,
    svg_name: str,
    own: bool = False,
    back: str = "",
) -> Report:
    """The page.

    Args:
        svg: the file's text, ours or not.
        image: what it shows.
        backend: where to compute what each shape is worth.
        facts: what is known of it besides.
        name: of the image, for people.
        svg_name: that the file is downloaded as.
        own: whether this program wrote the text just now.
        back: where a link to an index leads; empty: there is none.

    Raises:
        ImageError: the image cannot be read, or the SVG cannot be drawn at its size.
        TypeError: an image of no known form.
    """
    image = held(image)
    shown = shown_image(image, name, SHORT_PIXELS if facts.figures.get("reduced") else PAGE_PIXELS)
    height, width = shown.pixels.shape[:2]
    view = picture_view(svg, shown.width, shown.height)
    drawn = svg if view is None else with_view(svg, view, shown.width, shown.height)
    own = own and view is None
    base, target, why_not = None, shown.pixels, ""
    try:
        base, target = matched(load_kept(drawn, width, height, svg_name), shown.pixels)
    except ImageError as error:
        why_not = str(error).removeprefix(f"{svg_name}: ")
    room = ROOM + ROOM_SHARE * len(image) if isinstance(image, bytes) else math.inf
    pixels = draw(drawn, width, height, own=own and not shown.is_reduced)
    differs = encoded_map(error_map(pixels, target), room / 3)
    listed = None if base is None else listing(base, decibels(base.scene, target, backend))
    # Base64 takes four bytes for three.
    left = room - len(differs) * 3 / 4
    picture = encoded(shown.pixels, left)
    thumbnail = image_uri(thumbnails(shown.pixels, pixels)) if back else ""
    text = page(
        "report.html.j2",
        assets=ASSETS,
        name=printable(name),
        svg_name=printable(svg_name),
        back=back,
        thumbnail=thumbnail,
        pictures=[
            {"name": "image", "label": "Original", "url": picture, "pixels": True},
            {"name": "svg", "label": "SVG", "url": "", "pixels": False},
            {"name": "error", "label": "Error map", "url": differs, "pixels": True},
        ],
        width=shown.width,
        height=shown.height,
        reduced=f"{width}×{height}" if shown.is_reduced else "",
        transparent=target.shape[2] == 4,
        scale={"colors": map_colors(), "most": f"{MOST_ERROR:g}"},
        heads=headline(facts.figures),
        rows=table(facts, shown),
        notes=notes(facts),
        plots=[one for one in plots(facts.history) if one],
        reduced_part=any(not progress.fine for progress in facts.history),
        command=facts.command,
        levels=levels(facts.figures),
        listed=listed is not None,
        joined=listed is not None and facts.figures.get("shapes") not in (None, len(listed.kinds)),
        why_not=why_not,
        data={"svg": svg, "view": view, "listing": listed.data() if listed else None, "name": svg_name},
    )
    return Report(text, thumbnail)


def headline(figures: Mapping[str, Any]) -> list[tuple[str, str, str]]:
    """The figures that count most: name, value, unit."""
    found = [
        ("PSNR", _psnr(figures), "dB"),
        ("SSIM", _number(figures, "ssim", ".3f"), ""),
        ("SSIMULACRA2", _number(figures, "ssimulacra2", ".1f"), ""),
        ("Size", _kilobytes(figures, "bytes"), "kB"),
        ("Shapes", _number(figures, "shapes", ",d"), ""),
        ("Time", _number(figures, "seconds", ".1f"), "s"),
    ]
    return [(name, value, "" if value == EXACT else unit) for name, value, unit in found if value is not None]


EXACT = "exact"
"""In place of decibels that are not finite."""


def _psnr(figures: Mapping[str, Any]) -> str | None:
    if figures.get("psnr") is None:
        return EXACT if figures.get("ssim") == 1 else None
    return _number(figures, "psnr", ".2f")


def _number(figures: Mapping[str, Any], name: str, form: str) -> str | None:
    value = figures.get(name) if isinstance(figures, Mapping) else None
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return None
    value = int(value) if form == ",d" else value
    return format(value, form).replace(",", "\N{THIN SPACE}").replace("-", "\N{MINUS SIGN}")


def _kilobytes(figures: Mapping[str, Any], name: str) -> str | None:
    count = figures.get(name)
    return f"{count / 1000:.1f}" if isinstance(count, (int, float)) else None


def table(facts: Facts, shown: Shown) -> list[tuple[str, str]]:
    """All figures: name, and value with its unit."""
    figures = facts.figures
    rows: list[tuple[str, str | None, str]] = [
        ("Image", f"{shown.width} × {shown.height}", "px"),
        ("Subject", _subject(figures), ""),
        ("PSNR", _psnr(figures), "dB"),
        ("PSNR before", None if facts.before is None else f"{facts.before:.2f}", "dB"),
        ("SSIM", _number(figures, "ssim", ".4f"), ""),
        ("MS-SSIM", _number(figures, "ms_ssim", ".4f"), ""),
        ("SSIMULACRA2", _number(figures, "ssimulacra2", ".2f"), ""),
        ("Size", _kilobytes(figures, "bytes"), "kB"),
        ("Size, gzipped", _kilobytes(figures, "gzip_bytes"), "kB"),
        ("Shapes", _number(figures, "shapes", ",d"), ""),
        ("Paths", _number(figures, "paths", ",d"), ""),
        ("Nodes", _number(figures, "nodes", ",d"), ""),
        ("Steps", _number(figures, "iterations", ",d") if figures.get("iterations") else None, ""),
        ("Time", _number(figures, "seconds", ".1f"), "s"),
    ]
    return [
        (name, value if value == EXACT or not unit else f"{value}\N{NO-BREAK SPACE}{unit}")
        for name, value, unit in rows
        if value is not None
    ]


SUBJECTS = {"photo": "photograph", "drawing": "drawing", "line": "line drawing", "pixel": "pixel art"}


def _subject(figures: Mapping[str, Any]) -> str | None:
    subject = figures.get("subject")
    if subject is None:
        return None
    name = SUBJECTS.get(str(subject), str(subject))
    return f"{name}: {figures['why']}" if figures.get("why") else name


def notes(facts: Facts) -> list[str]:
    """What is to be known of the run, each as a sentence."""
    figures = facts.figures
    found = []
    if figures.get("stopped"):
        found.append(
            f"The run was stopped after {figures.get('iterations', 0)} steps: this is what there was."
        )
    if figures.get("reduced"):
        found.append(f"{figures['reduced']}.")
    if figures.get("renewed"):
        found.append(f"Numbers of shapes were not finite, {figures['renewed']} times; these began anew.")
    if facts.kept:
        found.append(f"Kept as it is: {facts.kept}.")
    missed = figures.get("missed")
    found += [f"Goal missed: {goal}." for goal in (missed if isinstance(missed, (list, tuple)) else ())]
    return found


def levels(figures: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Name and figure of each level's picture."""
    given = figures.get("levels")
    found = []
    for level in given if isinstance(given, (list, tuple)) else ():
        count, value = _number(level, "shapes", ",d"), _number(level, "psnr", ".2f")
        if count is not None:
            found.append(
                (f"The first {count} shapes", EXACT if value is None else f"{value}\N{NO-BREAK SPACE}dB")
            )
    return found


def plots(history: Sequence[Progress]) -> list[Plot | None]:
    """PSNR and the number of shapes over time."""
    seconds = [progress.seconds for progress in history]
    faint = [not progress.fine for progress in history]
    shapes = [float(progress.shapes) for progress in history]
    return [
        plot("PSNR", seconds, [p.psnr for p in history], ("time [s]", "PSNR [dB]"), faint=faint),
        plot("Shapes", seconds, shapes, ("time [s]", "shapes"), from_zero=True, filled=True)
        if len(set(shapes)) > 1
        else None,
    ]
