"""Reads the shapes of any SVG, and refuses by name what shapes of one colour each cannot hold.

Only what is understood in full is read: an element, property or unit that is not known here ends in an error,
because a picture that silently lost something is worse than none.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from xml.etree import ElementTree

import numpy as np

from warpsplat.errors import ImageError
from warpsplat.svg.geometry import Matrix, outline, parse_transform, winding
from warpsplat.svg.inspect import NAMESPACE, inspect_svg, svg_size, view_box
from warpsplat.svg.paths import Subpath, cubics
from warpsplat.svg.style import (
    INHERITED,
    Style,
    StyleSheet,
    element_style,
    fraction,
    inherit,
    length,
    parse_color,
)

MAX_EXTENT = 1e5
"""Farthest from the canvas's corner that a shape may reach [px]: beyond, float32 is too coarse."""


@dataclass(frozen=True)
class Shape:
    """One fill or stroke of one colour, in canvas units."""

    subpaths: list[Subpath]
    filled: bool
    color: tuple[float, float, float]
    """sRGB in 0..1."""
    opacity: float
    width: float
    """Of the stroke; 0 for a fill."""
    is_rect: bool
    """Whether it is a ``rect`` element with sharp corners."""


@dataclass(frozen=True)
class _Context:
    """What an element inherits."""

    style: Style
    matrix: Matrix
    size: tuple[float, float]
    """Of the view box: what percentages refer to."""


def read_shapes(text: str, width: int, height: int) -> list[Shape]:
    """The shapes of an SVG drawn ``width`` x ``height`` px large, in painter's order.

    Raises:
        ImageError: not an SVG, of other proportions, or with something that would be lost. The message says
            what.
    """
    facts = inspect_svg(text)
    try:
        root = ElementTree.fromstring(text)
        context = _Context(INHERITED, *_canvas(facts.root, width, height))
        sheet = StyleSheet(_css(root))
        with np.errstate(all="ignore"):  # what overflows is found where a shape's points are
            return _walk(root, context, sheet)
    except (ImageError, MemoryError):
        raise
    except Exception as error:  # arithmetic on absurd numbers overflows in many ways
        cause = (str(error).splitlines() or [""])[0][:100]
        raise ImageError(f"not an SVG that can be read: {cause or type(error).__name__}") from error


def _canvas(root: dict[str, str], width: int, height: int) -> tuple[Matrix, tuple[float, float]]:
    """Map of user units to canvas units, and the size of the view box."""
    size = svg_size(root)
    if size is None:
        raise ImageError("says neither its size nor a viewBox")
    if abs(size[0] / size[1] - width / height) > 0.02 * width / height:
        raise ImageError(f"{size[0]:g}x{size[1]:g} does not have the proportions of the image")
    scale = np.diag([width / size[0], height / size[1], 1.0])
    box = view_box(root)
    if box is None:
        return scale, size
    x, y, box_width, box_height = box
    fit = np.array([size[0] / box_width, size[1] / box_height])
    words = root.get("preserveAspectRatio", "xMidYMid").split()
    align = words[0] if words else "xMidYMid"
    shift = np.zeros(2)
    if align != "none":
        fit[:] = fit.max() if "slice" in words else fit.min()
        found = re.fullmatch(r"x(Min|Mid|Max)Y(Min|Mid|Max)", align)
        if not found:
            raise ImageError(f"preserveAspectRatio {align[:40]!r} is not known")
        part = np.array([{"Min": 0.0, "Mid": 0.5, "Max": 1.0}[word] for word in found.groups()])
        shift = part * (np.array(size) - fit * (box_width, box_height))
    view = np.diag([*fit, 1.0])
    with np.errstate(all="ignore"):  # what overflows is found where it is used
        view[:2, 2] = shift - fit * (x, y)
        if not np.isfinite(view).all():
            raise ImageError("its viewBox lies farther than can be drawn")
        return scale @ view, (box_width, box_height)


def _css(root: ElementTree.Element) -> str:
    return "\n".join("".join(e.itertext()) for e in root.iter(f"{{{NAMESPACE}}}style"))


CONTAINERS = {"svg", "g", "a"}
UNDRAWN = {
    *(
        "defs",
        "title",
        "desc",
        "metadata",
        "style",
        "script",
        "symbol",
        "clipPath",
        "mask",
        "filter",
        "marker",
    ),
    *("pattern", "linearGradient", "radialGradient", "cursor", "font", "font-face", "view", "color-profile"),
}
"""What shows nothing by itself; the properties and elements that refer to it are refused."""
SHAPES = {"path", "rect", "circle", "ellipse", "line", "polyline", "polygon"}


@dataclass(frozen=True)
class _End:
    """Where a translucent group ends: its opacity, and the number of its first shape."""

    opacity: float
    first: int


def _walk(root: ElementTree.Element, context: _Context, sheet: StyleSheet) -> list[Shape]:
    """All shapes. Not recursive: documents may be nested deeper than Python's stack."""
    shapes: list[Shape] = []
    todo: list[tuple[ElementTree.Element, _Context] | _End] = [(root, context)]
    while todo:
        item = todo.pop()
        if isinstance(item, _End):
            if len(shapes) > item.first + 1:
                raise ImageError("uses opacity of a group of several shapes, not supported")
            shapes[item.first :] = [
                replace(s, opacity=s.opacity * item.opacity) for s in shapes[item.first :]
            ]
            continue
        element, context = item
        space, _, tag = str(element.tag).rpartition("}")
        if space[1:] != NAMESPACE or tag in UNDRAWN:
            continue
        style = element_style(tag, element.attrib, sheet, context.style)
        if style["display"] == "none":
            continue
        if tag not in SHAPES and (tag not in CONTAINERS or (tag == "svg" and element is not root)):
            raise ImageError(f"uses <{tag[:40]}>{' inside another' if tag == 'svg' else ''}, not supported")
        if any(name in element.attrib for name in CONDITIONS):
            raise ImageError("uses conditions on language or features, not supported")
        matrix = context.matrix @ parse_transform(style["transform"])
        inner = _Context(inherit(style), matrix, context.size)
        if tag in CONTAINERS:
            opacity = fraction(style, "opacity")
            if opacity < 1:
                todo.append(_End(opacity, len(shapes)))
            todo.extend((child, inner) for child in reversed(element))
        else:
            shapes += _shape(element, tag, style, inner)
    return shapes


CONDITIONS = ("systemLanguage", "requiredFeatures", "requiredExtensions")


def _shape(element: ElementTree.Element, tag: str, style: Style, context: _Context) -> list[Shape]:
    """The shape that an element draws, in a list; empty if it draws nothing.

    Raises:
        ImageError: fill and stroke, or a style that a fill or a round stroke cannot show.
    """
    if any(child.tag in ANIMATIONS for child in element):
        raise ImageError("uses animation, not supported")
    diagonal = float(np.hypot(*context.size)) / 2**0.5
    width = length(style["stroke-width"], diagonal, "stroke-width") if style["stroke"] != "none" else 0.0
    if style["visibility"] in {"hidden", "collapse"}:
        return []
    if style["visibility"] != "visible":
        raise ImageError(f"visibility {style['visibility'][:40]!r} is not known")
    filled = style["fill"] != "none" and tag != "line"
    if not (filled or width > 0):
        return []
    data, is_rect = outline(tag, element.attrib, context.size)
    scale = _similarity(context.matrix)
    subpaths = [
        subpath.moved(context.matrix[:2, :2], context.matrix[:2, 2])
        for subpath in cubics(data, keep_dots=not filled)
    ]
    if not subpaths:
        return []
    if filled and width > 0:
        raise ImageError("a shape with both fill and stroke is not supported")
    _check_properties(style, filled, tag)
    if not filled:
        _check_stroke(style, subpaths, scale)
        width *= scale or 1.0
    reach = max(width, *(float(np.abs(subpath.points).max()) for subpath in subpaths))
    if not (reach <= MAX_EXTENT and all(np.isfinite(subpath.points).all() for subpath in subpaths)):
        raise ImageError(f"a shape reaches farther than {MAX_EXTENT:g} px from the picture")
    paint = "fill" if filled else "stroke"
    color, alpha = parse_color(style["color"] if style[paint].lower() == "currentcolor" else style[paint])
    opacity = alpha * fraction(style, f"{paint}-opacity") * fraction(style, "opacity")
    if filled and style["fill-rule"] == "evenodd":
        around = winding([subpath.points for subpath in subpaths])
        if ((around % 2 == 0) & (around != 0)).any():
            raise ImageError("uses the even-odd fill rule where it matters, not supported")
    if not filled and opacity < 1 and len(subpaths) > 1:
        raise ImageError("a translucent stroke of several subpaths is not supported")
    return [Shape(subpaths, filled, color, opacity, width, is_rect)]


ANIMATIONS = {f"{{{NAMESPACE}}}{tag}" for tag in ("animate", "animateTransform", "animateMotion", "set")}


def _check_properties(style: Style, filled: bool, tag: str) -> None:
    if tag in {"path", "line", "polyline", "polygon"}:
        for name in ("marker", "marker-start", "marker-mid", "marker-end"):
            if style[name] != "none":
                raise ImageError("uses markers, not supported")
    if style["shape-rendering"] not in {"auto", "geometricPrecision"}:
        raise ImageError(f"uses shape-rendering {style['shape-rendering'][:40]!r}, not supported")
    if filled and style["fill-rule"] not in {"nonzero", "evenodd"}:
        raise ImageError(f"fill-rule {style['fill-rule'][:40]!r} is not known")


def _check_stroke(style: Style, subpaths: list[Subpath], scale: float | None) -> None:
    """Strokes written here have round caps and joins, no dashes, and one width.

    Raises:
        ImageError: this one is another.
    """
    if style["stroke-dasharray"] != "none":
        raise ImageError("uses dashes, not supported")
    if style["vector-effect"] != "none":
        raise ImageError("uses vector-effect, not supported")
    if scale is None:
        raise ImageError("a stroke that a transform stretches is not supported")
    for points, is_closed, _ in subpaths:
        if not is_closed and style["stroke-linecap"] != "round":
            raise ImageError(
                f"a stroke with {style['stroke-linecap'][:40]} caps is not supported, only round ones"
            )
        if (is_closed or len(points) > 4) and style["stroke-linejoin"] != "round":
            raise ImageError(
                f"a stroke with {style['stroke-linejoin'][:40]} joins is not supported, only round ones"
            )


def _similarity(matrix: Matrix) -> float | None:
    """By how much a map scales; None if not alike in all directions (to a hundredth)."""
    sizes = np.linalg.svd(np.nan_to_num(matrix[:2, :2]), compute_uv=False)
    return float(sizes.mean()) if sizes[1] >= 0.99 * sizes[0] else None
