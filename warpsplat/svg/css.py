"""Style sheets: rules, selectors, and the declarations that apply to an element (CSS 2.1, sections 4 to 6).

Selectors may ask for tags, ids, classes, attributes and first children, of descendants and children: the part
of CSS that resvg reads. Matching is linear in the document's depth whatever the selector, unlike matchers
that backtrack.
"""

from __future__ import annotations

import functools
import operator
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import NamedTuple
from xml.etree import ElementTree

from warpsplat.errors import ImageError
from warpsplat.svg.values import check_length

Element = ElementTree.Element
Parents = Mapping[Element, Element]


class Declaration(NamedTuple):
    """A property's value in a rule or a ``style`` attribute."""

    name: str
    value: str
    important: bool


PART = re.compile(r"""(?:[^;"'()]|"[^"]*"|'[^']*'|\([^()]*\))+""")
"""Text up to a semicolon that is not quoted or in brackets."""

IMPORTANT = re.compile(r"!\s*important\s*$", re.IGNORECASE)


def without_comments(css: str) -> str:
    """Return the text without its comments."""
    first, *others = css.split("/*")
    return first + "".join(part.partition("*/")[2] for part in others)


def declarations(text: str) -> Iterator[Declaration]:
    """Yield the declarations of a rule or of a ``style`` attribute.

    Raises:
        ImageError: A declaration has no name: viewers differ in what they skip then.
    """
    for part in PART.findall(without_comments(text)):
        name, _, value = part.partition(":")
        name = name.strip().lower()
        if not part.strip():
            continue
        if not name.replace("-", "").replace("_", "").isalnum():
            raise ImageError(f"style {part.strip()[:40]!r} is invalid")
        found = IMPORTANT.search(value)
        yield Declaration(name, value[: found.start()].strip() if found else value.strip(), found is not None)


AT_RULE = re.compile(r"@(?:charset|namespace)\b[^;{}]{0,1000};|@font-face\s*\{[^{}]*\}")
"""At-rules that style no element. The bound keeps a long row of unterminated ones from being searched to the
end of the text each."""


def split_at_rules(css: str) -> tuple[list[str], str]:
    """Return the at-rules that style no element, and the rest of a sheet; both without comments."""
    css = without_comments(css).replace("<!--", "").replace("-->", "")
    return AT_RULE.findall(css), AT_RULE.sub("", css)


def rules(css: str) -> Iterator[tuple[str, str]]:
    """Yield selectors and declarations of each rule of a text without comments and at-rules."""
    parts = re.split(r"([{}])", css)  # texts, and the braces between them
    for i in range(1, len(parts) - 2, 2):
        if parts[i] == "{" and parts[i + 2] == "}":
            yield parts[i - 1], parts[i + 1]


def ancestors(element: Element, parents: Parents) -> list[Element]:
    """Return the elements around an element, from its parent to the root."""
    found: list[Element] = []
    while element in parents:
        element = parents[element]
        found.append(element)
    return found


def local_name(element: Element) -> str:
    """Return an element's name without its namespace."""
    return str(element.tag).rpartition("}")[2]


@functools.lru_cache(4096)
def _classes(text: str) -> frozenset[str]:
    return frozenset(text.split())


OPERATORS: dict[str, Callable[[str, str], bool]] = {
    "": lambda value, wanted: True,
    "=": operator.eq,
    "~=": lambda value, wanted: wanted in value.split(),
    "|=": lambda value, wanted: value == wanted or value.startswith(f"{wanted}-"),
    "^=": str.startswith,
    "$=": str.endswith,
    "*=": operator.contains,
}
"""Tests of an attribute's value."""

SPECIFICITY = {
    **{"id": (1, 0, 0), "tag": (0, 0, 1)},
    **dict.fromkeys(("class", "attribute", "first"), (0, 1, 0)),
}


class _Condition(NamedTuple):
    """A tag, id, class, attribute or position that a selector asks for."""

    kind: str
    name: str
    operator: str = ""
    value: str = ""

    def holds(self, element: Element, parents: Parents) -> bool:
        if self.kind == "tag":
            return local_name(element) == self.name
        if self.kind == "id":
            return element.get("id") == self.name
        if self.kind == "class":
            return self.name in _classes(element.get("class", ""))
        if self.kind == "first":
            return element not in parents or parents[element][0] is element
        value = element.get(self.name)
        return value is not None and OPERATORS[self.operator](value, self.value)


KEYS = {"id": "#", "class": ".", "tag": ""}
"""Marks before the names by which rules are found, the rarest first."""


class _Compound(NamedTuple):
    """Conditions on one element."""

    conditions: list[_Condition]
    is_child: bool
    """Whether the compound before is about the element's parent, rather than any ancestor."""

    def matches(self, element: Element, parents: Parents) -> bool:
        return all(condition.holds(element, parents) for condition in self.conditions)

    def key(self) -> str:
        """Return an id, class or tag that the element must have; empty: none."""
        names = {condition.kind: condition.name for condition in reversed(self.conditions)}
        return next((mark + names[kind] for kind, mark in KEYS.items() if kind in names), "")


STEP = re.compile(
    r"""(?P<combinator>\s*>\s*|\s+)|\#(?P<id>[\w-]+)|\.(?P<class>[\w-]+)|(?P<tag>\*|[\w-]+)"""
    r"""|:(?P<first>first-child)|\[\s*(?P<attribute>[\w:-]+)\s*"""
    r"""(?:(?P<operator>[~|^$*]?=)\s*(?P<value>"[^"]*"|'[^']*'|[\w-]+)\s*)?\]"""
)


def _parse_selector(selector: str) -> list[_Compound]:
    """Return the compounds of a selector from left to right.

    Raises:
        ImageError: The selector is of a kind that is not supported.
    """
    refusal = ImageError(f"uses the style sheet selector {selector[:40]!r}, not supported")
    compounds, is_empty, position = [_Compound([], False)], True, 0
    while position < len(selector):
        found = STEP.match(selector, position)
        if not found or (found["combinator"] and is_empty) or (found["tag"] and not is_empty):
            raise refusal
        position, is_empty = found.end(), bool(found["combinator"])
        if is_empty:
            compounds.append(_Compound([], ">" in found["combinator"]))
        elif found["tag"] != "*":
            kind = next(kind for kind in SPECIFICITY if found[kind])
            value = (found["value"] or "").strip("\"'")
            compounds[-1].conditions.append(_Condition(kind, found[kind], found["operator"] or "", value))
    if is_empty:
        raise refusal
    return compounds


class _Rule(NamedTuple):
    compounds: list[_Compound]
    declarations: tuple[Declaration, ...]
    order: tuple[tuple[int, ...], int]
    """Specificity and place in the sheet."""

    reads_attributes: bool

    def matches(self, element: Element, parents: Parents) -> bool:
        *outer, last = self.compounds
        if not outer or not last.matches(element, parents):
            return last.matches(element, parents)
        # From the root inwards: whether the first i compounds match, the last of them at the node above, or
        # at any node above.
        above = [True] + len(outer) * [False]
        inside = [*above]
        for node in reversed(ancestors(element, parents)):
            here = [False] * len(above)
            for i, compound in enumerate(outer):
                before = above[i] if compound.is_child else inside[i]
                here[i + 1] = before and compound.matches(node, parents)
            inside = [a or b for a, b in zip(inside, here, strict=True)]
            above = here
        return above[-1] if last.is_child else inside[-1]


ANIMATED = "uses animation, not supported: take the still SVG of the same picture"


class StyleSheet:
    """The rules of an SVG's ``style`` elements."""

    def __init__(self, css: str, known: frozenset[str]) -> None:
        """Parse a sheet, of which only the properties ``known`` count.

        Raises:
            ImageError: Unsupported at-rules, or selectors that set such properties.
        """
        self._rules: dict[str, list[_Rule]] = {}
        """By ``_Compound.key`` of the last compound."""
        self._work = 0
        _, css = split_at_rules(css)
        if "@keyframes" in css:
            raise ImageError(ANIMATED)
        if "@" in css:
            raise ImageError("uses a style sheet with @-rules, not supported")
        for place, (selectors, body) in enumerate(rules(css)):
            own = tuple(d for d in declarations(body) if d.name in known)
            for one in own:
                check_length(one.name, one.value)
            for selector in selectors.split(",") if own else ():
                compounds = _parse_selector(selector.strip())
                kinds = [one.kind for compound in compounds for one in compound.conditions]
                weight = tuple(map(sum, zip((0, 0, 0), *(SPECIFICITY[kind] for kind in kinds), strict=True)))
                rule = _Rule(compounds, own, (weight, place), "attribute" in kinds)
                self._rules.setdefault(compounds[-1].key(), []).append(rule)

    def of(self, element: Element, parents: Parents) -> Sequence[Declaration]:
        """Return the declarations that apply to an element, the strongest last.

        Raises:
            ImageError: There are too many rules for too many elements.
        """
        if not self._rules:
            return ()
        keys = ["", local_name(element), f"#{element.get('id', '')}"]
        keys += [f".{name}" for name in _classes(element.get("class", ""))]
        asked = [rule for key in keys for rule in self._rules.get(key, ())]
        is_nested = any(len(rule.compounds) > 1 for rule in asked)
        depth = len(ancestors(element, parents)) if is_nested else 0
        characters = 100  # characters of an attribute that take as long to test as an element
        text = sum(map(len, element.attrib.values())) // characters
        self._work += sum(1 + text * one.reads_attributes + depth * (len(one.compounds) - 1) for one in asked)
        # Most tests of elements to find the rules that apply to them: with plain selectors, rules times
        # elements.
        max_work = 5_000_000
        if self._work > max_work:
            raise ImageError("has too many style rules for its number of elements")
        matching = [rule for rule in asked if rule.matches(element, parents)]
        declaration_work = 10  # tests of an element that take as long as applying a rule
        self._work += declaration_work * len(matching)
        return [d for rule in sorted(matching, key=lambda rule: rule.order) for d in rule.declarations]
