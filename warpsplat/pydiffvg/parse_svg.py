"""Any SVG of paths -> shapes and groups.

Read by the program's own reader: transforms are applied to the points, styles and style sheets are resolved,
basic shapes are paths. What it cannot show is refused by name.
"""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path as FilePath
from xml.etree import ElementTree

import numpy as np
import torch

from warpsplat.errors import ImageError
from warpsplat.pydiffvg.color import Color, LinearGradient, RadialGradient
from warpsplat.pydiffvg.shape import Path, Shape, ShapeGroup, path_of
from warpsplat.scene import Cap, Join, Rule
from warpsplat.svg.gradients import FlatColor, Gradient
from warpsplat.svg.inspect import inspect_svg, read_svg_text, svg_size, view_box
from warpsplat.svg.shapes import LineStyle
from warpsplat.svg.shapes import Shape as Drawn
from warpsplat.svg.structure import read_shapes

Tensor = torch.Tensor

Scene = tuple[int, int, list[Shape], list[ShapeGroup]]
"""Width and height of the canvas, shapes, and groups of them."""


def svg_to_scene(filename: str | FilePath) -> Scene:
    """Canvas width and height, shapes and groups of an SVG file; the canvas is the ``viewBox``.

    Raises:
        ImageError: no SVG, or something in it that shapes and groups cannot hold.
    """
    path = FilePath(filename)
    text = read_svg_text(path)
    try:
        return _scene_of(text)
    except ImageError as error:
        raise ImageError(f"{path}: {error}") from error


def parse_scene(node: ElementTree.Element) -> Scene:
    """The same of the root element of a document, as ``ElementTree.fromstring`` gives it.

    Raises:
        ImageError: see ``svg_to_scene``.
    """
    return _scene_of(ElementTree.tostring(node, encoding="unicode"))


def _scene_of(text: str) -> Scene:
    width, height, scale = _canvas(text)
    drawn = read_shapes(text, width, height, scale, see_through=True)
    shapes: list[Shape] = []
    groups: list[ShapeGroup] = []
    for one in _groups(drawn):
        paths, group = _group(one, len(shapes))
        shapes += paths
        groups.append(group)
    return width, height, shapes, groups


def _canvas(text: str) -> tuple[int, int, float]:
    """Width and height, whole units of the ``viewBox`` as in DiffVG, and how many of them a pixel has."""
    root = inspect_svg(text).root
    box, size = view_box(root), svg_size(root)
    if size is None:
        raise ImageError("says no size: neither viewBox nor width and height")
    units = box[2:] if box else size
    return max(1, int(units[0])), max(1, int(units[1])), units[0] / size[0]


def _groups(drawn: list[Drawn]) -> list[tuple[Drawn, ...]]:
    """What is one group: a fill, a stroke, or a fill and its stroke above it."""
    together = [b.is_twin and a.line is None for a, b in pairwise(drawn)]
    return [
        (one, drawn[i + 1]) if i < len(together) and together[i] else (one,)
        for i, one in enumerate(drawn)
        if not (i and together[i - 1])
    ]


def _group(parts: tuple[Drawn, ...], first: int) -> tuple[list[Path], ShapeGroup]:
    fill = next((part for part in parts if part.line is None), None)
    stroke = next((part for part in parts if part.line is not None), None)
    name = parts[0].element.get("id", "") if parts[0].element is not None else ""
    subpaths = parts[0].subpaths
    paths = [path_of(subpath, is_closed=subpath.is_closed or stroke is None) for subpath in subpaths]
    line = stroke.line if stroke else None
    width = torch.tensor(line.width / 2 if line else 0.5)
    for number, path in enumerate(paths):
        path.stroke_width = width
        path.id = f"{name}-{number}" if len(paths) > 1 else name
    group = ShapeGroup(
        torch.arange(first, first + len(paths)),
        _color(fill) if fill else None,
        parts[0].rule == Rule.EVENODD,
        _color(stroke) if stroke else None,
        id=name,
        line=line if line and not _is_plain(line) else None,
    )
    return paths, group


def _is_plain(line: LineStyle) -> bool:
    return line.cap == Cap.ROUND and line.join == Join.ROUND and not line.dashes


def _color(part: Drawn) -> Color:
    """A fill's or stroke's paint.

    Raises:
        ImageError: none that pydiffvg has.
    """
    paint = part.paint
    if isinstance(paint, FlatColor):
        return torch.tensor([*paint.color, part.opacity * paint.opacity])
    if not isinstance(paint, Gradient):
        raise ImageError("shows a picture, which no paint of pydiffvg is")
    return gradient_of(paint, part.opacity)


def gradient_of(paint: Gradient, opacity: float) -> LinearGradient | RadialGradient:
    """A gradient as pydiffvg has it, whose stops are ``opacity`` times as opaque.

    Raises:
        ImageError: it cannot say it.
    """
    if paint.spread != "pad":
        raise ImageError(f"uses a gradient with spreadMethod {paint.spread}, which pydiffvg has not")
    offsets = torch.tensor(paint.offsets)
    colors = torch.tensor([[*stop.color, stop.opacity * opacity] for stop in paint.stops])
    origin, along, across = (paint.frame[:2, column] for column in (2, 0, 1))
    if not paint.is_radial:
        # Lines of one colour run along the second axis: what counts of the first is what is at right angles.
        side = np.array([-across[1], across[0]]) / np.hypot(*across)
        return LinearGradient(_tensor(origin), _tensor(origin + (along @ side) * side), offsets, colors)
    axes = np.stack([along, across], axis=1)
    spans = axes @ axes.T  # the ellipse: that of any axes turned within their own space
    if any(paint.focus) or abs(spans[0, 1]) > 1e-3 * np.trace(spans):
        raise ImageError("uses a radial gradient with a focus or slanted axes, which pydiffvg has not")
    return RadialGradient(_tensor(origin), _tensor(np.sqrt(np.diag(spans))), offsets, colors)


def _tensor(values: np.ndarray) -> Tensor:
    return torch.tensor(values, dtype=torch.float32)
