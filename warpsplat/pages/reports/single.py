"""A report: one page on one file and the image that it shows."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from PIL import Image

from warpsplat.errors import ImageError, counted, printable
from warpsplat.files.sources import ImageSource, held
from warpsplat.fit.progress import Progress
from warpsplat.fit.settings import SUBJECTS
from warpsplat.pages.environment import page
from warpsplat.pages.plot import Plot, plot
from warpsplat.pages.reports.pictures import (
    MAP_QUALITIES,
    MOST_ERROR,
    PAGE_PIXELS,
    SHORT_PIXELS,
    ShownImage,
    capacity_of,
    encoded,
    error_map,
    first_that_fits,
    map_colors,
    original_entry,
    picture_alone,
    shown_image,
    thumbnails,
)
from warpsplat.pages.reports.shapes import contributions, listing, matched
from warpsplat.rendering.backend import Backend
from warpsplat.run.result import Result
from warpsplat.scene import FloatArray
from warpsplat.svg.read import load_kept
from warpsplat.svg.viewer import draw

EXACT = "exact"
"""Text for a PSNR that is not finite."""

FIGURES = (
    ("PSNR", "psnr", ".2f", ".2f", "dB"),
    ("SSIM", "ssim", ".3f", ".4f", ""),
    ("MS-SSIM", "ms_ssim", "", ".4f", ""),
    ("SSIMULACRA2", "ssimulacra2", ".1f", ".2f", ""),
    ("Size", "bytes", ".1f", ".1f", "kB"),
    ("Size, gzipped", "gzip_bytes", "", ".1f", "kB"),
    ("Shapes", "shapes", ",d", ",d", ""),
    ("Paths", "paths", "", ",d", ""),
    ("Nodes", "nodes", "", ",d", ""),
    ("Steps", "iterations", "", ",d", ""),
    ("Time", "seconds", ".1f", ".1f", "s"),
)
"""Name, key, format in the headline (empty: not there), format in the table, unit."""


@dataclass(frozen=True)
class Facts:
    """Facts about a result besides the file itself."""

    figures: Mapping[str, Any] = field(default_factory=dict)
    """As ``Result.as_dict`` or ``Score.as_dict``; missing ones are not shown."""
    history: Sequence[Progress] = ()
    """Progress of the training."""
    command: str = ""
    """Command that makes the file again; empty: unknown."""
    before: float | None = None
    """PSNR of the SVG before it was refined [dB]."""
    kept: str = ""
    """Elements of a refined SVG that were kept."""

    @staticmethod
    def of(result: Result, command: str = "") -> Facts:
        """Return the facts of a run."""
        return Facts(result.as_dict(), result.history, command, result.before, result.kept)


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
) -> str:
    """Return the page.

    Args:
        svg: the file's text, ours or not.
        image: the image that it shows.
        backend: where to compute the contributions of shapes.
        facts: further facts.
        name: name of the image, for people.
        svg_name: file name of the download.
        own: whether this program wrote the text just now.
        back: link to an index, with a thumbnail for it; empty: there is none.

    Raises:
        ImageError: the image cannot be read, or the SVG cannot be drawn at its size.
        TypeError: the image has an unknown form.
    """
    image = held(image)
    shown = shown_image(image, name, SHORT_PIXELS if facts.figures.get("reduced") else PAGE_PIXELS)
    height, width = shown.pixels.shape[:2]
    drawn, view = picture_alone(svg, shown)
    target, listed, why_not = _shapes(drawn, shown.pixels, svg_name, backend)
    pixels = draw(drawn, width, height, own=own and view is None and not shown.reduced_size)
    count = len(listed["kinds"]) if listed else 0
    return page(
        "report.html.j2",
        assets=("viewer.css", "report.css", "viewer.js", "report.js"),
        name=printable(name),
        svg_name=printable(svg_name),
        back=back,
        thumbnail=thumbnails(shown.pixels, pixels) if back else "",
        pictures=_pictures(shown, error_map(pixels, target), capacity_of(image)),
        width=shown.width,
        height=shown.height,
        reduced=shown.reduced_size,
        transparent=target.shape[2] == 4,
        scale={"colors": map_colors(), "most": f"{MOST_ERROR:g}"},
        headline=headline(facts.figures),
        rows=table(facts, shown) + levels(facts.figures),
        notes=notes(facts),
        plots=plots(facts.history),
        reduced_part=any(not progress.fine for progress in facts.history),
        command=facts.command,
        listed=listed is not None,
        joined=listed is not None and facts.figures.get("shapes") not in (None, count),
        why_not=why_not,
        data={"svg": svg, "view": view, "listing": listed, "name": svg_name},
    )


def _shapes(
    drawn: str, pixels: FloatArray, name: str, backend: Backend
) -> tuple[FloatArray, dict[str, Any] | None, str]:
    """Return what a file is compared with, a list of its shapes, and why there is none."""
    try:
        base, target = matched(load_kept(drawn, pixels.shape[1], pixels.shape[0], name), pixels)
    except ImageError as error:
        return pixels, None, str(error).removeprefix(f"{name}: ")
    return target, listing(base, contributions(base.scene, target, backend)), ""


def _pictures(shown: ShownImage, errors: Any, capacity: float) -> list[dict[str, Any]]:
    """Return the pictures under the slider."""
    differences = first_that_fits(Image.fromarray(errors), MAP_QUALITIES, capacity / 3)
    original = encoded(shown.pixels, capacity - len(differences) * 3 / 4)  # base64 takes four bytes for three
    return [
        original_entry(original),
        {"name": "svg", "label": "SVG", "url": "", "pixels": False},
        {"name": "error", "label": "Error map", "url": differences, "pixels": True},
    ]


def headline(figures: Mapping[str, Any]) -> list[tuple[str, str, str]]:
    """Return the most important figures: name, value, unit."""
    return [
        (name, value, "" if value == EXACT else unit)
        for name, key, form, _, unit in FIGURES
        if form and (value := _value(figures, key, form)) is not None
    ]


def table(facts: Facts, shown: ShownImage) -> list[tuple[str, str]]:
    """Return all figures: name, and value with its unit."""
    figures = facts.figures
    rows = [("Image", f"{shown.width} × {shown.height}", "px")]
    if (subject := figures.get("subject")) is not None:
        subject = SUBJECTS.get(str(subject), str(subject))
        rows.append(("Subject", f"{subject}: {figures['why']}" if figures.get("why") else subject, ""))
    for name, key, _, form, unit in FIGURES:
        if (value := _value(figures, key, form)) is not None and (key != "iterations" or figures[key]):
            rows.append((name, value, unit))
        if key == "psnr" and facts.before is not None:
            rows.append(("PSNR before", f"{facts.before:.2f}", "dB"))
    return [
        (name, value if value == EXACT or not unit else f"{value}\N{NO-BREAK SPACE}{unit}")
        for name, value, unit in rows
    ]


def _value(figures: object, key: str, form: str) -> str | None:
    """Return a figure as text; None if it is missing. A manifest may contain anything."""
    value = figures.get(key) if isinstance(figures, Mapping) else None
    if key == "psnr" and isinstance(figures, Mapping) and figures.get("exact") is True:
        return EXACT
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
        return None
    value = int(value) if form == ",d" else value / 1000 if key.endswith("bytes") else value
    return format(value, form).replace(",", "\N{THIN SPACE}").replace("-", "\N{MINUS SIGN}")


def notes(facts: Facts) -> list[str]:
    """Return remarks on the run, each as a sentence."""
    figures = facts.figures
    found = []
    if figures.get("stopped"):
        steps = counted(figures.get("iterations", 0), "step")
        found.append(f"The run was stopped after {steps}: this is the result so far.")
    if figures.get("reduced"):
        found.append(f"{figures['reduced']}.")
    if figures.get("renewed"):
        found.append(
            f"Shapes with numbers that were not finite were reset, {counted(figures['renewed'], 'time')}."
        )
    if facts.kept:
        found.append(f"Kept unchanged: {facts.kept}.")
    found += [f"{note[:1].upper()}{note[1:]}." for note in figures.get("notes") or ()]
    missed = figures.get("missed")
    found += [f"Goal missed: {goal}." for goal in (missed if isinstance(missed, (list, tuple)) else ())]
    return found


def levels(figures: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Return the name and PSNR of each level's picture."""
    given = figures.get("levels")
    found = []
    for level in given if isinstance(given, (list, tuple)) else ():
        count, psnr = _value(level, "shapes", ",d"), _value(level, "psnr", ".2f")
        if count is not None:
            psnr = EXACT if psnr is None else f"{psnr}\N{NO-BREAK SPACE}dB"
            found.append((f"The first {count} shape{'s' * (count != '1')}", psnr))
    return found


def plots(history: Sequence[Progress]) -> list[Plot]:
    """Return plots of the PSNR and the number of shapes over time, if they change."""
    seconds = [progress.seconds for progress in history]
    psnr = [progress.psnr for progress in history]
    shapes = [float(progress.shapes) for progress in history]
    faint = [not progress.fine for progress in history]
    found = [plot("PSNR", seconds, psnr, ("time [s]", "PSNR [dB]"), faint=faint)]
    if len(set(shapes)) > 1:
        found.append(plot("Shapes", seconds, shapes, ("time [s]", "shapes"), filled=True))
    return [one for one in found if one]
