"""Elements that a scene cannot hold and a file keeps whole."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import groupby

from warpsplat.errors import ImageError
from warpsplat.svg.clip import clipped, within
from warpsplat.svg.document import Document, Element
from warpsplat.svg.paths import Points
from warpsplat.svg.shapes import Shape


@dataclass(frozen=True)
class Kept:
    """An element that is kept."""

    element: Element
    cause: str
    """Why no scene can hold it."""
    blends: bool
    """Whether its colours depend on what lies below."""


Part = Shape | Kept


def shapes_of(parts: Sequence[Part]) -> list[Shape]:
    """Return the parts that are shapes."""
    return [part for part in parts if isinstance(part, Shape)]


class Keeping:
    """Decides which elements to keep: the smallest that look the same without what is around them."""

    def __init__(self, document: Document) -> None:
        self._blends = "mix-blend-mode" in document.css
        self._isolates = "isolation" in document.css

    def part(self, element: Element, error: ImageError) -> Kept:
        """Return a part for an element that cannot be read because of ``error``."""
        blends = self._blends or any("mix-blend-mode" in child.get("style", "") for child in element.iter())
        return Kept(element, str(error), blends)

    def isolates(self, group: Element) -> bool:
        """Return whether a group isolates its content from what lies below it, clips not considered."""
        return self._isolates or "isolation" in group.get("style", "")

    def inside(self, parts: list[Part], clip: Points | None) -> list[Part]:
        """Return the parts of a group that isolates or clips.

        Raises:
            ImageError: They look different without the group.
        """
        if any(isinstance(part, Kept) and part.blends for part in parts):
            raise ImageError("uses a blend mode in a group, not supported")
        return parts if clip is None else list(self._clipped(parts, clip))

    def _clipped(self, parts: list[Part], clip: Points) -> Iterator[Part]:
        inside = {id(shape) for shape in within(shapes_of(parts), clip)}
        for _, run in groupby(parts, lambda part: id(part.element)):
            alike = list(run)
            element, shapes = alike[0].element, shapes_of(alike)
            if all(id(shape) in inside for shape in shapes):
                yield from alike
                continue
            try:
                yield from clipped(shapes, clip)
            except ImageError as error:
                if element is None:
                    raise
                yield self.part(element, error)
