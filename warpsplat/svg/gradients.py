"""Paints of SVG: colours and gradients (SVG 1.1, sections 11.2 and 13.2)."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from warpsplat.errors import ImageError
from warpsplat.portable.elementary import hypot
from warpsplat.portable.linear import determinant, product
from warpsplat.svg.document import Document, Element, name_of
from warpsplat.svg.geometry import Matrix, about, attribute, parse_transform, tight_box, translation
from warpsplat.svg.inspect import NUMBER
from warpsplat.svg.paths import Subpath
from warpsplat.svg.style import Style
from warpsplat.svg.values import Color, Viewport, check_length, fraction, parse_color


@dataclass(frozen=True)
class Flat:
    """One colour."""

    color: Color
    """sRGB in 0..1."""
    opacity: float = 1.0


@dataclass(frozen=True)
class Gradient:
    """Colours by place."""

    is_radial: bool
    """Along the first axis; or from the focus to the unit circle."""
    frame: Matrix
    """Map of the gradient's own space, that of the unit axes, to where it is drawn, 3x3."""
    focus: tuple[float, float, float]
    """Where a radial one begins, in its own space: x, y, radius."""
    spread: str
    """``pad``, ``reflect`` or ``repeat``."""
    offsets: tuple[float, ...]
    """Of the stops, ascending, in 0..1."""
    stops: tuple[Flat, ...]


Colouring = Flat | Gradient

GRADIENTS = {"linearGradient", "radialGradient"}
BLACK = Flat((0.0, 0.0, 0.0))
"""What is filled with a colour that is none; viewers agree on no other."""

LINK = re.compile(r"""url\(\s*(["']?)\s*#?""")
ENDS = {quote: re.compile(rf"{quote}\s*\)") for quote in ("", "'", '"')}
"""How a link begins, and how it ends, by its quote. One pattern for both has many ways to share out spaces
between its parts, and tries them all where there is no end."""


def parse_link(text: str) -> tuple[str, str] | None:
    """Return the name in ``url(#name)`` at the start of ``text``, and the text after it; None without one."""
    found = LINK.match(text)
    if not found:
        return None
    start = found.end()
    end = ENDS[found[1]].search(text, start)
    if not end:  # of a quote that does not end: a part of the name
        start, end = found.start(1), ENDS[""].search(text, start)
    return (text[start : end.start()].rstrip(), text[end.end() :].lstrip()) if end else None


def resolve_paint(
    text: str, style: Style, document: Document, viewport: Viewport, subpaths: list[Subpath], matrix: Matrix
) -> Colouring | None:
    """What a shape is painted with; None for nothing.

    Args:
        text: value of ``fill`` or ``stroke``.
        style: of the shape.
        document: where gradients are.
        viewport: what lengths refer to.
        subpaths: of the shape [user units].
        matrix: map of user units to those of the canvas.

    Raises:
        ImageError: a pattern, or a paint that only some viewers know.
    """
    link = parse_link(text.strip())
    if not link:
        return flat_paint(text, style)
    name, rest = link
    element = document.called(name)
    fallback = flat_paint(rest, style) if rest else None
    if element is None:
        return fallback
    if name_of(element) in {"pattern", "mesh", "meshgradient", "hatch", "solidcolor"}:
        raise ImageError(f"uses <{name_of(element)}>, not supported")
    if name_of(element) not in GRADIENTS:
        return None
    return _gradient(element, document, viewport, subpaths, matrix, fallback)


def flat_paint(text: str, style: Style) -> Flat | None:
    """A colour; None for none.

    Raises:
        ImageError: a colour that only some viewers know.
    """
    text = text.strip().lower()
    if text == "none":
        return None
    color = parse_color(style["color"] if text == "currentcolor" else text)
    return Flat(*color) if color else BLACK


def _gradient(
    element: Element,
    document: Document,
    viewport: Viewport,
    subpaths: list[Subpath],
    matrix: Matrix,
    fallback: Flat | None,
) -> Colouring | None:
    heritage = _heritage(element, document)
    if heritage.stops is None:
        return fallback
    offsets, stops = document.once(_stops, heritage.stops)
    if len(stops) == 1:
        return stops[0]
    is_radial = name_of(element) == "radialGradient"

    def said(name: str) -> str | None:
        """An attribute of the gradient or of those that it takes over from."""
        text = heritage.said.get(("" if name in COMMON else name_of(element), name))
        if text is not None:
            check_length(name, text)
        return text

    of_box = said("gradientUnits") != "userSpaceOnUse"
    box = tight_box(subpaths)
    extent = box[1] - box[0]
    if of_box and not (extent > 0).all():
        return fallback
    unit = Viewport(1.0, 1.0, viewport.font_size) if of_box else viewport

    def get(name: str, default: str) -> float:
        value = attribute({name: said(name) or default}, name, unit)
        return attribute({name: default}, name, unit) or 0.0 if value is None else value

    transform = parse_transform(said("gradientTransform") or "")
    if determinant(transform) == 0:
        transform = np.eye(3)  # as resvg does
    transform = about(document.style_of(element)["transform-origin"], viewport, transform)
    if of_box:
        transform = product(product(translation(*box[0]), np.diag([*extent, 1.0])), transform)
    own, focus = _radial_frame(get) if is_radial else (_linear_frame(get), (0.0, 0.0, 0.0))
    if own is None:
        return stops[-1]
    if not hypot(focus[0], focus[1]) + focus[2] < 1:
        raise ImageError("uses a radial gradient whose focus is not inside its circle, not supported")
    frame = product(product(matrix, transform), own)
    if not abs(determinant(frame[:2, :2])) > 1e-12:
        return None
    if not (np.abs(frame) <= np.finfo(np.float32).max).all():
        raise ImageError("a gradient reaches farther than can be drawn")
    spread = said("spreadMethod")
    return Gradient(
        is_radial, frame, focus, spread if spread in {"reflect", "repeat"} else "pad", offsets, stops
    )


COMMON = {"gradientUnits", "gradientTransform", "spreadMethod"}
"""Attributes that linear gradients take over from radial ones, and the other way round."""


PLACES = {"x1", "y1", "x2", "y2", "cx", "cy", "r", "fx", "fy", "fr"}
"""Those that they take over from their own kind only."""


@dataclass(frozen=True)
class Heritage:
    """A gradient's own attributes and those it inherits through its chain of links."""

    stops: Element | None
    """The first one with stops; None where there is none, or what is no gradient comes before."""
    said: dict[tuple[str, str], str]
    """Attributes by kind of gradient, empty for ``COMMON``, and name."""


def _heritage(element: Element, document: Document) -> Heritage:
    """Each gradient of a document is looked at once, whatever links to it; twice where links go in a ring."""
    found = document.found
    way: dict[Element, None] = {}
    at: Element | None = element
    while at is not None and (_heritage, at) not in found and at not in way:
        way[at] = None
        at = document.linked(at)
    back = list(way)[::-1]
    heritage: Heritage = found.get((_heritage, at), NOTHING) if at is not None else NOTHING
    if at in way:  # a ring: the first one of it takes over from the last one as well, so it needs two rounds
        for one in back[: back.index(at) + 1]:
            heritage = _taken_over(one, heritage)
    for one in back:
        found[_heritage, one] = heritage = _taken_over(one, heritage)
    return heritage


NOTHING = Heritage(None, {})


def _taken_over(element: Element, heritage: Heritage) -> Heritage:
    kind = name_of(element)
    if kind not in GRADIENTS:
        return Heritage(None, heritage.said)
    own = {
        ("" if name in COMMON else kind, name): text
        for name, text in element.attrib.items()
        if name in COMMON or name in PLACES
    }
    has_stops = any(name_of(child) == "stop" for child in element)
    return Heritage(element if has_stops else heritage.stops, {**heritage.said, **own})


def _linear_frame(get: Callable[[str, str], float]) -> Matrix | None:
    """Frame of the axis; None where it has no length."""
    start = np.array([get("x1", "0%"), get("y1", "0%")])
    way = np.array([get("x2", "100%"), get("y2", "0%")]) - start
    if not way.any():
        return None
    return np.array([[way[0], -way[1], start[0]], [way[1], way[0], start[1]], [0, 0, 1]])


def _radial_frame(get: Callable[[str, str], float]) -> tuple[Matrix | None, tuple[float, float, float]]:
    """Frame of the circle, None where it has no radius, and the focus in it."""
    radius, x, y = get("r", "50%"), get("cx", "50%"), get("cy", "50%")
    if not radius > 0:
        return None, (0.0, 0.0, 0.0)
    focus = (
        (get("fx", repr(x)) - x) / radius,
        (get("fy", repr(y)) - y) / radius,
        max(get("fr", "0"), 0.0) / radius,
    )
    return product(translation(x, y), np.diag([radius, radius, 1.0])), focus


def _stops(element: Element, document: Document) -> tuple[tuple[float, ...], tuple[Flat, ...]]:
    """Offsets and colours of a gradient's stops; each offset is at least the one before."""
    offsets: list[float] = []
    stops: list[Flat] = []
    for child in element:
        if name_of(child) != "stop":
            continue
        style = document.style_of(child)
        text = child.get("offset", "").strip()
        before = offsets[-1] if offsets else 0.0
        given = fraction(text) if NUMBER.fullmatch(text.removesuffix("%")) else before
        offsets.append(max(given, before))
        color = flat_paint("black" if style["stop-color"] == "none" else style["stop-color"], style)
        assert color
        stops.append(Flat(color.color, color.opacity * fraction(style["stop-opacity"])))
    return tuple(offsets), tuple(stops)
