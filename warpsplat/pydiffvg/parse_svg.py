"""Any SVG of paths -> shapes and groups.

Our own reader applies transforms to the points, resolves styles and style sheets and turns basic shapes into
paths. What it cannot show it names in an error.
"""

from __future__ import annotations

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
from warpsplat.svg.shapes import Shape as Drawn
from warpsplat.svg.structure import read_shapes

Tensor = torch.Tensor

Scene = tuple[int, int, list[Shape], list[ShapeGroup]]
"""Width and height of the canvas [canvas units], shapes, and groups of them."""


def svg_to_scene(filename: str | FilePath) -> Scene:
    """Return the scene of an SVG file; the canvas is its ``viewBox``.

    Raises:
        ImageError: not an SVG, or with something that shapes and groups cannot hold.
    """
    path = FilePath(filename)
    text = read_svg_text(path)
    try:
        return _read(text)
    except ImageError as error:
        raise ImageError(f"{path}: {error}") from error


def parse_scene(node: ElementTree.Element) -> Scene:
    """Return the scene of a document's root element; see ``svg_to_scene``."""
    return _read(ElementTree.tostring(node, encoding="unicode"))


def root_and_size(text: str) -> tuple[dict[str, str], tuple[float, float]]:
    """Return the attributes of an SVG's root, and its width and height [px]."""
    root = inspect_svg(text).root
    size = svg_size(root)
    if size is None:
        raise ImageError("says no size: neither viewBox nor width and height")
    return root, size


def _read(text: str) -> Scene:
    root, size = root_and_size(text)
    box = view_box(root)
    units = box[2:] if box else size
    width, height = (max(1, int(side)) for side in units)  # whole units, as in DiffVG
    pairs: list[list[Drawn]] = []
    for part in read_shapes(text, units[0] / size[0], see_through=True):
        if part.is_twin and pairs[-1][-1].line is None:
            pairs[-1].append(part)
        else:
            pairs.append([part])
    shapes: list[Shape] = []
    groups: list[ShapeGroup] = []
    for parts in pairs:
        paths, group = _group(parts, len(shapes))
        shapes += paths
        groups.append(group)
    return width, height, shapes, groups


def _group(parts: list[Drawn], first: int) -> tuple[list[Path], ShapeGroup]:
    """Return the paths and the group of a fill, a stroke, or a fill and its stroke above it.

    ``first``: index of the first path among all shapes.
    """
    fill = next((part for part in parts if part.line is None), None)
    stroke = next((part for part in parts if part.line is not None), None)
    name = parts[0].element.get("id", "") if parts[0].element is not None else ""
    subpaths = parts[0].subpaths
    paths = [path_of(subpath, is_closed=subpath.is_closed or stroke is None) for subpath in subpaths]
    line = stroke.line if stroke else None
    is_plain = not line or (line.cap == Cap.ROUND and line.join == Join.ROUND and not line.dashes)
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
        line=None if is_plain else line,
    )
    return paths, group


def _color(part: Drawn) -> Color:
    """Return the paint of a fill or stroke."""
    paint = part.paint
    if isinstance(paint, FlatColor):
        return torch.tensor([*paint.color, part.opacity * paint.opacity])
    if not isinstance(paint, Gradient):
        raise ImageError("shows a picture, which pydiffvg cannot paint with")
    return gradient_of(paint, part.opacity)


def gradient_of(paint: Gradient, opacity: float) -> LinearGradient | RadialGradient:
    """Return a gradient as pydiffvg's, its stops' opacities multiplied by ``opacity``.

    An ``ImageError`` names what pydiffvg's gradients do not have.
    """
    if paint.spread != "pad":
        raise ImageError(f"uses a gradient with spreadMethod {paint.spread}, not supported by pydiffvg")
    offsets = torch.tensor(paint.offsets)
    colors = torch.tensor([[*stop.color, stop.opacity * opacity] for stop in paint.stops])
    origin, along, across = (paint.frame[:2, column] for column in (2, 0, 1))
    if not paint.is_radial:
        # Lines of one colour run along the second axis: only the first one's part at right angles counts.
        side = np.array([-across[1], across[0]]) / np.hypot(*across)
        return LinearGradient(_tensor(origin), _tensor(origin + (along @ side) * side), offsets, colors)
    axes = np.stack([along, across], axis=1)
    spans = axes @ axes.T  # the ellipse, whichever way the axes are rotated in their own space
    if any(paint.focus) or abs(spans[0, 1]) > 1e-3 * np.trace(spans):
        raise ImageError("uses a radial gradient with a focus or slanted axes, not supported by pydiffvg")
    return RadialGradient(_tensor(origin), _tensor(np.sqrt(np.diag(spans))), offsets, colors)


def _tensor(values: np.ndarray) -> Tensor:
    return torch.tensor(values, dtype=torch.float32)
