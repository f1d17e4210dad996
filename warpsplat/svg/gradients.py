"""Paints of SVG: colours and gradients (SVG 1.1, sections 11.2 and 13.2)."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from warpsplat.errors import ImageError
from warpsplat.portable.elementary import hypot
from warpsplat.portable.linear import determinant, product
from warpsplat.svg.document import Document, Element, Style, name_of
from warpsplat.svg.geometry import Matrix, about, attribute, parse_transform, tight_box, translation
from warpsplat.svg.inspect import NUMBER
from warpsplat.svg.paths import Subpath
from warpsplat.svg.values import Color, SvgViewport, check_length, fraction, parse_color


@dataclass(frozen=True)
class FlatColor:
    """One colour."""

    color: Color
    """sRGB in 0..1."""
    opacity: float = 1.0


@dataclass(frozen=True)
class Gradient:
    """Colours that vary with position."""

    is_radial: bool
    """From the focus to the unit circle, rather than along the first axis."""
    frame: Matrix
    """Map of the gradient's unit space to the canvas, 3x3."""
    focus: tuple[float, float, float]
    """The circle where a radial gradient begins, in its unit space: x, y, radius."""
    spread: str
    """``pad``, ``reflect`` or ``repeat``."""
    offsets: tuple[float, ...]
    """Offsets of the stops, ascending, in [0, 1]."""
    stops: tuple[FlatColor, ...]


Colouring = FlatColor | Gradient

GRADIENTS = {"linearGradient", "radialGradient"}
BLACK = (0.0, 0.0, 0.0), 1.0
"""Paint for an invalid colour: the only fallback that viewers agree on."""

LINK = re.compile(r"""url\(\s*(["']?)\s*#?""")
ENDS = {quote: re.compile(rf"{quote}\s*\)") for quote in ("", "'", '"')}
"""The beginning of a link, and its end by the kind of quote. A single pattern could match spaces by several
of its parts, and would try all ways where there is no end."""


def parse_link(text: str) -> tuple[str, str] | None:
    """Return the name in ``url(#name)`` at the start of ``text``, and the text after it; None without one."""
    found = LINK.match(text)
    if not found:
        return None
    start = found.end()
    end = ENDS[found[1]].search(text, start)
    if not end:  # an unterminated quote is a part of the name
        start, end = found.start(1), ENDS[""].search(text, start)
    return (text[start : end.start()].rstrip(), text[end.end() :].lstrip()) if end else None


def resolve_paint(
    text: str,
    style: Style,
    document: Document,
    viewport: SvgViewport,
    subpaths: list[Subpath],
    matrix: Matrix,
) -> Colouring | None:
    """Return the paint of a shape whose ``fill`` or ``stroke`` is ``text``; None: it has none.

    ``subpaths`` are in user units, which ``matrix`` maps to canvas units; lengths refer to ``viewport``.

    Raises:
        ImageError: A pattern, or a paint that only some viewers support.
    """
    link = parse_link(text.strip())
    if not link:
        return flat_paint(text, style)
    element = document.called(link[0])
    fallback = flat_paint(link[1], style) if link[1] else None
    if element is None:
        return fallback
    tag = name_of(element)
    if tag in {"pattern", "mesh", "meshgradient", "hatch", "solidcolor"}:
        raise ImageError(f"uses <{tag}>, not supported")
    if tag not in GRADIENTS:
        return None
    return _gradient(element, document, viewport, subpaths, matrix, fallback)


def flat_paint(text: str, style: Style) -> FlatColor | None:
    """Return a colour, or None for ``none``; raises as ``parse_color``."""
    text = text.strip().lower()
    if text == "none":
        return None
    color = parse_color(style["color"] if text == "currentcolor" else text)
    return FlatColor(*(color or BLACK))


def _gradient(
    element: Element,
    document: Document,
    viewport: SvgViewport,
    subpaths: list[Subpath],
    matrix: Matrix,
    fallback: FlatColor | None,
) -> Colouring | None:
    with_stops, attributes = document.once(_chain, element)
    if with_stops is None:
        return fallback
    offsets, stops = document.once(_stops, with_stops)
    if len(stops) == 1:
        return stops[0]
    is_radial = name_of(element) == "radialGradient"

    def given(name: str) -> str | None:
        """Return an attribute of the gradient or of those that it inherits from."""
        text = attributes.get(name)
        check_length(name, text or "")
        return text

    of_box = given("gradientUnits") != "userSpaceOnUse"
    box = tight_box(subpaths)
    extent = box[1] - box[0]
    if of_box and not (extent > 0).all():
        return fallback
    unit = SvgViewport(1.0, 1.0, viewport.font_size) if of_box else viewport

    def get(name: str, default: str) -> float:
        value = attribute({name: given(name) or default}, name, unit)
        return attribute({name: default}, name, unit) or 0.0 if value is None else value

    transform = parse_transform(given("gradientTransform") or "")
    if determinant(transform) == 0:
        transform = np.eye(3)  # as resvg does
    transform = about(document.style_of(element)["transform-origin"], viewport, transform)
    if of_box:
        transform = product(product(translation(*box[0]), np.diag([*extent, 1.0])), transform)
    own, focus = (_radial_frame if is_radial else _linear_frame)(get)
    if own is None:
        return stops[-1]
    if not hypot(focus[0], focus[1]) + focus[2] < 1:
        raise ImageError("uses a radial gradient whose focus is not inside its circle, not supported")
    frame = product(product(matrix, transform), own)
    if not abs(determinant(frame[:2, :2])) > 1e-12:
        return None
    if not (np.abs(frame) <= np.finfo(np.float32).max).all():
        raise ImageError("a gradient reaches farther than can be drawn")
    spread = given("spreadMethod") or ""
    spread = spread if spread in {"reflect", "repeat"} else "pad"
    return Gradient(is_radial, frame, focus, spread, offsets, stops)


COMMON = {"gradientUnits", "gradientTransform", "spreadMethod"}
"""Attributes that linear and radial gradients inherit from each other."""

PLACES = {"x1", "y1", "x2", "y2", "cx", "cy", "r", "fx", "fy", "fr"}
"""Attributes that they inherit from their own kind only."""


def _chain(element: Element, document: Document) -> tuple[Element | None, dict[str, str]]:
    """Return the gradient whose stops a gradient has, if any, and its attributes; own ones come first.

    It inherits from the element that it links to, from the one that that links to, and so on. None: there
    are no stops before an element that is no gradient.

    Raises:
        ImageError: The chain is too long.
    """
    longest = 100  # most gradients that one inherits from
    with_stops: Element | None = None
    attributes: dict[str, str] = {}
    seen: set[Element] = set()
    may_have_stops = True
    at: Element | None = element
    while at is not None and at not in seen:
        seen.add(at)
        if len(seen) > longest:
            raise ImageError(f"a gradient inherits from more than {longest} others")
        kind = name_of(at)
        may_have_stops &= kind in GRADIENTS
        if with_stops is None and may_have_stops and any(map(_is_stop, at)):
            with_stops = at
        names = COMMON | PLACES if kind == name_of(element) else COMMON if kind in GRADIENTS else set()
        attributes = {name: text for name, text in at.attrib.items() if name in names} | attributes
        at = document.linked(at)
    return with_stops, attributes


def _is_stop(element: Element) -> bool:
    return name_of(element) == "stop"


CENTRE = (0.0, 0.0, 0.0)


def _linear_frame(get: Callable[[str, str], float]) -> tuple[Matrix | None, tuple[float, float, float]]:
    """Return the frame of the axis, None if it has no length, and no focus."""
    start = x, y = get("x1", "0%"), get("y1", "0%")
    dx, dy = np.array([get("x2", "100%"), get("y2", "0%")]) - start
    return np.array([[dx, -dy, x], [dy, dx, y], [0, 0, 1]]) if dx or dy else None, CENTRE


def _radial_frame(get: Callable[[str, str], float]) -> tuple[Matrix | None, tuple[float, float, float]]:
    """Return the frame of the circle, None if it has no radius, and the focus in it."""
    radius, x, y = get("r", "50%"), get("cx", "50%"), get("cy", "50%")
    if not radius > 0:
        return None, CENTRE
    fx, fy, fr = get("fx", repr(x)) - x, get("fy", repr(y)) - y, max(get("fr", "0"), 0.0)
    return np.array([[radius, 0, x], [0, radius, y], [0, 0, 1]]), (fx / radius, fy / radius, fr / radius)


def _stops(element: Element, document: Document) -> tuple[tuple[float, ...], tuple[FlatColor, ...]]:
    """Return the offsets, each at least the one before, and the colours of a gradient's stops."""
    offsets: list[float] = []
    stops: list[FlatColor] = []
    for child in filter(_is_stop, element):
        style = document.style_of(child)
        text = child.get("offset", "").strip()
        before = offsets[-1] if offsets else 0.0
        given = fraction(text) if NUMBER.fullmatch(text.removesuffix("%")) else before
        offsets.append(max(given, before))
        color = flat_paint("black" if style["stop-color"] == "none" else style["stop-color"], style)
        assert color
        stops.append(FlatColor(color.color, color.opacity * fraction(style["stop-opacity"])))
    return tuple(offsets), tuple(stops)
