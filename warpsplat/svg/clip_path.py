"""``clip-path``, where it is one rectangle (SVG 1.1, 14.3)."""

from __future__ import annotations

from warpsplat.errors import ImageError
from warpsplat.portable.linear import product
from warpsplat.svg.document import Document, name_of
from warpsplat.svg.geometry import Matrix, about, moved, outline, parse_transform
from warpsplat.svg.gradients import LINK
from warpsplat.svg.paths import Points, cubics
from warpsplat.svg.values import Viewport


def clip_rectangle(link: str, document: Document, matrix: Matrix, viewport: Viewport) -> Points | None:
    """Corners of the rectangle that a ``clip-path`` leaves of an element; None: it has none.

    Raises:
        ImageError: it is something else.
    """
    if link == "none":
        return None
    found = LINK.match(link)
    element = document.called(found[2]) if found else None
    content = [child for child in element if name_of(child)] if element is not None else []
    if element is not None and name_of(element) == "clipPath" and len(content) == 1:
        units = element.get("clipPathUnits", "userSpaceOnUse")
        for part in (element, *content):
            style = document.style_of(part)
            own_map = about(style["transform-origin"], viewport, parse_transform(style["transform"]))
            matrix = product(matrix, own_map)
            units += "" if style["clip-path"] == "none" and style["display"] != "none" else " clipped"
        own = cubics(outline("rect", content[0].attrib, viewport), keep_dots=False)
        is_rect = name_of(content[0]) == "rect" and style["visibility"] == "visible"
        if units == "userSpaceOnUse" and is_rect and own and len(own[0].points) == 13:
            return moved(matrix, own[0].points[:12:3])
    raise ImageError("uses a clip-path that is no rectangle, not supported")
