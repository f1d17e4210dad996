"""Optics that users give: how an image was made of sharp shapes."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, get_args

from warpsplat.errors import UsageError, shown

Light = Literal["sRGB", "linear"]
"""In which colours are mixed."""

RADIUS = 5
"""Samples of a kernel on each side of the middle of a pixel."""

RINGS = [(a, b) for a in range(RADIUS) for b in range(a + 1)]
"""Distances of the samples of one weight from the middle of a pixel, along the two sides in any order: 0 is
the nearest. Kernels are symmetric to the axes and diagonals."""

COUNTS = [4 if a == b else 8 for a, b in RINGS]
"""How many samples those are."""

Kernel = tuple[float, ...]
"""A weight for the samples of each of RINGS; those of all samples add up to 1."""

TERMS = 6
"""Number of terms of a polynomial of the second degree: 1, x, y, x², xy, y², where x and y go from -1/2 to
1/2 across and down the image."""

Illumination = tuple[tuple[float, ...], ...]
"""The light on paper, relative to the brightest spot: coefficients of a polynomial for each channel."""

WORDS = ("auto", "none", *get_args(Light))
"""Values of the option that are words."""

WANTED = f"{', '.join(WORDS)} or a report.json of --json"
"""Values of the option, in words."""

NUMBER = r"-?\d+(\.\d+)?(e[-+]?\d+)?"
"""Pattern of a number in the text of optics."""

CHANNELS = 3
"""Number of channels of a scan or a photograph of paper."""

PATTERN = (
    rf"{'|'.join(WORDS)}|({'|'.join(get_args(Light))})(( {NUMBER}){{{len(RINGS)}}})?"
    rf"(( {NUMBER}){{{CHANNELS * TERMS}}})?"
)
"""Values of the option, as ``parse_optics`` returns them."""


@dataclass(frozen=True)
class Optics:
    """How an image was made of sharp shapes; None: to be found."""

    light: Light | None = None
    kernel: Kernel | None = None
    illumination: Illumination | None = None

    @classmethod
    def of(cls, text: str) -> Optics:
        """Return what a value of ``parse_optics`` says is known."""
        light, *rest = text.split()
        numbers = tuple(map(float, rest))
        given = light if light in get_args(Light) else None
        count = len(RINGS) if len(numbers) % TERMS else 0
        kernel, others = numbers[:count], numbers[count:]
        channels = tuple(others[first : first + TERMS] for first in range(0, len(others), TERMS))
        return cls(given, kernel or None, channels or None)  # type: ignore[arg-type]


def parse_optics(value: Any) -> str:
    """Return a word, or optics as those of a report, as a text: light, weights of the kernel, illumination.

    Raises ``UsageError`` for anything else.
    """
    if isinstance(value, Mapping):
        return _text(value)
    if isinstance(value, str) and value.lstrip().startswith("{"):
        try:
            return _text(json.loads(value))
        except ValueError as error:
            raise UsageError(f"optics must be {WANTED}, not {shown(value)}") from error
    return str(value)


def _text(given: Mapping[str, Any]) -> str:
    """Return optics as a text: ``{"light": "linear", "kernel": [[...], ...]}``, or a report that has them."""
    given = given.get("optics", given)
    if not isinstance(given, Mapping) or not given.keys() & {"light", "kernel", "illumination"}:
        raise UsageError("optics must have a light, sRGB or linear, a kernel, or an illumination")
    light, kernel, illumination = given.get("light", "sRGB"), given.get("kernel"), given.get("illumination")
    if light not in get_args(Light):
        raise UsageError(f"the light of optics must be sRGB or linear, not {shown(light)}")
    numbers = [*(() if kernel is None else _weights(kernel))]
    numbers += () if illumination is None else _numbers(illumination, "illumination", CHANNELS, TERMS)
    return " ".join([light, *map(repr, numbers)])


def _numbers(rows: Any, name: str, count: int, length: int) -> list[float]:
    """Return the numbers in ``count`` rows of ``length`` each; raise ``UsageError`` for anything else."""
    known = [row for row in rows if _is_list(row)] if _is_list(rows) else []
    numbers = [float(each) for row in known for each in row if _is_number(each)]
    if [len(row) for row in known] != [length] * count or len(numbers) != count * length:
        raise UsageError(f"the {name} of optics must be {count} rows of {length} numbers, as in a report")
    return numbers


def _weights(kernel: Any) -> Kernel:
    """Return the weights of a kernel's RINGS, which is a quarter of it, shape (RADIUS, RADIUS)."""
    numbers = _numbers(kernel, "kernel", RADIUS, RADIUS)
    rows = [numbers[first : first + RADIUS] for first in range(0, len(numbers), RADIUS)]
    if any(rows[a][b] != rows[b][a] for a, b in RINGS):
        raise UsageError("the kernel of optics must be the same across and down")
    weights = [rows[a][b] for a, b in RINGS]
    total = sum(n * w for n, w in zip(COUNTS, weights, strict=True))
    if abs(total - 1) > 0.01:
        raise UsageError(f"the weights of the kernel of optics must add up to 1/4, not {total / 4:.4g}")
    return tuple(weight / total for weight in weights)


def _is_list(value: Any) -> bool:
    return isinstance(value, Sequence) and not isinstance(value, str)


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value)
