"""How the shapes came to be: the scenes of a run as pictures, or as an SVG that turns its own pages."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from pathlib import Path

from warpsplat.fit.export import export
from warpsplat.fit.settings import Settings
from warpsplat.jobs.result import Result
from warpsplat.motion.films import Frame, ticks_of, zoom_of
from warpsplat.motion.painter import Painter
from warpsplat.motion.shown import picture, screen, size_of
from warpsplat.motion.timing import showings
from warpsplat.rendering.backend import Backend
from warpsplat.scene import Scene
from warpsplat.svg.numbers import number
from warpsplat.svg.write import GRIDS, MARK


def pictures(
    scenes: Sequence[Scene],
    moments: Sequence[int],
    result: Result,
    path: Path,
    width: int | None,
    seconds: float,
    backend: Backend,
) -> Iterator[Frame]:
    """The frames of a film of scenes and their moments, drawn on ``backend``; the last one is the file as a
    viewer shows it.
    """
    end = finished(result)
    zoom = zoom_of(path, size_of(end), width)
    size = screen(end, zoom)
    painter = Painter(backend, Settings(renderer=result.renderer), size)
    for showing in showings(moments, ticks_of(path, size, seconds), seconds):
        scene = scenes[showing.index]
        scale = zoom * result.scene.canvas.width / scene.canvas.width  # runs may be on reduced images
        yield painter.paint(scene, scale), showing.seconds
    yield picture(end, size, zoom), 0.0


def finished(result: Result) -> str:
    """The file; or, of one on a sheet of paper, what is on it."""
    canvas = result.scene.canvas
    if size_of(result.svg) == (canvas.width, canvas.height):
        return result.svg
    return page(result.scene, result, GRIDS[-1])


def page(scene: Scene, result: Result, per_pixel: float) -> str:
    """The SVG of a scene of the run, with ``per_pixel`` units of its view box a pixel."""
    return export(scene, Settings(renderer=result.renderer), per_pixel)


# An SVG.

MOST_PAGES = 20
"""Scenes in an SVG."""

FEWEST_PAGES = 6

MOST_TEXT = 3 << 20
"""Of these scenes [bytes], where that leaves ``FEWEST_PAGES``."""

UNITS = 1000
"""Of the view box of a scene in between, along its longer side, at the least: it is seen for a moment."""

FADE = 0.6
"""Share of a page's time in which it comes, over the one before it."""

STYLE = (
    "<style>"
    ".p{{visibility:hidden;animation:i {fade}s both,o 1ms forwards}}"
    ".e{{animation:e {fade}s {end}s both}}"
    "@keyframes i{{from{{opacity:0;visibility:hidden}}1%{{visibility:visible}}"
    "to{{opacity:1;visibility:visible}}}}"
    "@keyframes o{{to{{visibility:hidden}}}}"
    "@keyframes e{{from{{opacity:0}}}}"
    "@media(prefers-reduced-motion:reduce){{.p{{display:none}}.e{{animation:none}}}}"
    "</style>"
)


def vector(scenes: Sequence[Scene], moments: Sequence[int], result: Result, seconds: float) -> str:
    """An SVG that shows scenes of the run, each coming over the one before it, and then stays the file.

    It is played by style sheets alone, once, also in ``<img>``. Where nothing is animated, or readers ask for
    less motion, it is the file. Pages, not shapes that move: as a run goes on a tenth of the shapes is placed
    anew every 25 steps, so that few could be followed, and paths that change take as many bytes as new ones.
    """
    end = finished(result)
    head, inside = _parts(end)
    count = max(FEWEST_PAGES, min(MOST_PAGES, MOST_TEXT // max(1, len(end))))
    shown = showings(moments, count, seconds)
    box = [float(value) for value in VIEW_BOX.findall(head)[0].split()]
    pages, now = [], 0.0
    fade = FADE * seconds / count
    for number_of, showing in enumerate(shown):
        starts, now = now, now + showing.seconds
        scene = scenes[showing.index]
        per_pixel = _coarse(scene)
        zoom = box[2] / (scene.canvas.width * per_pixel)
        times = f"{number(starts, 2)}s,{number(now + fade, 2)}s"
        pages.append(
            f'<g class="p" style="animation-delay:{times}" transform="scale({zoom:.9g})">'
            f"{_named(_parts(page(scene, result, per_pixel))[1], f'p{number_of}')}</g>\n"
        )
    style = STYLE.format(fade=number(fade, 3), end=number(now, 2))
    return f'{head}{MARK}-->\n{style}\n{"".join(pages)}<g class="e">{inside}</g></svg>\n'


VIEW_BOX = re.compile(r'viewBox="([^"]*)"')
ROOT = re.compile(r"<svg[^>]*>")
COMMENT = re.compile(r"^(\s*<!--warpsplat.*?-->)?\s*", re.DOTALL)


def _parts(text: str) -> tuple[str, str]:
    """The start tag of a file written here, and what is in it."""
    found = ROOT.search(text)
    assert found
    inside = text[found.end() :].rpartition("</svg>")[0]
    return found[0], COMMENT.sub("", inside, count=1)


def _named(text: str, prefix: str) -> str:
    """With identifiers that no other page has."""
    text = re.sub(r'\bid="', f'id="{prefix}', text)
    return re.sub(r'(url\(#|href="#)', rf"\g<1>{prefix}", text)


def _coarse(scene: Scene) -> float:
    """Units a pixel of a scene that is seen for a moment."""
    side = max(scene.canvas.width, scene.canvas.height)
    return next((units for units in GRIDS if units * side >= UNITS), GRIDS[-1])
