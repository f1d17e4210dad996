"""Parts of a document's text: elements as they stand, with what they need to look the same elsewhere."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from xml.parsers import expat
from xml.sax.saxutils import escape

from warpsplat.errors import ImageError
from warpsplat.svg.css import RULE, without_comments
from warpsplat.svg.document import Document, Element, name_of
from warpsplat.svg.inspect import view_box

HEAD = re.compile(rb"""<(?:[^>"']|"[^"]*"|'[^']*')*>""")
ATTRIBUTE = re.compile(r"""\s+([^\s=]+)\s*=\s*("[^"]*"|'[^']*')""")
REFERENCE = re.compile(
    r"""url\(\s*(?:["']|&quot;|&apos;)?\s*\#([^"'()\s&]+)|href\s*=\s*["']\s*\#([^"']+?)\s*["']"""
)
"""Mention of another element."""

STYLE_OF_ROOTS = re.compile(r"(?<![\w-])(?:x|y|width|height|overflow)\s*:[^;\"']*;?")
OF_ROOTS = frozenset({"x", "y", "width", "height", "version", "baseProfile", "overflow"})
"""What means nothing, or something else, where a root has become an element: in its style, and attributes."""

AT_RULE = re.compile(r"@(?:charset|namespace)\b[^;{}]*;|@font-face\s*\{[^{}]*\}")
RELATIVE = re.compile(r"[+~](?!=)|:(?!hover|active|focus|visited|link)")
"""Selectors that ask which elements lie before others, some of which are not in an excerpt."""


class Excerpts:
    """Makes them of one document."""

    def __init__(self, text: str, document: Document) -> None:
        """``text``: that of the document.

        Raises:
            ImageError: entities stand for elements.
        """
        self._document = document
        self._data = text.encode("utf-8", "surrogatepass")
        spans, self._entities = _spans(self._data)
        self._spans = dict(zip(document.root.iter(), spans, strict=True))
        self._places = {element: i for i, element in enumerate(self._spans)}
        self._sheets = [(s[0], s[3]) for element, s in self._spans.items() if name_of(element) == "style"]
        self._named: set[Element] = set()
        """Ancestors whose ``id`` has been written."""

    def path(self, element: Element) -> list[Element]:
        """What an element is in, from the root to its parent."""
        above: list[Element] = []
        while element in self._document.parents:
            element = self._document.parents[element]
            above.append(element)
        return above[::-1]

    def of(self, elements: Iterable[Element], size: tuple[float, float]) -> str:
        """The elements within those that they are in, in the document's order; ``size``: of its picture."""
        out: list[str] = []
        around: list[Element] = []
        for element in [*sorted(elements, key=self._places.__getitem__), None]:
            path = [] if element is None else self.path(element)
            same = sum(1 for a, b in zip(around, path, strict=False) if a is b)
            out += (self._tail(above) for above in reversed(around[same:]))
            out += (self._head(above, size) for above in path[same:])
            if element is not None:
                out.append(self._whole(element))
            around = path
        return "".join(out)

    def needed(self, elements: Sequence[Element]) -> list[Element]:
        """What the elements, those that they are in, and style sheets refer to."""
        given = {inner for element in elements for inner in element.iter()}
        found: set[Element] = set()
        todo = [self._document.css, *(text for element in elements for text in self._texts(element))]
        while todo:
            for names in REFERENCE.findall(todo.pop()):
                target = self._document.called(names[0] or names[1])
                if target is not None and target not in given and target not in found:
                    found.add(target)
                    todo += self._texts(target)
        return [element for element in found if not found & set(self.path(element))]

    def style(self, scope: str) -> str:
        """The style sheets, their rules for what is in elements of the class ``scope`` only; may be empty.

        Raises:
            ImageError: rules that ask for what is not in an excerpt.
        """
        css = without_comments(self._document.css).replace("<!--", "").replace("-->", "")
        rules = [rule for rule in AT_RULE.findall(css) if rule.startswith("@font-face")]
        for selectors, body in RULE.findall(AT_RULE.sub("", css)):
            for selector in map(str.strip, selectors.split(",")):
                if RELATIVE.search(re.sub(r"\[[^\]]*\]", "", selector)):
                    raise ImageError(f"uses the style sheet selector {selector[:40]!r}, which cannot be kept")
            scoped = ",".join(f".{scope} {selector.strip()}" for selector in selectors.split(","))
            rules.append(f"{scoped}{{{body.strip()}}}")
        return f"<style>{escape(''.join(rules))}</style>" if rules else ""

    def _texts(self, element: Element) -> list[str]:
        return [self._whole(element), *(self._slice(*self._spans[above][:2]) for above in self.path(element))]

    def _slice(self, start: int, end: int) -> str:
        text = self._data[start:end].decode("utf-8", "surrogatepass")
        for name, value in self._entities.items():
            text = text.replace(f"&{name};", value)
        return text

    def _whole(self, element: Element) -> str:
        """An element without style sheets, which ``style`` has."""
        start, _, _, end = self._spans[element]
        parts = []
        for sheet_start, sheet_end in self._sheets:
            if start <= sheet_start and sheet_end <= end:
                parts.append(self._slice(start, sheet_start))
                start = sheet_end
        return "".join([*parts, self._slice(start, end)])

    def _tail(self, element: Element) -> str:
        return self._slice(*self._spans[element][2:])

    def _head(self, element: Element, size: tuple[float, float]) -> str:
        """A start tag; a name is said once, but where a style sheet asks for it."""
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


Span = tuple[int, int, int, int]
"""Where an element's start tag begins and ends, and its end tag; alike where it has none [bytes]."""


def _spans(data: bytes) -> tuple[list[Span], dict[str, str]]:
    """Places of all elements, in the order in which they begin; and the values of entities."""
    spans: list[list[int]] = []
    around: list[list[int]] = []
    entities: dict[str, str] = {}
    parser = expat.ParserCreate("utf-8")

    def start(_: str, __: dict[str, str]) -> None:
        found = HEAD.match(data, parser.CurrentByteIndex)
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
    return [(a, b, c, d) for a, b, c, d in spans], entities
