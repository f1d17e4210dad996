"""``clip-path``, where it is one rectangle (SVG 1.1, 14.3)."""

from __future__ import annotations

from warpsplat.errors import ImageError
from warpsplat.portable.linear import product
from warpsplat.svg.document import Document, Element, name_of
from warpsplat.svg.geometry import Matrix, about, moved, outline, parse_transform
from warpsplat.svg.gradients import parse_link
from warpsplat.svg.paths import Points, cubics
from warpsplat.svg.values import Viewport, check_length


def clip_rectangle(link: str, document: Document, matrix: Matrix, viewport: Viewport) -> Points | None:
    """Corners of the rectangle that a ``clip-path`` leaves of an element; None: it has none.

    Raises:
        ImageError: it is something else.
    """
    if link == "none":
        return None
    found = parse_link(link)
    element = document.called(found[0]) if found else None
    content = document.once(_content, element) if element is not None else None
    if element is not None and content is not None:
        units = element.get("clipPathUnits", "userSpaceOnUse")
        for part in (element, content):
            style = document.style_of(part)
            own_map = about(style["transform-origin"], viewport, parse_transform(style["transform"]))
            matrix = product(matrix, own_map)
            units += "" if style["clip-path"] == "none" and style["display"] != "none" else " clipped"
        own = cubics(outline("rect", content.attrib, viewport), keep_dots=False)
        is_rect = style["visibility"] == "visible"
        if units == "userSpaceOnUse" and is_rect and own and len(own[0].points) == 13:
            return moved(matrix, own[0].points[:12:3])
    raise ImageError("uses a clip-path that is no rectangle, not supported")


def _content(element: Element, document: Document) -> Element | None:
    """The rectangle that is all that an element, a clip, has in it; None: it is something else."""
    content = [child for child in element if name_of(child)]
    if name_of(element) != "clipPath" or len(content) != 1 or name_of(content[0]) != "rect":
        return None
    for part in (element, content[0]):
        for name, value in document.style_of(part).items() | part.attrib.items():
            check_length(name, value)
    return content[0]
