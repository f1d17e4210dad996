"""Style of SVG elements: attributes, style sheets and ``style``, as far as shapes of one colour need it."""

from __future__ import annotations

import colorsys
from collections.abc import Iterator, Mapping

from PIL import ImageColor

from warpsplat.errors import ImageError
from warpsplat.svg.inspect import LENGTH, NUMBER, PIXELS_PER_UNIT

INHERITED = {
    "color": "black",
    "fill": "black",
    "fill-opacity": "1",
    "fill-rule": "nonzero",
    "marker": "none",
    "marker-end": "none",
    "marker-mid": "none",
    "marker-start": "none",
    "shape-rendering": "auto",
    "stroke": "none",
    "stroke-dasharray": "none",
    "stroke-linecap": "butt",
    "stroke-linejoin": "miter",
    "stroke-opacity": "1",
    "stroke-width": "1",
    "visibility": "visible",
}
"""Properties that children take over, and what they are at the root."""

OWN = {
    "clip-path": "none",
    "display": "inline",
    "filter": "none",
    "mask": "none",
    "mix-blend-mode": "normal",
    "opacity": "1",
    "transform": "none",
    "transform-origin": "none",
    "vector-effect": "none",
}
"""Properties of an element alone. Isolation is none of them: without blend modes it shows nothing."""

Style = dict[str, str]


def declarations(text: str) -> Iterator[tuple[str, str]]:
    """Names and values of those declarations of a style that mean something here.

    Raises:
        ImageError: one has no name: viewers differ in what they skip then.
    """
    for part in text.split(";"):
        name, _, value = part.partition(":")
        name = name.strip().lower()
        if part.strip() and not name.replace("-", "").replace("_", "").isalnum():
            raise ImageError(f"style {part.strip()[:40]!r} is broken")
        if name in INHERITED or name in OWN:
            yield name, value.strip()


class StyleSheet:
    """The rules of an SVG's ``style`` elements; selectors are a class, an id, an element's name or ``*``.

    Raises:
        ImageError: other selectors, at-rules or priorities, where they are about what is drawn here.
    """

    def __init__(self, css: str) -> None:
        first, *others = css.split("/*")
        css = first + "".join(part.partition("*/")[2] for part in others)
        self._rules: dict[str, dict[str, tuple[int, str]]] = {}
        """By selector and property: the place of the last such rule, and the value."""
        for place, rule in enumerate(css.split("}")):
            selectors, _, body = rule.partition("{")
            if "@" in selectors:
                raise ImageError("uses a style sheet with @-rules, not supported")
            values = [(name, (place, value)) for name, value in declarations(body)]
            if not values:
                continue
            for selector in selectors.split(","):
                name = selector.strip()
                if not name or not (
                    name == "*" or name.lstrip(".#").replace("-", "").replace("_", "").isalnum()
                ):
                    raise ImageError(f"uses the style sheet selector {name[:40]!r}, not supported")
                self._rules.setdefault(name, {}).update(values)

    def of(self, tag: str, attributes: Mapping[str, str]) -> Style:
        """What the rules say of an element."""
        style: Style = {}
        if not self._rules:
            return style
        classes = [f".{name}" for name in attributes.get("class", "").split()]
        for level in (["*"], [tag], classes, [f"#{attributes.get('id', '')}"]):
            found: dict[str, tuple[int, str]] = {}
            for selector in level:
                for name, value in self._rules.get(selector, {}).items():
                    found[name] = max(value, found.get(name, value))
            style.update((name, value) for name, (_, value) in found.items())
        return style


def element_style(tag: str, attributes: Mapping[str, str], sheet: StyleSheet, inherited: Style) -> Style:
    """All properties of an element.

    Raises:
        ImageError: one of them shows what shapes of one colour cannot.
    """
    own: Style = {
        name: value.strip() for name, value in attributes.items() if name in INHERITED or name in OWN
    }
    own.update(sheet.of(tag, attributes))
    own.update(declarations(attributes.get("style", "")))
    style = {**inherited, **OWN}
    for name, value in own.items():
        if "!important" in value:
            raise ImageError("uses !important, not supported")
        if not (value == "inherit" and name in INHERITED):
            style[name] = value
    for name in ("clip-path", "mask", "filter", "mix-blend-mode", "transform-origin"):
        if style[name] != OWN[name]:
            raise ImageError(f"uses {name}, not supported")
    return style


def inherit(style: Style) -> Style:
    """What the children of an element of this style take over."""
    return {name: style[name] for name in INHERITED}


def fraction(style: Style, name: str) -> float:
    """An opacity: a number or a percentage, in 0..1.

    Raises:
        ImageError: neither.
    """
    text = style[name]
    number = text.removesuffix("%")
    if not NUMBER.fullmatch(number):
        raise ImageError(f"{name} {text[:40]!r} is not a number")
    return min(max(float(number) / (100 if text.endswith("%") else 1), 0.0), 1.0)


def length(text: str, reference: float, name: str) -> float:
    """A length [user units]; percentages are of ``reference``.

    Raises:
        ImageError: not a length of a unit that does not depend on fonts.
    """
    found = LENGTH.fullmatch(text.strip())
    if not found or found[2] in {"em", "ex"}:
        raise ImageError(f"{name} {text[:40]!r} is not a number with a unit that is supported")
    return float(found[1]) * (reference / 100 if found[2] == "%" else PIXELS_PER_UNIT[found[2]])


Color = tuple[float, float, float]


def parse_color(text: str) -> tuple[Color, float]:
    """An SVG colour as sRGB in 0..1, and its opacity.

    Raises:
        ImageError: a gradient, a pattern, or nothing that is a colour.
    """
    if "url(" in text:
        raise ImageError("uses a gradient or pattern, not supported")
    name = text.strip().lower()
    if name == "transparent":
        return (0.0, 0.0, 0.0), 0.0
    if name in ImageColor.colormap:
        red, green, blue = ImageColor.getrgb(name)[:3]
        return (red / 255, green / 255, blue / 255), 1.0
    color = _hex(name[1:]) if name.startswith("#") else _function(name)
    if color is None:
        raise ImageError(f"{text[:40]!r} is not a colour that is supported")
    return color


def _hex(digits: str) -> tuple[Color, float] | None:
    if len(digits) in {3, 4}:
        digits = "".join(2 * digit for digit in digits)
    if len(digits) not in {6, 8} or digits.strip("0123456789abcdef"):
        return None
    red, green, blue, alpha = bytes.fromhex(f"{digits}ff"[:8])
    return (red / 255, green / 255, blue / 255), alpha / 255


def _function(text: str) -> tuple[Color, float] | None:
    kind, _, inner = text.removesuffix(")").partition("(")
    parts = inner.replace(",", " ").replace("/", " ").split()
    numbers = [part.removesuffix("%").removesuffix("deg") for part in parts]
    if len(parts) not in {3, 4} or not all(NUMBER.fullmatch(number) for number in numbers):
        return None
    percent = [part.endswith("%") for part in parts]
    values = [
        float(number) / (100 if is_part else 1) for number, is_part in zip(numbers, percent, strict=True)
    ]
    alpha = min(max(values[3], 0.0), 1.0) if len(values) == 4 else 1.0
    if kind in {"rgb", "rgba"}:
        whole = [value if is_part else value / 255 for value, is_part in zip(values, percent, strict=True)]
        red, green, blue = (round(255 * min(max(value, 0.0), 1.0)) / 255 for value in whole[:3])
        return (red, green, blue), alpha
    if kind in {"hsl", "hsla"} and percent[1] and percent[2]:
        saturation, light = (min(max(value, 0.0), 1.0) for value in values[1:3])
        return colorsys.hls_to_rgb(values[0] / 360 % 1, light, saturation), alpha
    return None
