"""Animations of the training: the scenes of a run as frames, or as an SVG whose shapes move."""

from __future__ import annotations

import functools
import itertools
import re
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from PIL import Image

from warpsplat.errors import CapacityError
from warpsplat.fit.export import export, shown_paths
from warpsplat.fit.settings import Settings
from warpsplat.motion.films import Frame, Size, frame_count, rasterised, zoom_and_size
from warpsplat.motion.moving import moving_elements
from warpsplat.motion.timing import kept, showings
from warpsplat.rendering.backend import Backend, Viewport
from warpsplat.rendering.parameters import Parameters
from warpsplat.rendering.renderer import Capacity, Renderer
from warpsplat.run.render import to_pillow
from warpsplat.run.result import Result
from warpsplat.run.svg import size_of
from warpsplat.scene import Canvas, Scene
from warpsplat.svg.numbers import hex_colors, number
from warpsplat.svg.write import GRIDS, MARK, resized, write_svg


def film(
    scenes: Sequence[Scene],
    moments: Sequence[int],
    result: Result,
    path: Path,
    width: int | None,
    seconds: float,
    backend: Backend,
) -> Iterator[Frame]:
    """Yield the frames of a film; the last one is the file as a viewer shows it.

    ``moments``: when the scenes were recorded, see ``showings``; ``width``: see ``zoom_of``.
    """
    end = _final_svg(result)
    zoom, size = zoom_and_size(end, path, width)
    painter = Painter(backend, Settings(renderer=result.renderer), size)
    for index, shown in showings(moments, frame_count(path, size, seconds), seconds).items():
        scene = scenes[index]
        scale = zoom * result.scene.canvas.width / scene.canvas.width  # runs may be on reduced images
        yield painter.paint(scene, scale), shown
    yield rasterised(end, size, zoom), 0.0


def _final_svg(result: Result) -> str:
    """Return the file or, if it is a sheet of paper, the picture on it."""
    canvas = result.scene.canvas
    if size_of(result.svg, "the SVG") == (canvas.width, canvas.height):
        return result.svg
    return export(result.scene, Settings(renderer=result.renderer), GRIDS[-1])


class Painter:
    """Draws scenes as their files look, by warpsplat's renderer, which is seven times as fast as a viewer.

    Each scene's capacity is the guess for the next.
    """

    def __init__(self, backend: Backend, settings: Settings, size: Size) -> None:
        """``settings``: of the run; ``size``: of the frames [px]."""
        self._backend, self._settings, self._size = backend, settings, size
        self._capacity: Capacity | None = None

    def paint(self, scene: Scene, scale: float) -> Image.Image:
        """Return a scene with ``scale`` px per canvas unit, cropped to the size; RGBA if not opaque."""
        if len(scene) and not scene.pictures:
            try:
                return self._rendered(scene, scale)
            except CapacityError:
                pass
        text = export(scene, self._settings, GRIDS[-1])
        if scene.pictures:  # content of other files
            return rasterised(text, self._size, scale)
        return rasterised(resized(text, *self._size, scale), self._size)

    def _rendered(self, scene: Scene, scale: float) -> Image.Image:
        parameters = Parameters(shown_paths(scene, self._settings), self._backend)
        renderer = Renderer(parameters, Viewport(*self._size, scale), capacity=self._capacity)
        renderer.forward_complete()
        self._capacity = renderer.capacity
        return to_pillow(renderer.read_image())


# An SVG.

MAX_KEYFRAMES, MIN_KEYFRAMES = 20, 6

MAX_BYTES = 3 << 20
"""Total of all keyframes, as long as that allows ``MIN_KEYFRAMES``."""

FADE = 0.3
"""Time in which the file, if it has a background, fades in over the moving shapes [s]."""

STYLE = (
    ".m{{visibility:hidden;animation:m {end}s}}"
    ".e{{animation:e {fade}s {start}s backwards}}"
    "@keyframes m{{from,to{{visibility:visible}}}}"
    "@keyframes e{{from{{opacity:0}}}}"
    "@media(prefers-reduced-motion:reduce){{.m{{display:none}}.e{{animation:none}}}}"
)


def animated_svg(scenes: Sequence[Scene], moments: Sequence[int], result: Result, seconds: float) -> str:
    """Return an SVG whose shapes move as they did in the run, and which then shows the file.

    It plays once, also in ``<img>``, without scripts: SMIL moves the shapes, style sheets show them and then
    the file. Where nothing is animated, or readers prefer less motion, it shows the file.
    """
    end = _final_svg(result)
    head, content = _parts(end)
    keys = kept(moments, max(MIN_KEYFRAMES, min(MAX_KEYFRAMES, MAX_BYTES // max(1, len(end)))))
    settings, canvas = Settings(renderer=result.renderer), result.scene.canvas
    units = canvas.width * _coarse_grid(canvas)
    background, fade = "", 0.0  # translucent shapes would be seen twice during a fade
    if canvas.background is not None:
        fade, height = FADE, number(units * canvas.height / canvas.width, 0)
        fill = hex_colors(canvas.background[None])[0]
        background = f'<rect width="{number(units, 0)}" height="{height}" fill="{fill}"/>\n'
    shown = [shown_paths(scene, settings) for scene in scenes[: keys[-1] + 1]]
    tick = seconds / max(1, len(keys) - 1)
    shapes, rules = moving_elements(shown, keys, tick, units, _static_markup(units))
    style = STYLE.format(start=number(seconds, 2), fade=number(fade, 2), end=number(seconds + fade, 2))
    view_box = re.search(r'viewBox="([^"]*)"', head)
    assert view_box
    scale = float(view_box[1].split()[2]) / units
    group = f'<g class="m" transform="scale({scale:.9g})">{background}{shapes}</g>'
    return f'{head}{MARK}-->\n<style>{style}{rules}</style>\n{group}\n<g class="e">{content}</g></svg>\n'


def _static_markup(width: float) -> Callable[[Scene], str]:
    """Return a function from scenes to markup in ``width`` units; equal scenes give the same markup."""
    count = itertools.count()

    @functools.cache
    def with_own_ids(markup: str) -> str:
        prefix = f"p{next(count)}-"
        return re.sub(r'(\bid="|url\(#|href="#)', rf"\g<1>{prefix}", markup)

    def markup_of(scene: Scene) -> str:
        grid = _coarse_grid(scene.canvas)
        markup = _parts(write_svg(scene, per_pixel=grid, background=False))[1]
        zoom = number(width / (scene.canvas.width * grid), 6)
        return f'<g transform="scale({zoom})">{with_own_ids(markup)}</g>'

    return markup_of


COMMENT = re.compile(r"^(\s*<!--warpsplat.*?-->)?\s*", re.DOTALL)


def _parts(text: str) -> tuple[str, str]:
    """Return the start tag and the content of a file written by warpsplat."""
    found = re.search(r"<svg[^>]*>", text)
    assert found
    content = text[found.end() :].rpartition("</svg>")[0]
    return found[0], COMMENT.sub("", content, count=1)


def _coarse_grid(canvas: Canvas) -> float:
    """Return units per pixel for moving shapes."""
    side = max(canvas.width, canvas.height)
    min_units = 1000  # coordinate units along the longer side; moving shapes are seen only briefly
    return next((units for units in GRIDS if units * side >= min_units), GRIDS[-1])
