"""A parsed SVG: its elements by name and place, and the style of each."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar, cast
from xml.etree import ElementTree

from warpsplat.errors import ImageError
from warpsplat.svg.css import StyleSheet
from warpsplat.svg.inspect import NAMESPACE
from warpsplat.svg.style import KNOWN, ROOT, Style, element_style

Element = ElementTree.Element

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
        self.found: dict[tuple[Callable[..., Any], Element], Any] = {}
        """Results of ``once``, however many elements refer to another."""

    def once(self, find: Callable[[Element, Document], Found], element: Element) -> Found:
        """Return ``find``'s result for an element, or raise its ``ImageError``; computed once."""
        key = find, element
        if key not in self.found:
            try:
                self.found[key] = find(element, self)
            except ImageError as error:
                self.found[key] = error
        found = self.found[key]
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
        return element_style(element, self._sheet.of(element, self.parents), parent)

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
