"""Excerpts of a document's text: elements as written, with what they need to look the same elsewhere."""

from __future__ import annotations

import re
from bisect import bisect_left
from collections.abc import Iterable, Iterator, Sequence
from html import escape
from xml.parsers import expat

from warpsplat.errors import ImageError
from warpsplat.svg.css import ancestors, rules, split_at_rules
from warpsplat.svg.document import Document, Element, name_of
from warpsplat.svg.inspect import view_box

START_TAG = re.compile(rb"""<(?:[^>"']|"[^"]*"|'[^']*')*>""")
ATTRIBUTE = re.compile(r"""(?<!\s)\s+([^\s=]+)\s*=\s*("[^"]*"|'[^']*')""")
REFERENCE = re.compile(
    r"""url\(\s*(?:(?:["']|&quot;|&apos;)\s*)?\#([^"'()\s&]+)|href\s*=\s*["']\s*\#([^"']+)["']"""
)
"""A reference to another element."""

ENTITY = re.compile(r"&([^&;\s]+);")

STYLE_OF_ROOTS = re.compile(r"(?<![\w-])(?:x|y|width|height|overflow)\s*:[^;\"']*;?")
OF_ROOTS = frozenset({"x", "y", "width", "height", "version", "baseProfile", "overflow"})
"""Style properties and attributes that change their meaning when the root becomes an inner element."""

RELATIVE = re.compile(r"[+~](?!=)|:(?!hover|active|focus|visited|link)")
"""Selectors that depend on siblings, which may be missing in an excerpt."""


class Excerpts:
    """The excerpts of one document."""

    def __init__(self, text: str, document: Document) -> None:
        """Find the elements of ``document`` in its ``text``.

        Raises:
            ImageError: Entities stand for elements.
        """
        self._document = document
        self._data = text.encode("utf-8", "surrogatepass")
        spans, self._entities = _spans(self._data)
        self._spans = dict(zip(document.root.iter(), spans, strict=True))
        self._places = {element: i for i, element in enumerate(self._spans)}
        self._sheets = [(s[0], s[3]) for element, s in self._spans.items() if name_of(element) == "style"]
        self._named: set[Element] = set()
        """Ancestors whose ``id`` has been written."""

    def _path(self, element: Element) -> list[Element]:
        """Return an element's ancestors, from the root to its parent."""
        return ancestors(element, self._document.parents)[::-1]

    def of(self, elements: Iterable[Element], size: tuple[float, float]) -> str:
        """Return the elements inside their ancestors, in the document's order; ``size``: of its picture."""
        out: list[str] = []
        around: list[Element] = []
        for element in [*sorted(elements, key=self._places.__getitem__), None]:
            path = [] if element is None else self._path(element)
            same = sum(1 for a, b in zip(around, path, strict=False) if a is b)
            out += (self._slice(*self._spans[above][2:]) for above in reversed(around[same:]))
            out += (self._head(above, size) for above in path[same:])
            if element is not None:
                out.append(self._whole(element))
            around = path
        return "".join(out)

    def needed(self, elements: Sequence[Element]) -> list[Element]:
        """Return the elements that the given ones, their ancestors and style sheets refer to."""
        given = {inner for element in elements for inner in element.iter()}
        found: set[Element] = set()
        seen: set[Element] = set()

        def tags(element: Element) -> Iterator[str]:
            """Yield the start tags of an element's descendants and ancestors, each once in all."""
            for one in (*element.iter(), *self._path(element)):
                if one not in seen:
                    seen.add(one)
                    yield self._slice(*self._spans[one][:2])

        todo = [self._document.css, *(tag for element in elements for tag in tags(element))]
        while todo:
            for names in REFERENCE.findall(todo.pop()):
                target = self._document.called(names[0] or names[1].rstrip())
                if target is not None and target not in given and target not in found:
                    found.add(target)
                    todo += tags(target)
        return [element for element in found if not found & set(self._path(element))]

    def style(self, scope: str) -> str:
        """Return the style sheets, restricted to elements inside those of the class ``scope``; may be empty.

        Raises:
            ImageError: A rule depends on elements that may not be in an excerpt.
        """
        at_rules, css = split_at_rules(self._document.css)
        texts = [rule for rule in at_rules if rule.startswith("@font-face")]
        for selectors, body in rules(css):
            for selector in map(str.strip, selectors.split(",")):
                if RELATIVE.search(re.sub(r"\[[^\[\]]*\]", "", selector)):
                    raise ImageError(f"uses the style sheet selector {selector[:40]!r}, which cannot be kept")
            scoped = ",".join(f".{scope} {selector.strip()}" for selector in selectors.split(","))
            texts.append(f"{scoped}{{{body.strip()}}}")
        return f"<style>{escape(''.join(texts), quote=False)}</style>" if texts else ""

    def _slice(self, start: int, end: int) -> str:
        text = self._data[start:end].decode("utf-8", "surrogatepass")
        if not self._entities:
            return text
        return ENTITY.sub(lambda found: self._entities.get(found[1], found[0]), text)

    def _whole(self, element: Element) -> str:
        """Return an element without style sheets, which ``style`` returns."""
        start, _, _, end = self._spans[element]
        parts = []
        for sheet in self._sheets[
            bisect_left(self._sheets, (start, 0)) : bisect_left(self._sheets, (end, 0))
        ]:
            if start <= sheet[0] and sheet[1] <= end:
                parts.append(self._slice(start, sheet[0]))
                start = sheet[1]
        return "".join([*parts, self._slice(start, end)])

    def _head(self, element: Element, size: tuple[float, float]) -> str:
        """Return a start tag, its ``id`` only the first time unless a style sheet asks for it."""
        left_out = set()
        if element in self._named and f"#{element.get('id')}" not in self._document.css:
            left_out.add("id")
        self._named.add(element)
        own = ""
        if element is self._document.root:
            left_out |= OF_ROOTS
            own = f' width="{size[0]:.9g}" height="{size[1]:.9g}" overflow="visible"'
            if view_box(element.attrib) is None:
                left_out.add("viewBox")
                own += f' viewBox="0 0 {size[0]:.9g} {size[1]:.9g}"'
        tag = self._slice(*self._spans[element][:2])
        if element is self._document.root and not re.search(r"\sxmlns\s*=", tag):
            own += ' xmlns=""'
        tag = ATTRIBUTE.sub(lambda found: "" if found[1] in left_out else found[0], tag)
        if element is self._document.root:
            tag = re.sub(
                r"(?<=\sstyle)\s*=\s*(?:\"[^\"]*\"|'[^']*')", lambda s: STYLE_OF_ROOTS.sub("", s[0]), tag
            )
        return f"{tag[:-1].rstrip()}{own}>"


Span = list[int]
"""Where an element's start tag and its end tag, which may be empty, begin and end [bytes]."""


def _spans(data: bytes) -> tuple[list[Span], dict[str, str]]:
    """Return the spans of all elements, in the order in which they begin, and the values of entities."""
    spans: list[Span] = []
    around: list[Span] = []
    entities: dict[str, str] = {}
    parser = expat.ParserCreate("utf-8")

    def start(_: str, __: dict[str, str]) -> None:
        found = START_TAG.match(data, parser.CurrentByteIndex)
        assert found
        around.append([found.start(), found.end()])
        spans.append(around[-1])

    def end(_: str) -> None:
        span = around.pop()
        if data[span[1] - 2 : span[1]] == b"/>":
            span += [span[1], span[1]]
        else:
            at = parser.CurrentByteIndex
            span += [at, data.index(b">", at) + 1]

    def entity(name: str, parameter: int, value: str | None, *_: object) -> None:
        if "<" in (value or ""):
            raise ImageError("uses entities that stand for elements, which cannot be kept")
        if value is not None and not parameter:
            entities.setdefault(name, value)

    parser.StartElementHandler, parser.EndElementHandler, parser.EntityDeclHandler = start, end, entity
    parser.Parse(data, True)
    return spans, entities
