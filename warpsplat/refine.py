"""Any SVG of filled or of stroked paths -> scene, to be improved against an image.

A path with holes becomes one outline: its subpaths are joined by bridges that run there and back, so that the
area is the same. Paths of different length are padded to one length by cubics without extent.
"""

from __future__ import annotations

import io
import math
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import svgelements as se
import warp as wp

from warpsplat.config import Density, Settings
from warpsplat.errors import ImageError
from warpsplat.metrics import score_svg
from warpsplat.pipeline import Result, vectorize
from warpsplat.scene import FloatArray, Kind, Scene
from warpsplat.svg import write_svg
from warpsplat.viewer import render_svg

MAX_POINTS = 60_000
"""Most control points of one path; beyond, the padding of the others would fill the memory."""


UNSUPPORTED = re.compile(
    r"(clip-path|mask|filter)\s*[=:]\s*[\"']?\s*url\(|(?:fill|stroke)\s*[=:]\s*[\"']?\s*(url)\(|<(image|text|use)\b"
)
"""What the picture would lose without a word."""


def _opacity(values: Any, name: str) -> float:
    """An opacity attribute: a number or a percentage.

    Raises:
        ImageError: neither.
    """
    text = str(values.get(name, 1)).strip()
    try:
        number = float(text.removesuffix("%")) / (100 if text.endswith("%") else 1)
    except ValueError:
        raise ImageError(f"{name} {text!r} is not a number") from None
    return min(max(number, 0.0), 1.0)


def _cubics(path: Any) -> list[list[np.ndarray]]:
    """Subpaths of an svgelements path, each as points p0, c, c, p3, c, c, p6 ..."""
    path.approximate_arcs_with_cubics()
    subpaths: list[list[np.ndarray]] = []

    def at(point: Any) -> np.ndarray:
        return np.array([point.x, point.y], np.float64)

    for segment in path:
        if isinstance(segment, se.Move):
            subpaths.append([at(segment.end)])
            continue
        p0, p3 = at(segment.start), at(segment.end)
        if isinstance(segment, se.CubicBezier):
            inner = [at(segment.control1), at(segment.control2)]
        elif isinstance(segment, se.QuadraticBezier):
            control = at(segment.control)
            inner = [p0 + 2 / 3 * (control - p0), p3 + 2 / 3 * (control - p3)]
        else:  # lines, and the line that closes a subpath
            inner = [p0 + (p3 - p0) / 3, p0 + 2 / 3 * (p3 - p0)]
            if isinstance(segment, se.Close) and np.allclose(p0, p3):
                continue
        subpaths[-1] += [*inner, p3]
    return [s for s in subpaths if len(s) > 1]


def _line(a: np.ndarray, b: np.ndarray) -> list[np.ndarray]:
    return [a + (b - a) / 3, a + 2 / 3 * (b - a), b]


def _ring(subpaths: list[list[np.ndarray]]) -> np.ndarray:
    """One closed ring of cubics around all subpaths, without the repeated end."""
    start = subpaths[0][0]
    ring: list[np.ndarray] = [start]
    for number, subpath in enumerate(subpaths):
        if number:
            ring += _line(ring[-1], subpath[0])
        ring += subpath[1:]
        if not np.allclose(subpath[-1], subpath[0]):
            ring += _line(subpath[-1], subpath[0])
        if number:
            ring += _line(ring[-1], start)
    return np.array(ring[:-1])


def _pad(points: np.ndarray, count: int) -> np.ndarray:
    """Repeat the last on-curve point (of a ring: the first) until there are ``count`` points."""
    last = points[0] if len(points) % 3 == 0 else points[-1]
    return np.concatenate([points, np.repeat(last[None], count - len(points), axis=0)])


def _without_padding(scene: Scene, start: Scene) -> Scene:
    """``scene`` with the cubics that padded ``start`` drawn together to a point: the file leaves them out."""
    points = scene.points.copy()
    for i, before in enumerate(start.points):
        moved = np.flatnonzero((before != before[-1]).any(axis=1))
        first = int(moved[-1]) + 1 if len(moved) else 0
        points[i, first + 1 :] = points[i, first]
    return replace(scene, points=points)


def load_scene(text: str, width: int, height: int, name: str) -> Scene:
    """Read an SVG's paths (and basic shapes) as a scene of ``width`` x ``height`` canvas units.

    Raises:
        ImageError: not an SVG, nothing drawn, fills and strokes mixed, or a fill that is no colour.
    """
    try:
        render_svg(text, width=8)
        document = se.SVG.parse(io.StringIO(text), reify=True, width=width, height=height)
        found = UNSUPPORTED.search(text)
        if found:
            what = next(group for group in found.groups() if group)
            raise ImageError(f"uses {'a gradient or pattern' if what == 'url' else what}, not supported")
    except ImageError as error:
        raise ImageError(f"{name}: {error}") from error
    except Exception as error:  # the parser raises what its helpers raise
        raise ImageError(f"{name}: not an SVG that can be read: {error}") from error
    own_width, own_height = float(document.width), float(document.height)
    box = document.viewbox
    if box is not None and box.width and box.height:
        own_width, own_height = float(box.width), float(box.height)
    if abs(own_width / own_height - width / height) > 0.02 * width / height:
        raise ImageError(f"{name}: {own_width:g}x{own_height:g} does not have the proportions of the image")
    background = np.ones(3)
    shapes: list[tuple[np.ndarray, np.ndarray, float, float]] = []
    kinds: set[Kind] = set()
    for element in document.elements():
        if not isinstance(element, se.Shape) or isinstance(element, se.SVG):
            continue
        path = abs(se.Path(element))
        filled = element.fill is not None and element.fill.value is not None
        stroked = element.stroke is not None and element.stroke.value is not None
        if not (filled or stroked) or element.values.get("visibility") == "hidden":
            continue
        if filled and stroked:
            raise ImageError(f"{name}: a shape with both fill and stroke is not supported")
        paint = element.fill if filled else element.stroke
        color = np.array([paint.red, paint.green, paint.blue]) / 255
        key = "fill-opacity" if filled else "stroke-opacity"
        try:
            opacity = paint.opacity * _opacity(element.values, "opacity")
            if paint.opacity == 1:
                opacity *= _opacity(element.values, key)
        except ImageError as error:
            raise ImageError(f"{name}: {error}") from error
        if filled and isinstance(element, se.Rect) and not shapes and opacity == 1:
            x0, y0, x1, y1 = path.bbox()
            if x0 <= 0.5 and y0 <= 0.5 and x1 >= width - 0.5 and y1 >= height - 0.5:
                background = color
                continue
        subpaths = _cubics(path)
        if not subpaths:
            continue
        kinds.add("closed" if filled else "open")
        if filled:
            shapes.append((_ring(subpaths), color, opacity, 0.0))
        else:
            line = float(element.stroke_width or 1)
            shapes += [(np.array(s), color, opacity, line) for s in subpaths]
    if not shapes:
        raise ImageError(f"{name}: draws no filled or stroked path")
    if len(kinds) > 1:
        raise ImageError(f"{name}: has both fills and strokes; only one of them can be refined at a time")
    kind = kinds.pop()
    longest = max(len(points) for points, *_ in shapes)
    if longest > MAX_POINTS:
        raise ImageError(f"{name}: a path has {longest} points, more than {MAX_POINTS}")
    count = 6 * math.ceil(longest / 6) if kind == "closed" else longest
    return Scene(
        kind=kind,
        width=width,
        height=height,
        points=np.stack([_pad(points, count) for points, *_ in shapes]).astype(np.float32),
        colors=np.array([color for _, color, *_ in shapes], np.float32),
        opacities=np.array([[opacity] for _, _, opacity, _ in shapes], np.float32),
        widths=np.array([line for *_, line in shapes], np.float32),
        background=background.astype(np.float32),
    )


def refine(
    text: str, target: FloatArray, settings: Settings, device: wp.Device, *, name: str, **options: Any
) -> tuple[Result, float]:
    """Improve the SVG ``text`` against ``target``; its shapes stay, none is added or removed.

    ``options`` are those of ``vectorize``.

    Returns:
        the result, and the PSNR of ``text`` itself [dB]. A result that is no better is ``text`` unchanged.
    """
    height, width = target.shape[:2]
    scene = load_scene(text, width, height, name)
    try:
        before = score_svg(text, target)
    except ImageError as error:
        raise ImageError(f"{name}: {error}") from error
    settings = replace(
        settings,
        kind=scene.kind,
        curves=min(len(scene), 100_000),
        coarse=0.0,
        density=Density(interval=0),
        rates=replace(settings.rates, points=REFINE_RATE),
        renderer="exact",
    )
    result = vectorize(target, settings, device, scene=scene, **options)
    trimmed = _without_padding(result.scene, scene)
    svg = write_svg(trimmed, precision=settings.precision)
    score = score_svg(svg, target)
    result = replace(result, svg=svg, scene=trimmed, score=score)
    if score.psnr <= before.psnr:
        result = replace(result, svg=text, scene=scene, score=before)
    return result, before.psnr


REFINE_RATE = 0.5
"""Learning rate of points [px]: the shapes are nearly where they should be."""


def read_pair(svg: Path, image: Path) -> tuple[str, FloatArray]:
    """Text of the SVG and pixels of the image."""
    from warpsplat.image import load_image
    from warpsplat.inspect_svg import read_svg_text

    return read_svg_text(svg), load_image(image)
