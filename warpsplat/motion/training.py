"""Animate the training: the scenes of a run as frames, or as an animated SVG."""

from __future__ import annotations

import functools
import itertools
import re
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from warpsplat.fit.export import export, shown_paths
from warpsplat.fit.settings import Settings
from warpsplat.motion import moving
from warpsplat.motion.films import Frame, ticks_of, zoom_of
from warpsplat.motion.painter import Painter
from warpsplat.motion.shown import picture, screen, size_of
from warpsplat.motion.timing import kept, showings
from warpsplat.rendering.backend import Backend
from warpsplat.run.result import Result
from warpsplat.scene import Canvas, Scene
from warpsplat.svg.numbers import hex_colors, number
from warpsplat.svg.write import GRIDS, MARK, write_svg


def pictures(
    scenes: Sequence[Scene],
    moments: Sequence[int],
    result: Result,
    path: Path,
    width: int | None,
    seconds: float,
    backend: Backend,
) -> Iterator[Frame]:
    """Yield frames of scenes at their moments, rendered on ``backend``; the last one is the file itself."""
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
    """Return the file without its sheet of paper."""
    canvas = result.scene.canvas
    if size_of(result.svg) == (canvas.width, canvas.height):
        return result.svg
    return page(result.scene, result, GRIDS[-1])


def page(scene: Scene, result: Result, per_pixel: float) -> str:
    """Return the SVG of a scene of the run, with ``per_pixel`` units of its view box a pixel."""
    return export(scene, Settings(renderer=result.renderer), per_pixel)


# An SVG.

MOST_KEYS = 20
"""Maximum number of scenes in an SVG."""

FEWEST_KEYS = 6

MOST_TEXT = 3 << 20
"""Maximum size of these scenes [bytes], unless that leaves fewer than ``FEWEST_KEYS``."""

UNITS = 1000
"""Minimum number of coordinate steps along the longer side while shapes move."""

FADE = 0.3
"""Time in which a file with a background fades in over the moving shapes [s]."""

STYLE = (
    ".m{{visibility:hidden;animation:m {end}s}}"
    ".e{{animation:e {fade}s {start}s backwards}}"
    "@keyframes m{{from,to{{visibility:visible}}}}"
    "@keyframes e{{from{{opacity:0}}}}"
    "@media(prefers-reduced-motion:reduce){{.m{{display:none}}.e{{animation:none}}}}"
)


def vector(scenes: Sequence[Scene], moments: Sequence[int], result: Result, seconds: float) -> str:
    """Return an SVG whose shapes move as they did in the run, and that ends as the file.

    It plays once, also in ``<img>``, without a script: shapes go their ways by SMIL, style sheets show
    them and then the file. Where nothing is animated, or readers ask for less motion, it is the file.
    """
    end = finished(result)
    head, inside = _parts(end)
    count = max(FEWEST_KEYS, min(MOST_KEYS, MOST_TEXT // max(1, len(end))))
    keys = kept(moments, count)
    settings, canvas = Settings(renderer=result.renderer), result.scene.canvas
    units = canvas.width * _coarse(canvas)
    shown = [shown_paths(scene, settings) for scene in scenes[: keys[-1] + 1]]
    box = float(VIEW_BOX.findall(head)[0].split()[2])
    height = number(units * canvas.height / canvas.width, 0)
    behind = ""
    if canvas.background is not None:
        fill = hex_colors(canvas.background[None])[0]
        behind = f'<rect width="{number(units, 0)}" height="{height}" fill="{fill}"/>\n'
    tick = seconds / max(1, len(keys) - 1)
    shapes, rules = moving.elements(shown, keys, tick, units, _still(units))
    fade = 0.0 if canvas.background is None else FADE  # what is translucent would be seen twice
    style = STYLE.format(start=number(seconds, 2), fade=number(fade, 2), end=number(seconds + fade, 2))
    group = f'<g class="m" transform="scale({box / units:.9g})">{behind}{shapes}</g>'
    return f'{head}{MARK}-->\n<style>{style}{rules}</style>\n{group}\n<g class="e">{inside}</g></svg>\n'


def _still(width: float) -> Callable[[Scene], str]:
    """What gives the markup of scenes on a canvas of ``width`` units; the same for the same ones."""
    names = itertools.count()

    @functools.cache
    def apart(markup: str) -> str:
        return _named(markup, f"p{next(names)}-")

    def still(scene: Scene) -> str:
        grid = _coarse(scene.canvas)
        markup = _parts(write_svg(scene, per_pixel=grid, background=False))[1]
        zoom = number(width / (scene.canvas.width * grid), 6)
        return f'<g transform="scale({zoom})">{apart(markup)}</g>'

    return still


VIEW_BOX = re.compile(r'viewBox="([^"]*)"')
ROOT = re.compile(r"<svg[^>]*>")
COMMENT = re.compile(r"^(\s*<!--warpsplat.*?-->)?\s*", re.DOTALL)


def _parts(text: str) -> tuple[str, str]:
    """Split a file written here into its start tag and its content."""
    found = ROOT.search(text)
    assert found
    inside = text[found.end() :].rpartition("</svg>")[0]
    return found[0], COMMENT.sub("", inside, count=1)


def _named(text: str, prefix: str) -> str:
    """Make the identifiers unique."""
    text = re.sub(r'\bid="', f'id="{prefix}', text)
    return re.sub(r'(url\(#|href="#)', rf"\g<1>{prefix}", text)


def _coarse(canvas: Canvas) -> float:
    """Return the units a pixel of moving shapes."""
    side = max(canvas.width, canvas.height)
    return next((units for units in GRIDS if units * side >= UNITS), GRIDS[-1])
