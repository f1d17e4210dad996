"""Settings as users write them: times, sizes, lists."""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import TypeGuard

from warpsplat.errors import UsageError, shown

DURATION = re.compile(r"(\d+(?:\.\d+)?)\s*(ms|s|sec|m|min|h)?", re.IGNORECASE)
SIZE = re.compile(r"(\d+(?:\.\d+)?)\s*(k|kb|kib|m|mb|mib|g|gb|gib|b)?", re.IGNORECASE)
UNITS = {"ms": 1e-3, "s": 1, "sec": 1, "m": 60, "min": 60, "h": 3600}
BYTES = {
    **{"b": 1, "k": 1e3, "kb": 1e3, "kib": 1024, "m": 1e6, "mb": 1e6, "mib": 1024**2},
    **{"g": 1e9, "gb": 1e9, "gib": 1024**3},
}
MAX_DIGITS = 15
"""Digits of a time or size in a text: beyond, it is a slip of the keys."""


def _words(value: object) -> str:
    """Return a text itself; of anything else as much as can be right."""
    return value if isinstance(value, str) else shown(value)


def _is_list(value: object) -> TypeGuard[Iterable[object]]:
    return isinstance(value, Iterable) and not isinstance(value, (str, bytes))


def parse_duration(value: str | float) -> float:
    """Return the seconds of ``60``, ``60s``, ``2m`` or ``1.5h``.

    Raises:
        UsageError: none of these.
    """
    found = DURATION.fullmatch(_words(value).strip())
    if isinstance(value, bool) or not found or len(found[1]) > MAX_DIGITS:
        raise UsageError(f"not a time: {shown(value)}; write 60s or 2m")
    return float(found[1]) * UNITS[(found[2] or "s").lower()]


def parse_bytes(value: str | int) -> int:
    """Return the bytes of ``100000``, ``100KB`` or ``1MiB``.

    Raises:
        UsageError: none of these.
    """
    found = SIZE.fullmatch(_words(value).strip())
    if isinstance(value, bool) or not found or len(found[1]) > MAX_DIGITS:
        raise UsageError(f"not a size: {shown(value)}; write 100KB, 1MB or 1GB")
    return int(float(found[1]) * BYTES[(found[2] or "b").lower()])


def parse_levels(value: object) -> tuple[int, ...]:
    """Return the numbers of ``64,256,1024``, or of a list.

    Raises:
        UsageError: something else.
    """
    parts = value if _is_list(value) else _words(value).split(",")
    try:
        return tuple(int(str(part)) for part in parts)
    except ValueError as error:
        raise UsageError(f"levels must be numbers of shapes as 64,256,1024, not {shown(value)}") from error


PALETTE_COLOR = re.compile(r"#([0-9a-fA-F]{3}|[0-9a-fA-F]{6})")


def parse_palette(value: object) -> tuple[str, ...]:
    """Return ``#f00,#00ff00``, or a list, as ``("#ff0000", "#00ff00")``: each once, in order.

    Raises:
        UsageError: something else.
    """
    parts = value if _is_list(value) else re.split(r"[,\s]+", _words(value).strip(", \t\n"))
    colors: dict[str, None] = {}
    for part in parts:
        found = PALETTE_COLOR.fullmatch(_words(part))
        if not found:
            raise UsageError(f"palette must be colours as #ff8800,#fff, not {shown(part)}")
        digits = found[1].lower()
        colors["#" + (digits if len(digits) == 6 else "".join(2 * digit for digit in digits))] = None
    return tuple(colors)
