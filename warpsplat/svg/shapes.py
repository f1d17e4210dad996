"""The fills and strokes of an SVG element.

Elements, properties and units that are not supported in full are errors: a picture that silently lost
something is worse than none.
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass, field, replace

import numpy as np

from warpsplat.errors import ImageError
from warpsplat.portable.linear import determinant
from warpsplat.scene import Cap, Join, KeptPicture, Rule
from warpsplat.svg.css import ANIMATED
from warpsplat.svg.document import Document, Element, Style, name_of
from warpsplat.svg.geometry import Matrix, outline, similarity, tight_box
from warpsplat.svg.gradients import Colouring, FlatColor, resolve_paint
from warpsplat.svg.inspect import NUMBER
from warpsplat.svg.paths import Points, Subpath, cubics
from warpsplat.svg.values import SvgViewport, fraction, length, lengths, parse_color


@dataclass(frozen=True)
class LineStyle:
    """Geometry of a stroke, in canvas units."""

    width: float
    cap: Cap
    join: Join
    miter_limit: float
    dashes: tuple[float, ...]
    """Offset into the pattern, then dashes and gaps in turn; empty: none."""

    @property
    def reach(self) -> float:
        """Return its largest distance from its path."""
        longest = self.miter_limit if self.join == Join.MITER else 1.0
        return 0.5 * self.width * max(longest, math.sqrt(2) if self.cap == Cap.SQUARE else 1.0)


@dataclass(frozen=True)
class Shape:
    """One fill or stroke, in canvas units."""

    subpaths: list[Subpath]
    paint: Colouring | KeptPicture
    opacity: float
    """A factor on the paint's opacity."""
    line: LineStyle | None
    """None: a fill."""
    rule: Rule = Rule.NONZERO
    is_twin: bool = False
    """Whether it shares its subpaths with the shape before: a path that is filled and stroked."""
    is_rect: bool = False
    """Whether it is a ``rect`` element with sharp corners."""
    level: str = ""
    """Name of its level in a layered file."""
    element: Element | None = None
    """The element that draws it, if that can be kept in its place."""
    tag: str = ""
    """Name of that element."""

    known_box: list[Points] = field(default_factory=list, repr=False, compare=False)
    """Cache of ``box``, shared by copies with the same outline."""

    def box(self) -> Points:
        """Return the least and the largest coordinates, shape (2, 2)."""
        if not self.known_box:
            reach = self.line.reach if self.line else 0.0
            self.known_box.append(tight_box(self.subpaths) + np.array([[-reach], [reach]]))
        return self.known_box[0]


@dataclass(frozen=True)
class Placement:
    """The style and coordinates that an element is drawn with."""

    style: Style
    matrix: Matrix
    """Map of its units to canvas units."""
    viewport: SvgViewport
    paints: tuple[str, str]
    """The values of ``context-fill`` and ``context-stroke``."""
    path: tuple[Element, ...]
    """The links that show it."""
    outlines: bool
    """Whether what changes the look of edges only is accepted, see ``structure.read_shapes``."""


def element_shapes(element: Element, document: Document, place: Placement) -> list[Shape]:
    """Return the shapes that an element draws, in painter's order.

    Raises:
        ImageError: The element has a style that fills and strokes cannot show.
    """
    style, tag = place.style, name_of(element)
    if any(name_of(child) in ANIMATIONS for child in element):
        raise ImageError(ANIMATED)
    if style["visibility"] in {"hidden", "collapse"}:
        return []
    if style["visibility"] != "visible":
        raise ImageError(f"visibility {style['visibility'][:40]!r} is not known")
    line = _line(place) if style["stroke"] != "none" else None
    keeps_dots = line is not None and line.cap != Cap.BUTT
    if tag == "path" and place.path:  # others may show it as well
        own = document.once(_cubics_with_dots if keeps_dots else _cubics, element)
    else:
        own = cubics(outline(tag, element.attrib, place.viewport), keep_dots=keeps_dots)
    if not own:
        return []
    fill = _paint("fill", document, place, own) if tag != "line" else None
    stroke = _paint("stroke", document, place, own) if line else None
    subpaths = [subpath.moved(place.matrix[:2, :2], place.matrix[:2, 2]) for subpath in own]
    _check(place, subpaths, line if stroke else None)
    shapes = []
    if fill:
        rule = Rule.EVENODD if style["fill-rule"] == "evenodd" else Rule.NONZERO
        upright = tag == "rect" and len(own[0].points) == 13
        shapes.append(
            Shape(subpaths, fill, fraction(style["fill-opacity"]), None, rule, is_rect=upright, tag=tag)
        )
    if stroke and line:
        if similarity(place.matrix) is None and not place.outlines:
            raise ImageError("a stroke that a transform stretches is not supported")
        shapes.append(Shape(subpaths, stroke, fraction(style["stroke-opacity"]), line, tag=tag))
    if len(shapes) == 2:
        if _strokes_first(style["paint-order"]):
            shapes.reverse()
        shapes[1] = replace(shapes[1], is_twin=True)
    return shapes


def _cubics(path: Element, _: Document, keep_dots: bool = False) -> list[Subpath]:
    return cubics(path.get("d", ""), keep_dots=keep_dots)


_cubics_with_dots = functools.partial(_cubics, keep_dots=True)


ANIMATIONS = {"animate", "animateTransform", "animateMotion", "set"}


def _paint(name: str, document: Document, place: Placement, own: list[Subpath]) -> Colouring | None:
    """Return the paint of a fill or stroke; None: it has none."""
    text = place.style[name].strip()
    if text in CONTEXTS:
        text = place.paints[CONTEXTS.index(text)]
        if "url(" in text:
            raise ImageError("uses the gradient of a context, not supported")
    if name == "stroke" and "url(" not in text and text.lower() not in {"none", "currentcolor"}:
        text = text if parse_color(text) else "none"
    return resolve_paint(text, place.style, document, place.viewport, own, place.matrix)


CONTEXTS = ("context-fill", "context-stroke")


def _line(place: Placement) -> LineStyle | None:
    """Return how a stroke is drawn; None: it is not."""
    style, viewport, linear = place.style, place.viewport, place.matrix[:2, :2]
    scale = similarity(place.matrix) or math.sqrt(abs(determinant(linear)))

    def get(name: str, default: float) -> float:
        value = length(style[name], viewport.diagonal, name, viewport.font_size)
        return default if value is None else value

    width = get("stroke-width", 1.0)
    if not width > 0:
        return None
    if style["stroke-linejoin"] == "miter-clip":
        raise ImageError("uses stroke-linejoin miter-clip, not supported")
    limit = style["stroke-miterlimit"]
    dashes = lengths(style["stroke-dasharray"], viewport.diagonal, "stroke-dasharray", viewport.font_size)
    if any(dash < 0 for dash in dashes) or not sum(dashes) > 0:
        dashes = []
    dashes *= 1 + len(dashes) % 2
    offset = get("stroke-dashoffset", 0.0) % sum(dashes) if dashes else 0.0
    return LineStyle(
        width * scale,
        CAPS.get(style["stroke-linecap"], Cap.BUTT),
        JOINS.get(style["stroke-linejoin"], Join.MITER),
        min(max(float(limit), 1.0), LONGEST) if NUMBER.fullmatch(limit) else 4.0,
        tuple(min(scale * value, LONGEST) for value in (offset, *dashes)) if dashes else (),
    )


LONGEST = 1e9
"""Larger miter limits and dashes [px] are clamped: no miter and no outline is as long."""

CAPS = {"round": Cap.ROUND, "square": Cap.SQUARE}
JOINS = {"round": Join.ROUND, "bevel": Join.BEVEL}


def _strokes_first(order: str) -> bool:
    """Return whether the stroke lies below the fill."""
    words = order.split()
    is_valid = len(set(words)) == len(words) and {"stroke"} <= set(words) <= {"fill", "stroke", "markers"}
    return is_valid and "fill" not in words[: words.index("stroke")]


def _check(place: Placement, subpaths: list[Subpath], line: LineStyle | None) -> None:
    """Raise ``ImageError`` for an element that a scene cannot hold."""
    style = place.style
    if any(style[name] != "none" for name in ("marker-start", "marker-mid", "marker-end")):
        raise ImageError("uses markers, not supported")
    rendering = style["shape-rendering"]
    changes_edges = rendering not in {"auto", "geometricPrecision"} and not place.outlines
    if changes_edges and (line or not _is_of_pixels(subpaths)):
        raise ImageError(f"uses shape-rendering {rendering[:40]!r}, not supported")
    if line and style["vector-effect"] != "none":
        raise ImageError("uses vector-effect, not supported")
    reach = np.array([line.width if line else 0.0, *(np.abs(s.points).max() for s in subpaths)])
    # Largest distance of a shape from the canvas's corner [px]: beyond, float32 is too coarse.
    max_extent = 1e5
    if not (reach <= max_extent).all():  # NaN fails as well
        raise ImageError(f"a shape reaches farther than {max_extent:g} px from the picture")


def _is_of_pixels(subpaths: list[Subpath]) -> bool:
    """Return whether all outlines run along pixel edges."""
    between_pixels = 1e-3  # distance [px] from pixel edges within which antialiasing changes nothing
    for subpath in subpaths:
        ends = subpath.points[::3]
        steps = np.diff(subpath.points, axis=0, append=subpath.points[:1])
        gaps = [*np.abs(steps).min(axis=1), *np.abs(ends - np.round(ends)).ravel()]
        if not np.max(gaps) <= between_pixels:
            return False
    return True


def opacity_of(shape: Shape) -> float:
    """Return a shape's opacity; that of a gradient's stops comes on top."""
    return shape.opacity * (shape.paint.opacity if isinstance(shape.paint, FlatColor) else 1.0)
