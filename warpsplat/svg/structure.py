"""The structure of an SVG: groups, links, viewports and their clips (SVG 1.1, chapters 5 and 7)."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import groupby

import numpy as np

from warpsplat.errors import ImageError, cause_of
from warpsplat.portable.linear import determinant, product
from warpsplat.svg.clip import clip_rectangle, clipped, overlap, polygon, within
from warpsplat.svg.css import ancestors
from warpsplat.svg.document import DRAWN, ROOT, Document, Element, name_of
from warpsplat.svg.geometry import (
    Matrix,
    about,
    attribute,
    moved,
    parse_transform,
    translation,
    view_box_map,
)
from warpsplat.svg.gradients import FlatColor
from warpsplat.svg.groups import LEVEL_ID
from warpsplat.svg.inspect import inspect_svg, known_size, view_box
from warpsplat.svg.paths import Points
from warpsplat.svg.shapes import CONTEXTS, Placement, Shape, element_shapes
from warpsplat.svg.values import SvgViewport, fraction, parse_color

MAX_LINKED = 100_000
"""Most elements shown through links, which may multiply."""

MAX_WORK = 5_000_000
"""Most shapes summed over the groups that clip or fade them; nesting multiplies them."""

REFUSED = {"text", "tref", "image", "switch", "foreignObject", "video", "audio", "canvas", "iframe"}
REFUSED |= {"mesh", "hatch"}
"""Elements that show something other than shapes. Unknown elements show nothing."""

VISITED = {*DRAWN, "svg", "g", "a", "use"}
"""Elements that show shapes."""

LEVEL = re.compile(rf"{LEVEL_ID}\d{{1,9}}")
"""Names of the groups that are the levels of a layered file."""

UNIT = np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
"""Corners of a square of size 1."""

CONDITIONS = ("systemLanguage", "requiredFeatures", "requiredExtensions")


@dataclass(frozen=True)
class Kept:
    """An element that no shape can hold and a file keeps whole."""

    element: Element
    cause: str
    """Why no shape can hold it."""
    blends: bool
    """Whether its colours depend on what lies below."""


Part = Shape | Kept


def shapes_of(parts: Sequence[Part]) -> list[Shape]:
    """Return the parts that are shapes."""
    return [part for part in parts if isinstance(part, Shape)]


@dataclass(frozen=True)
class _Unit:
    """An element that is kept whole if a part of it cannot be read."""

    element: Element
    first: int
    """Index of its first shape."""
    depth: int
    """Length of the stack below it."""


@dataclass(frozen=True)
class _Context(Placement):
    """Properties that an element inherits."""

    depth: int
    use_size: tuple[float | None, float | None] = (None, None)
    """The size that a link gives a nested ``svg``."""
    link: _Unit | None = None
    """The outermost link that led here."""
    level: str = ""
    """Name of the level in a layered file."""


@dataclass(frozen=True)
class _End:
    """The end of a group."""

    unit: _Unit
    first: int
    """Index of its first shape."""
    opacity: float = 1.0
    clip: Points | None = None
    """Corners of the visible quadrilateral, shape (4, 2)."""


def read_shapes(text: str, scale: float, *, see_through: bool = False, outlines: bool = False) -> list[Shape]:
    """Return the shapes of an SVG magnified by ``scale``, in painter's order.

    ``see_through``: fade overlapping shapes of a translucent group one by one, rather than refuse them.
    ``outlines``: accept what changes the look of edges only: ``shape-rendering``, and strokes that a
    transform stretches, which get their mean width.

    Raises:
        ImageError: Not an SVG, or one with something that would be lost.
    """
    root = inspect_svg(text).root
    parts, _ = _read(text, root, (scale, scale), see_through=see_through, outlines=outlines)
    return shapes_of(parts)


def read_parts(text: str, width: int, height: int, *, keep: bool) -> tuple[list[Part], Document]:
    """Return the shapes of an SVG that fills a picture of ``width`` x ``height`` px, and the document.

    ``keep``: elements that ``read_shapes`` refuses are parts as well; only the root and style sheets may be
    refused. It raises its errors, also for a picture of other proportions.
    """
    root = inspect_svg(text).root
    across, down = known_size(root)
    if abs(across / down - width / height) > 0.02 * width / height:
        raise ImageError(
            f"{across:g}x{down:g} does not have the proportions of the {width}x{height} image: "
            "it has to show all of it, and nothing around it"
        )
    return _read(text, root, (width / across, height / down), keep=keep)


def _read(
    text: str,
    root: dict[str, str],
    scale: tuple[float, float],
    *,
    keep: bool = False,
    see_through: bool = False,
    outlines: bool = False,
) -> tuple[list[Part], Document]:
    """Return the parts of an SVG, given the attributes of its ``root``, and the document."""
    try:
        with np.errstate(all="ignore"):  # points of shapes are checked for overflow
            document = Document(text)
            walk = _Walk(document, keep=keep, see_through=see_through, outlines=outlines)
            return walk.parts_in(*_canvas(root, scale)), document
    except (ImageError, MemoryError):
        raise
    except Exception as error:  # arithmetic on absurd numbers overflows in many ways
        raise ImageError(f"not an SVG that can be read: {cause_of(error)[:100]}") from error


def _canvas(root: dict[str, str], scale: tuple[float, float]) -> tuple[Matrix, SvgViewport]:
    """Return the map of user units to canvas units, and the viewport."""
    size, matrix = known_size(root), np.diag([*scale, 1.0])
    view, box = view_box_map(root, *size), view_box(root)
    if view is None or box is None:
        return matrix, SvgViewport(*size)
    return product(matrix, view), SvgViewport(*box[2:])


class _Walk:
    """A walk through a document in painter's order, with a stack of its own: nesting may exceed Python's."""

    def __init__(self, document: Document, *, keep: bool, see_through: bool, outlines: bool) -> None:
        self._document, self._see_through = document, see_through
        self._keep, self._outlines = keep, outlines
        self._shapes: list[Part] = []
        self._todo: list[tuple[Element, _Context] | _End] = []
        self._linked = 0
        self._seen_linked: set[Element] = set()
        self._work = 0

    def parts_in(self, matrix: Matrix, viewport: SvgViewport) -> list[Part]:
        """Return all shapes, mapped by ``matrix``, and elements that are kept."""
        self._background(matrix, viewport)
        root = _Context(ROOT, matrix, viewport, ("none", "none"), (), self._outlines, 0)
        self._todo = [(self._document.root, root)]
        while self._todo:
            item = self._todo.pop()
            if isinstance(item, _End):
                self._try(item.unit, self._end, item)
            else:
                element, context = item
                unit = context.link or _Unit(element, len(self._shapes), len(self._todo))
                self._try(unit, self._enter, element, context, unit)
        return self._shapes

    def _try(self, unit: _Unit, step: Callable[..., None], *arguments: object) -> None:
        """Do a step; keep the whole unit if it cannot be done and keeping is allowed."""
        try:
            step(*arguments)
        except ImageError as error:
            if not self._keep or unit.element is self._document.root:
                raise
            del self._todo[unit.depth :]
            self._shapes[unit.first :] = [self._kept(unit.element, error)]

    def _kept(self, element: Element, error: ImageError) -> Kept:
        """Return a part for an element that cannot be read because of ``error``."""
        texts = [self._document.css, *(child.get("style", "") for child in element.iter())]
        return Kept(element, str(error), any("mix-blend-mode" in text for text in texts))

    def _enter(self, element: Element, context: _Context, unit: _Unit) -> None:
        tag = name_of(element)
        if tag not in VISITED and tag not in REFUSED:
            return
        if context.path:
            self._add_linked(len(element) if tag in DRAWN else 0, element)
        style = self._document.style_in(element, context.style)
        if style["display"] == "none":
            return
        if tag in REFUSED:
            raise ImageError(f"uses <{tag[:40]}>, not supported")
        if any(name in element.attrib for name in CONDITIONS):
            raise ImageError("uses conditions on language or features, not supported")
        viewport = replace(context.viewport, font_size=float(style["font-size"]))
        transform = about(style["transform-origin"], viewport, parse_transform(style["transform"]))
        matrix = product(context.matrix, transform)
        if determinant(matrix[:2, :2]) == 0:
            return
        name = element.get("id", "")
        level = name if tag == "g" and context.depth == 1 and LEVEL.fullmatch(name) else context.level
        depth = context.depth + 1
        inner = replace(context, style=style, matrix=matrix, viewport=viewport, depth=depth, level=level)
        clip = clip_rectangle(style["clip-path"], self._document, matrix, viewport)
        end = _End(unit, len(self._shapes), fraction(style["opacity"]), clip)
        if tag in DRAWN:
            own = element if self._keep and not context.link else None
            shapes = element_shapes(element, self._document, inner)
            self._shapes += [replace(shape, element=own, level=context.level) for shape in shapes]
            self._end(end)
            return
        max_depth = 1000  # deepest nesting, links included
        if inner.depth > max_depth:
            raise ImageError(f"elements are nested more than {max_depth} deep")
        self._todo.append(end)
        if tag == "use":
            self._link(element, inner, unit)
        elif tag == "svg" and element is not self._document.root:
            self._nested(element, inner, element, unit)
        else:
            self._children(element, inner)

    def _children(self, element: Element, context: _Context) -> None:
        if context.path:
            self._add_linked(len(element))
        self._todo.extend((child, context) for child in reversed(element))

    def _add_linked(self, count: int, element: Element | None = None) -> None:
        """Count linked elements; the attributes of an ``element`` count as well, but for the first time."""
        linked_characters = 50  # characters of a linked element's attributes that count as one element
        if element in self._seen_linked:
            count += sum(map(len, element.attrib.values())) // linked_characters
        elif element is not None:
            self._seen_linked.add(element)
        self._linked += count
        if self._linked > MAX_LINKED:
            raise ImageError(f"links add up to more than {MAX_LINKED} elements")

    def _link(self, element: Element, context: _Context, unit: _Unit) -> None:
        """Follow a ``use``."""
        if self._document.links_out(element):
            raise ImageError("uses an element of another file, not supported")
        target = self._document.linked(element)
        if target is None or target in context.path or target in ancestors(element, self._document.parents):
            return  # recursive links show nothing
        tag = name_of(target)
        if tag not in VISITED and tag not in REFUSED and tag != "symbol":
            return
        viewport = context.viewport
        x, y = (attribute(element.attrib, name, viewport) or 0.0 for name in "xy")
        fill, stroke = (_in_context(context.style[name], context.paints) for name in ("fill", "stroke"))
        path = (*context.path, target)
        inner = replace(context, path=path, paints=(fill, stroke), use_size=(None, None), link=unit)
        if tag == "symbol":
            self._add_linked(0, target)
            self._nested(element, inner, target, unit)
            return
        inner = replace(inner, matrix=product(context.matrix, translation(x, y)))
        if tag == "svg":
            width, height = (attribute(element.attrib, name, viewport) for name in ("width", "height"))
            inner = replace(inner, use_size=(width, height))
        self._add_linked(1)
        self._todo.append((target, inner))

    def _nested(self, element: Element, context: _Context, content: Element, unit: _Unit) -> None:
        """Enter a new viewport: a nested ``svg``, which is its own content, or a ``use`` of a symbol."""
        is_svg = element is content
        viewport = context.viewport
        x, y = (attribute(element.attrib, name, viewport) or 0.0 for name in "xy")
        given = [attribute(element.attrib, name, viewport) for name in ("width", "height")]
        if is_svg:
            given = [b if b is not None else a for a, b in zip(given, context.use_size, strict=True)]
        sizes = zip(given, (viewport.width, viewport.height), strict=True)
        width, height = (whole if size is None else size for size, whole in sizes)
        if not (width > 0 and height > 0):
            return
        style = context.style if is_svg else self._document.style_in(content, context.style)
        if not is_svg and style["clip-path"] != "none":
            raise ImageError("uses clip-path of a symbol, not supported")
        view = view_box_map(content.attrib, width, height)
        box = view_box(content.attrib) if view is not None else None
        size = box[2:] if box else (width, height)
        matrix = product(context.matrix, translation(x, y))
        matrix = matrix if view is None else product(matrix, view)
        is_clipped = not is_svg or None not in given or context.use_size != (None, None)
        is_clipped = is_clipped and style["overflow"] not in {"visible", "auto"}
        clip = moved(context.matrix, UNIT * [width, height] + [x, y]) if is_clipped else None
        opacity = 1.0 if is_svg else fraction(style["opacity"])
        self._todo.append(_End(unit, len(self._shapes), opacity, clip))
        viewport = replace(viewport, width=size[0], height=size[1])
        inner = replace(context, style=style, matrix=matrix, viewport=viewport, use_size=(None, None))
        self._children(content, inner)

    def _end(self, end: _End) -> None:
        """Apply the opacity and the clip of a group to its shapes.

        Raises:
            ImageError: The shapes would look different.
        """
        isolates = "isolation" in self._document.css or "isolation" in end.unit.element.get("style", "")
        isolates = self._keep and isolates
        if end.clip is None and end.opacity == 1 and not isolates:
            return
        parts = self._shapes[end.first :]
        pairs = 30  # pairs of shapes that are compared in the time that clipping one takes
        self._work += len(parts) + (len(parts) ** 2 // pairs if end.opacity < 1 else 0)
        if self._work > MAX_WORK:
            raise ImageError("has too many shapes in nested groups with clips or opacity")
        if any(isinstance(part, Kept) and part.blends for part in parts):
            raise ImageError("uses a blend mode in a group, not supported")
        if end.clip is not None:
            parts = list(self._clipped(parts, end.clip))
        if end.opacity < 1:
            shapes = shapes_of(parts)
            hides = end.opacity > 0 and not self._see_through and overlap(shapes)
            if len(shapes) < len(parts) or hides:
                raise ImageError("uses opacity of a group of shapes that overlap, not supported")
            faded = (replace(shape, opacity=shape.opacity * end.opacity) for shape in shapes)
            parts = [*faded] if end.opacity > 0 else []
        self._shapes[end.first :] = parts

    def _clipped(self, parts: list[Part], clip: Points) -> Iterator[Part]:
        """Yield the parts inside a convex polygon; elements that cannot be cut are kept if allowed."""
        if not self._keep:
            yield from clipped(shapes_of(parts), clip)
            return
        inside = {id(shape) for shape in within(shapes_of(parts), clip)}
        for _, run in groupby(parts, lambda part: id(part.element)):
            alike = list(run)
            shapes, element = shapes_of(alike), alike[0].element
            try:
                yield from alike if inside.issuperset(map(id, shapes)) else clipped(shapes, clip)
            except ImageError as error:
                if element is None:
                    raise
                yield self._kept(element, error)

    def _background(self, matrix: Matrix, viewport: SvgViewport) -> None:
        """Add the root's ``background-color``, which is painted below all shapes."""
        style = self._document.style_of(self._document.root)
        color = parse_color(style["background-color"])
        if style["background"] != "none":
            color = parse_color(style["background"])
            if color is None:
                raise ImageError("uses a background other than a colour, which is not supported")
        if color is None or color[1] == 0:
            return
        box = view_box(self._document.root.attrib)
        x, y = box[:2] if box else (0.0, 0.0)
        corners = UNIT * [viewport.width, viewport.height] + [x, y]
        ring = polygon(moved(matrix, corners))
        self._shapes.append(Shape([ring], FlatColor(*color), 1.0, None, is_rect=True))


def _in_context(paint: str, context: tuple[str, str]) -> str:
    return context[CONTEXTS.index(paint)] if paint in CONTEXTS else paint
