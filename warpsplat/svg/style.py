"""The computed style of SVG elements: presentation attributes, style sheets and ``style`` combined."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

from warpsplat.errors import ImageError
from warpsplat.portable.elementary import power
from warpsplat.svg.css import Declaration, Element, declarations, local_name
from warpsplat.svg.inspect import LENGTH
from warpsplat.svg.values import check_length, length

INHERITED = {
    "color": "black",
    "fill": "black",
    "fill-opacity": "1",
    "fill-rule": "nonzero",
    "font-size": "16",
    "marker-end": "none",
    "marker-mid": "none",
    "marker-start": "none",
    "paint-order": "normal",
    "shape-rendering": "auto",
    "stroke": "none",
    "stroke-dasharray": "none",
    "stroke-dashoffset": "0",
    "stroke-linecap": "butt",
    "stroke-linejoin": "miter",
    "stroke-miterlimit": "4",
    "stroke-opacity": "1",
    "stroke-width": "1",
    "visibility": "visible",
}
"""Inherited properties and their initial values."""

OWN = {
    "background": "none",
    "background-color": "transparent",
    "clip-path": "none",
    "display": "inline",
    "filter": "none",
    "mask": "none",
    "mix-blend-mode": "normal",
    "opacity": "1",
    "overflow": "hidden",
    "stop-color": "black",
    "stop-opacity": "1",
    "transform": "none",
    "transform-origin": "none",
    "vector-effect": "none",
}
"""Other properties and their initial values. Isolation is left out: without blend modes it shows nothing."""

ONLY_STYLE = {"background", "background-color", "mix-blend-mode"}
"""Properties that are no presentation attributes."""

GEOMETRY = {"x", "y", "cx", "cy", "r", "rx", "ry", "d", "width", "height"}
"""Properties that some viewers read from style sheets, but resvg does not."""

KNOWN = frozenset({*INHERITED, *OWN, *GEOMETRY, "font", "marker"})

Style = dict[str, str]
"""Values by property."""

ROOT = {**OWN, **INHERITED}
"""The style around the root element."""

DRAWN = {"path", "rect", "circle", "ellipse", "line", "polyline", "polygon"}
"""Elements that are shapes."""


def element_style(element: Element, rules: Sequence[Declaration], parent: Style) -> Style:
    """Return all properties of an element, given the ``rules`` that apply to it, the strongest last.

    Raises:
        ImageError: A property has a value that shapes cannot show.
    """
    style = {**parent, **OWN}
    for name, value in _cascade(element.attrib, rules).items():
        if len(element) and name in INHERITED:
            check_length(name, value)
        if name in GEOMETRY:
            if local_name(element) in DRAWN:
                raise ImageError(f"sets {name} by style, not supported")
        elif "var(" in value:
            raise ImageError("uses variables in style, not supported")
        elif value == "inherit" or (value == "unset" and name in INHERITED):
            style[name] = parent[name]
        elif value in {"initial", "unset"}:
            style[name] = ROOT[name]
        elif name == "font-size":
            style[name] = repr(_font_size(value, float(parent[name])))
        else:
            style[name] = value
    for name in ("mask", "filter", "mix-blend-mode"):
        if style[name] != OWN[name]:
            raise ImageError(f"uses {name}, not supported")
    return style


def _cascade(attributes: Mapping[str, str], rules: Sequence[Declaration]) -> Style:
    """Return the values given to an element itself (CSS 2.1, 6.4).

    Important declarations win, then ``style``, then rules, then attributes.
    """
    own: Style = {
        name: value.strip()
        for name, value in attributes.items()
        if (name in INHERITED or name in OWN) and name not in ONLY_STYLE
    }
    declared = [*rules, *declarations(attributes["style"])] if "style" in attributes else rules
    for name, value, _ in sorted(declared, key=lambda d: d.important):
        if name == "marker":
            own |= dict.fromkeys(("marker-start", "marker-mid", "marker-end"), value)
        elif name == "font":
            own["font-size"] = next(filter(LENGTH.fullmatch, re.split(r"[\s/]+", value)), "medium")
        elif name in KNOWN:
            own[name] = value
    return own


FONT_SIZES = {
    **{"xx-small": -3, "x-small": -2, "small": -1, "smaller": -1},
    **{"large": 1, "larger": 1, "x-large": 2, "xx-large": 3},
}
"""Factors of 1.2 to the parent's size."""


def _font_size(text: str, parent: float) -> float:
    if text in FONT_SIZES:
        return parent * float(power(1.2, FONT_SIZES[text]))
    size = length(text, parent, "font-size", parent)
    return parent if size is None else size
