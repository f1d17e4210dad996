"""A parsed SVG: its elements by name and place, and the style of each."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from typing import Any, TypeVar, cast
from xml.etree import ElementTree

from warpsplat.errors import ImageError
from warpsplat.portable.elementary import power
from warpsplat.svg.css import Declaration, StyleSheet, declarations, local_name
from warpsplat.svg.inspect import LENGTH, NAMESPACE
from warpsplat.svg.values import check_length, length

Element = ElementTree.Element

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


Found = TypeVar("Found")

HREFS = ("href", "{http://www.w3.org/1999/xlink}href")
"""Attributes that link elements; the first takes precedence (SVG 2, 16.1.3)."""


def name_of(element: Element) -> str:
    """Return an element's name in SVG's namespace; empty for elements of others."""
    space, _, name = str(element.tag).rpartition("}")
    return name if space[1:] == NAMESPACE else ""


class Document:
    """A parsed SVG."""

    def __init__(self, text: str) -> None:
        """Parse a text that ``inspect_svg`` has passed.

        Raises:
            ImageError: A style sheet is not supported.
        """
        self.root = ElementTree.fromstring(text)
        self.parents = {child: element for element in self.root.iter() for child in element}
        self._by_id: dict[str, Element] = {}
        css: list[str] = []
        for element in self.root.iter():
            if "id" in element.attrib:
                self._by_id.setdefault(element.attrib["id"], element)
            if name_of(element) == "style" and element.get("type", "text/css") == "text/css":
                # Without the text of elements inside, which would count once for each level of nesting.
                css.append("".join([element.text or "", *(child.tail or "" for child in element)]))
        self.css = "\n".join(css)
        """The text of all style sheets."""
        self._sheet = StyleSheet(self.css, KNOWN)
        self._styles: dict[Element, Style] = {}
        self._found: dict[tuple[Callable[..., Any], Element], Any] = {}
        """Results of ``once``, however many elements refer to another."""

    def once(self, find: Callable[[Element, Document], Found], element: Element) -> Found:
        """Return ``find``'s result for an element, or raise its ``ImageError``; computed once."""
        key = find, element
        if key not in self._found:
            try:
                self._found[key] = find(element, self)
            except ImageError as error:
                self._found[key] = error
        found = self._found[key]
        if isinstance(found, ImageError):
            raise ImageError(str(found))
        return cast("Found", found)

    def _href(self, element: Element) -> str:
        return next((element.attrib[name] for name in HREFS if name in element.attrib), "").strip()

    def linked(self, element: Element) -> Element | None:
        """Return the element that one links to; None if it links to nothing in this document."""
        text = self._href(element)
        return self._by_id.get(text[1:]) if text.startswith("#") else None

    def links_out(self, element: Element) -> bool:
        """Return whether an element links to another document."""
        text = self._href(element)
        return bool(text) and not text.startswith("#")

    def called(self, name: str) -> Element | None:
        """Return the first element with that ``id``."""
        return self._by_id.get(name)

    def style_in(self, element: Element, parent: Style) -> Style:
        """Return all properties of an element whose parent has the style ``parent``.

        Raises:
            ImageError: A property has a value that shapes cannot show.
        """
        rules = self._sheet.of(element, self.parents)
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

    def style_of(self, element: Element) -> Style:
        """Return all properties of an element at its place in the document; raises as ``style_in``."""
        path = [element]
        while path[-1] not in self._styles and path[-1] in self.parents:
            path.append(self.parents[path[-1]])
        for node in reversed(path):
            if node not in self._styles:
                parent = self._styles[self.parents[node]] if node in self.parents else ROOT
                self._styles[node] = self.style_in(node, parent)
        return self._styles[element]
