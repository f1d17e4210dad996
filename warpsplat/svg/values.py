"""Values of SVG attributes and properties: numbers, lengths, opacities, colours."""

from __future__ import annotations

import colorsys
import math
import re
from dataclasses import dataclass

from PIL import ImageColor

from warpsplat.errors import ImageError
from warpsplat.svg.inspect import LENGTH, NUMBER, PIXELS_PER_UNIT

OTHER_UNITS = re.compile(
    rf"{NUMBER.pattern}(q|ch|cap|ic|lh|rem|rlh|r?ex|vw|vh|vi|vb|vmin|vmax|[sld]v\w+|cq\w+)", re.IGNORECASE
)
"""Lengths of CSS that resvg does not support."""


@dataclass(frozen=True)
class SvgViewport:
    """The lengths that percentages and font units refer to."""

    width: float
    """[user units]"""
    height: float
    """[user units]"""
    font_size: float = 16.0
    """[user units]"""

    @property
    def diagonal(self) -> float:
        """The reference of percentages that are neither horizontal nor vertical (SVG 1.1, 7.10)."""
        return math.sqrt((self.width * self.width + self.height * self.height) / 2)


MAX_VALUE = 1000
"""Longest value [characters] that many elements may inherit from one: each of them parses it."""


def check_length(name: str, value: str) -> None:
    """Raise ``ImageError`` for a value of more than ``MAX_VALUE`` characters."""
    if len(value) > MAX_VALUE:
        raise ImageError(f"says {name} in more than {MAX_VALUE} characters, not supported")


def length(text: str, reference: float, name: str, font_size: float = 16.0) -> float | None:
    """Return a length [user units], or None if the text is none; percentages are of ``reference``.

    Raises:
        ImageError: The unit is one that only some viewers support.
    """
    text = text.strip()
    found = LENGTH.fullmatch(text)
    if not found:
        if OTHER_UNITS.fullmatch(text) or "(" in text:
            raise ImageError(f"{name} {text[:40]!r} is not a number with a unit that is supported")
        return None
    number, unit = float(found[1]), found[2]
    if unit in {"em", "ex"}:
        return number * font_size * (1.0 if unit == "em" else 0.5)
    return number * (reference / 100 if unit == "%" else PIXELS_PER_UNIT[unit])


def lengths(text: str, reference: float, name: str, font_size: float) -> list[float]:
    """Return a list of lengths up to the first that is none; raises as ``length`` does."""
    values: list[float] = []
    for part in text.replace(",", " ").split():
        value = length(part, reference, name, font_size)
        if value is None:
            break
        values.append(value)
    return values


def fraction(text: str) -> float:
    """Return an opacity in [0, 1]: a number or a percentage; 1 for what is neither."""
    text = text.strip()
    number = text.removesuffix("%")
    if not NUMBER.fullmatch(number):
        return 1.0
    return min(max(float(number) / (100 if text.endswith("%") else 1), 0.0), 1.0)


Color = tuple[float, float, float]

UNSURE = re.compile(
    r"(rgba?|hsla?|hwb|(ok)?lab|(ok)?lch|color|color-mix|device-cmyk|light-dark)\s*\(|rebeccapurple|.*icc-color\("
)
"""Colours that some viewers support, but resvg does not."""


HEX = re.compile("#(?:[0-9a-f]{3,4}|[0-9a-f]{6}|[0-9a-f]{8})")


def parse_color(text: str) -> tuple[Color, float] | None:
    """Return an SVG colour as sRGB in [0, 1], and its opacity; None for what is no colour.

    Raises:
        ImageError: The colour is one that only some viewers support.
    """
    name = text.strip().lower()
    if name == "transparent":
        return (0.0, 0.0, 0.0), 0.0
    if (name in ImageColor.colormap and name != "rebeccapurple") or HEX.fullmatch(name):
        red, green, blue, alpha = (*ImageColor.getrgb(name), 255)[:4]
        return (red / 255, green / 255, blue / 255), alpha / 255
    color = _function(name)
    if color is None and UNSURE.match(name):
        raise ImageError(f"{text[:40]!r} is not a colour that is supported")
    return color


FUNCTION = re.compile(r"(rgb|hsl)a?\(([^()]*)\)")


def _function(text: str) -> tuple[Color, float] | None:
    found = FUNCTION.fullmatch(text)
    parts = found[2].replace(",", " ").split() if found else []
    percent = [part.endswith("%") for part in parts]
    digits = [part.removesuffix("%") for part in parts]
    if len(parts) not in {3, 4} or percent[3:] == [True] or not all(map(NUMBER.fullmatch, digits)):
        return None
    values = [float(number) / (100 if share else 1) for number, share in zip(digits, percent, strict=True)]
    alpha = min(max(values[3], 0.0), 1.0) if len(values) == 4 else 1.0
    if found and found[1] == "rgb" and len(set(percent[:3])) == 1:
        red, green, blue = (
            round(255 * min(max(value if percent[0] else value / 255, 0.0), 1.0)) / 255
            for value in values[:3]
        )
        return (red, green, blue), alpha
    if found and found[1] == "hsl" and percent[:3] == [False, True, True]:
        saturation, light = (min(max(value, 0.0), 1.0) for value in values[1:3])
        return colorsys.hls_to_rgb(values[0] / 360 % 1, light, saturation), alpha
    return None
