"""Style sheets: rules, selectors and which of them say something of an element (CSS 2.1, sections 4 to 6)."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple
from xml.etree import ElementTree

from warpsplat.errors import ImageError
from warpsplat.svg.values import check_length

Parents = Mapping[ElementTree.Element, ElementTree.Element]
Classes = Callable[[ElementTree.Element], frozenset[str]]


class Declaration(NamedTuple):
    """What a rule or a ``style`` attribute says of a property."""

    name: str
    value: str
    important: bool


PART = re.compile(r"""(?:[^;"'()]|"[^"]*"|'[^']*'|\([^()]*\))+""")
"""Text up to a semicolon that is not quoted or in brackets."""

IMPORTANT = re.compile(r"!\s*important\s*$", re.IGNORECASE)


def without_comments(css: str) -> str:
    """The text without its comments."""
    first, *others = css.split("/*")
    return first + "".join(part.partition("*/")[2] for part in others)


def declarations(text: str) -> Iterator[Declaration]:
    """The declarations of a rule or of a ``style`` attribute.

    Raises:
        ImageError: one has no name: viewers differ in what they skip then.
    """
    for part in PART.findall(without_comments(text)):
        name, _, value = part.partition(":")
        name = name.strip().lower()
        if not part.strip():
            continue
        if not name.replace("-", "").replace("_", "").isalnum():
            raise ImageError(f"style {part.strip()[:40]!r} is broken")
        found = IMPORTANT.search(value)
        yield Declaration(name, value[: found.start()].strip() if found else value.strip(), found is not None)


@dataclass(frozen=True)
class _Compound:
    """Conditions on one element."""

    tag: str
    """Empty: any."""
    ids: tuple[str, ...]
    classes: tuple[str, ...]
    attributes: tuple[tuple[str, str, str], ...]
    """Name, operator (empty: it is there) and value."""
    is_first: bool
    is_child: bool
    """Of an element that the compound before is about; else only inside it."""

    def matches(self, element: ElementTree.Element, parents: Parents, classes: Classes) -> bool:
        if self.tag and str(element.tag).rpartition("}")[2] != self.tag:
            return False
        if any(element.get("id") != name for name in self.ids):
            return False
        if self.classes and not classes(element).issuperset(self.classes):
            return False
        if self.is_first and element in parents and parents[element][0] is not element:
            return False
        return all(_attribute_matches(element.get(name), how, what) for name, how, what in self.attributes)

    def weight(self) -> tuple[int, int, int]:
        return len(self.ids), len(self.classes) + len(self.attributes) + self.is_first, int(self.tag != "")


def _attribute_matches(value: str | None, operator: str, wanted: str) -> bool:
    if value is None:
        return False
    if operator == "~=":
        return wanted in value.split()
    if operator == "|=":
        return value == wanted or value.startswith(f"{wanted}-")
    if operator == "^=":
        return value.startswith(wanted)
    if operator == "$=":
        return value.endswith(wanted)
    if operator == "*=":
        return wanted in value
    return not operator or value == wanted


STEP = re.compile(
    r"""(?P<child>\s*>\s*)|(?P<inside>\s+)|\#(?P<id>[\w-]+)|\.(?P<class>[\w-]+)|(?P<tag>\*|[\w-]+)"""
    r"""|\[\s*(?P<name>[\w:-]+)\s*(?:(?P<how>[~|^$*]?=)\s*(?P<what>"[^"]*"|'[^']*'|[\w-]+)\s*)?\]"""
    r"""|:(?P<first>first-child)"""
)


def _compounds(selector: str) -> tuple[_Compound, ...]:
    """The parts of a selector from left to right.

    Raises:
        ImageError: a selector of a kind that is not read.
    """
    refusal = ImageError(f"uses the style sheet selector {selector[:40]!r}, not supported")
    result: list[_Compound] = []
    parts: list[re.Match[str]] = []
    is_child = False

    def finish() -> None:
        if not parts or any(part["tag"] for part in parts[1:]):
            raise refusal
        result.append(
            _Compound(
                (parts[0]["tag"] or "").replace("*", ""),
                tuple(part["id"] for part in parts if part["id"]),
                tuple(part["class"] for part in parts if part["class"]),
                tuple(
                    (p["name"], p["how"] or "", (p["what"] or "").strip("\"'")) for p in parts if p["name"]
                ),
                any(part["first"] for part in parts),
                is_child,
            )
        )
        parts.clear()

    position = 0
    while position < len(selector):
        found = STEP.match(selector, position)
        if not found:
            raise refusal
        position = found.end()
        if found["child"] or found["inside"]:
            finish()
            is_child = bool(found["child"])
        else:
            parts.append(found)
    finish()
    return tuple(result)


@dataclass(frozen=True)
class _Rule:
    compounds: tuple[_Compound, ...]
    declarations: tuple[Declaration, ...]
    order: tuple[tuple[int, ...], int]
    """Specificity and place in the sheet."""

    @property
    def reads_text(self) -> bool:
        """Whether it looks into values of attributes."""
        return any(compound.attributes for compound in self.compounds)

    def matches(self, element: ElementTree.Element, parents: Parents, classes: Classes) -> bool:
        *outer, last = self.compounds
        if not last.matches(element, parents, classes):
            return False
        if not outer:
            return True
        path = [element]
        while path[-1] in parents:
            path.append(parents[path[-1]])
        # Whether the compounds up to each match, the last of them at or above an element of the path.
        inside = [True] + len(outer) * [False]
        above = [False] * (len(outer) + 1)
        for node in reversed(path[1:]):
            here = [False] * (len(outer) + 1)
            for i, compound in enumerate(outer):
                before = above[i] if compound.is_child else inside[i]
                here[i + 1] = before and compound.matches(node, parents, classes)
            inside = [a or b for a, b in zip(inside, here, strict=True)]
            above = here
        return above[-1] if last.is_child else inside[-1]


ANIMATED = "uses animation, not supported: take the still SVG of the same picture"

AT_RULE = re.compile(r"@(?:charset|namespace)\b[^;{}]{0,1000};|@font-face\s*\{[^{}]*\}")
"""Those that say nothing of elements. Without a bound, each of many that do not end is looked through to the
end of the text."""


def rules(css: str) -> Iterator[tuple[str, str]]:
    """Selectors and declarations of each rule of a text without comments and at-rules."""
    parts = re.split(r"([{}])", css)  # texts, and what stands between them
    for i in range(1, len(parts) - 2, 2):
        if parts[i] == "{" and parts[i + 2] == "}":
            yield parts[i - 1], parts[i + 1]


MAX_WORK = 5_000_000
"""Most looks at elements to find out which rules say something of them: they are as many as rules times
elements where selectors are plain."""


class StyleSheet:
    """The rules of an SVG's ``style`` elements.

    Selectors may name elements, classes, ids, attributes and first children, of children and descendants.
    """

    def __init__(self, css: str, known: frozenset[str]) -> None:
        """Of the properties ``known``.

        Raises:
            ImageError: other selectors or at-rules, where they are about such properties.
        """
        self._rules: dict[str, list[_Rule]] = {}
        """By what the last compound asks for first."""
        self._classes: dict[ElementTree.Element, frozenset[str]] = {}
        self._work = 0
        css = AT_RULE.sub("", without_comments(css).replace("<!--", "").replace("-->", ""))
        if "@keyframes" in css:
            raise ImageError(ANIMATED)
        if "@" in css:
            raise ImageError("uses a style sheet with @-rules, not supported")
        for place, (selectors, body) in enumerate(rules(css)):
            said = tuple(d for d in declarations(body) if d.name in known)
            for one in said:
                check_length(one.name, one.value)
            for selector in selectors.split(",") if said else ():
                compounds = _compounds(selector.strip())
                weight = tuple(map(sum, zip(*(c.weight() for c in compounds), strict=True)))
                self._rules.setdefault(_key(compounds[-1]), []).append(
                    _Rule(compounds, said, (weight, place))
                )

    def of(self, element: ElementTree.Element, parents: Parents) -> Sequence[Declaration]:
        """Return the declarations that apply to an element, the strongest last.

        Raises:
            ImageError: there are too many rules for too many elements.
        """
        if not self._rules:
            return ()
        keys = ["", str(element.tag).rpartition("}")[2], f"#{element.get('id', '')}"]
        keys += [f".{name}" for name in self._classes_of(element)]
        asked = [rule for key in keys for rule in self._rules.get(key, ())]
        depth = _depth(element, parents) if any(len(rule.compounds) > 1 for rule in asked) else 0
        text = sum(map(len, element.attrib.values())) // CHARACTERS
        self._work += sum(1 + text * rule.reads_text + depth * (len(rule.compounds) - 1) for rule in asked)
        if self._work > MAX_WORK:
            raise ImageError("has a style sheet of too many rules for its elements")
        said = [rule for rule in asked if rule.matches(element, parents, self._classes_of)]
        self._work += SAID * len(said)
        return [d for rule in sorted(said, key=lambda rule: rule.order) for d in rule.declarations]

    def _classes_of(self, element: ElementTree.Element) -> frozenset[str]:
        if element not in self._classes:
            self._classes[element] = frozenset(element.get("class", "").split())
        return self._classes[element]


SAID = 10
"""Looks at elements that take as long as what a rule says does."""

CHARACTERS = 100
"""Characters of an attribute that take as long to check as an element."""


def _depth(element: ElementTree.Element, parents: Parents) -> int:
    depth = 0
    while element in parents:
        element = parents[element]
        depth += 1
    return depth


def _key(compound: _Compound) -> str:
    if compound.ids:
        return f"#{compound.ids[0]}"
    return f".{compound.classes[0]}" if compound.classes else compound.tag
