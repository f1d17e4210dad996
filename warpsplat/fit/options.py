"""Options: each is declared once, with the field that it sets.

``Settings`` declares its fields with ``option``. Flags, keys of batch files, keywords of the Python API, the
form of ``serve``, the documentation's tables and all checks of types and ranges are made from that.
"""

from __future__ import annotations

import dataclasses
import difflib
import functools
import math
import re
import types
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Literal, TypeGuard, Union, get_args, get_origin, get_type_hints

from warpsplat.errors import UsageError, shown

QUANTITY = re.compile(r"(\d+(?:\.\d+)?)\s*([a-z]*)", re.IGNORECASE)

TIME_UNITS = {"": 1, "ms": 1e-3, "s": 1, "sec": 1, "m": 60, "min": 60, "h": 3600}

SIZE_UNITS = {
    **{"": 1, "b": 1, "k": 1e3, "kb": 1e3, "kib": 1024, "m": 1e6, "mb": 1e6, "mib": 1024**2},
    **{"g": 1e9, "gb": 1e9, "gib": 1024**3},
}

COLOR = re.compile(r"#([0-9a-f]{3}|[0-9a-f]{6})", re.IGNORECASE)

COLOR_NAMES = (
    *("aqua", "black", "blue", "fuchsia", "gray", "green", "lime", "maroon"),
    *("navy", "olive", "purple", "red", "silver", "teal", "white", "yellow"),
)
"""Names of colours that are suggested; all of CSS are known."""

QUOTED = "in quotes, as an unquoted # begins a comment"
"""How shells and YAML files want colours, for messages."""


Elsewhere = Literal["refused", "ignored", "fitted"]
"""Consequences of an option that has no effect on a subject. If the user gave the subject, it is an error, or
the option is ignored with a note. If the subject was detected the option is ignored as well, unless it asks
for fitted shapes: then the image is fitted as a photograph, and a note says so."""


Group = Literal[
    "Batch",
    "What to make",
    "Shapes",
    "Colours",
    "Goals and limits",
    "Fitting",
    "Drawings",
    "Size on paper",
    "Cutters and plotters",
    "Contents of the SVG",
    "Files",
    "Run",
]
"""Groups of options in help and documentation, in their order."""

GROUPS: tuple[Group, ...] = get_args(Group)


@dataclass(frozen=True, kw_only=True)
class Option:
    """A setting as it is given. What a declaration leaves out follows from the field's type and default."""

    name: str = ""  # the flag without its dashes, and the key of batch files
    field: str = ""  # that it sets
    value: Any = None  # that the flag stands for, if it is a switch for one value of the field
    type: Any = str
    default: Any = None
    shown_default: str | None = None  # the default as help shows it, if not as it is
    help: str = ""  # empty if it cannot be given by this name
    group: Group | None = None  # of one that has a flag
    common: bool = False  # whether it is one of those that most people need
    research: bool = False  # a key of batch files and a keyword of make_settings, but no flag
    refine: bool = False  # whether refine takes it as well
    limits: tuple[float, float] | None = None  # of a number, else positive; of the length of a text
    choices: tuple[str, ...] = ()
    values: tuple[str, ...] = ()  # values with names, of an option that takes others as well
    files: bool = False  # whether a value may be the name of a file
    pattern: str = ".*"  # regular expression for a text, which "wanted" describes
    wanted: str = ""  # values that are accepted, in words
    metavar: str = ""
    subjects: tuple[str, ...] = ()  # that it has an effect on, if not on all
    elsewhere: Elsewhere = "refused"
    parse: Callable[[Any], Any] | None = None  # makes a value of what users write: times, sizes, lists
    shorthands: tuple[Option, ...] = ()  # further options that set the field

    @property
    def keyword(self) -> str:
        """The keyword of ``make_settings``."""
        return self.name.replace("-", "_")

    @property
    def hint(self) -> str:
        """For messages about a missing value."""
        return f"; write it {QUOTED}" if self.metavar.startswith("COLOR") else ""

    @property
    def default_text(self) -> str:
        """The default as help shows it; empty if there is none."""
        if self.shown_default is not None:
            return self.shown_default
        return "" if self.default in (None, "", ()) or self.default is False else str(self.default)

    @property
    def accepts(self) -> str:
        """Values that are accepted, in words."""
        if self.wanted or self.choices:
            return self.wanted or f"one of {', '.join(self.choices)}"
        if self.type is str:
            return f"a text of at most {self.limits[1]} characters" if self.limits else "text"
        if self.type in (int, float):
            if self.limits is None:
                return "a positive number"
            low, high = self.limits
            whole = self.type is int
            return f"a whole number from {low} to {high}" if whole else f"a number from {low:g} to {high:g}"
        return {bool: "true or false", dict: "a mapping"}.get(self.type, f"a {self.type.__name__}")

    def parsed(self, value: Any) -> Any:
        """Return a value as users write it in the option's type; see ``check``."""
        value = self.parse(value) if self.parse else value
        self.check(value)
        return value

    def check(self, value: Any, prefix: str = "") -> None:
        """Raise ``UsageError``, which names ``prefix`` and the option, unless a value is accepted."""
        if isinstance(value, dict) and self.type is dict:
            number = dataclasses.replace(self, name="", type=float)
            for key, inner in value.items():
                number.check(inner, f"{prefix}{self.name} {key}")
        elif not (self._accepted(value) or (value is None and self.default is None)):
            meant = nearest(value, self.choices or self.values) if isinstance(value, str) else ""
            raise UsageError(f"{prefix}{self.name} must be {self.accepts}, not {shown(value)}{meant}")

    def _accepted(self, value: Any) -> bool:
        if self.choices:
            return value in self.choices
        if self.type is str:
            matches = isinstance(value, str) and re.fullmatch(self.pattern, value, re.DOTALL)
            return bool(matches) and (self.limits is None or len(value) <= self.limits[1])
        if self.type not in (int, float):
            return isinstance(value, self.type)
        if isinstance(value, bool) or not isinstance(value, (int, float)):
            return False
        if self.limits is None:
            return 0 < value < math.inf
        return self.limits[0] <= value <= self.limits[1] and (self.type is float or isinstance(value, int))


def option(default: Any, help: str = "", limits: tuple[float, float] | None = None, **declared: Any) -> Any:
    """Declare a dataclass's field with its option.

    ``default`` is the field's default, or the function that makes it; all others are fields of ``Option``.
    """
    if callable(default):
        made = Option(default=default(), shown_default="", help=help, limits=limits, **declared)
        return dataclasses.field(default_factory=default, metadata={"option": made})
    made = Option(default=default, help=help, limits=limits, **declared)
    return dataclasses.field(default=default, metadata={"option": made})


research = functools.partial(option, research=True)
"""Declare a field that only researchers change."""


@functools.cache
def options_of(declaring: type) -> tuple[Option, ...]:
    """Return the options of a dataclass's fields, in their order and without shorthands."""
    hints = get_type_hints(declaring)
    found = []
    for field in dataclasses.fields(declaring):
        kind, choices = hints[field.name], ()
        if get_origin(kind) in (types.UnionType, Union):
            kind = get_args(kind)[0]  # the other one is None
        if get_origin(kind) is Literal:
            kind, choices = str, get_args(kind)
        declared = field.metadata["option"]
        made = dataclasses.replace(
            declared,
            name=field.name.replace("_", "-"),
            field=field.name,
            type=get_origin(kind) or kind,
            choices=choices or declared.choices,
            metavar=declared.metavar or ("N" if kind is int and not declared.parse else ""),
            shorthands=tuple(
                dataclasses.replace(s, field=field.name, group=s.group or declared.group)
                for s in declared.shorthands
            ),
        )
        found.append(made)
    return tuple(found)


def limits_of(declaring: type, name: str) -> tuple[float, float]:
    """Return the least and the largest value of a number's field."""
    found = next(each.limits for each in options_of(declaring) if each.field == name)
    assert found
    return found


def nearest(name: str, known: Iterable[str], prefix: str = "") -> str:
    """Return ``"; did you mean 'colors'?"`` for a name like one of the ``known``, else nothing.

    ``prefix``: what all of them begin with, such as dashes; it says nothing about likeness.
    """
    found = difflib.get_close_matches(
        name.removeprefix(prefix), [each.removeprefix(prefix) for each in known], 1
    )
    return f"; did you mean {prefix + found[0]!r}?" if found else ""


def _words(value: object) -> str:
    """Return a text as it is; anything else in short."""
    return value if isinstance(value, str) else shown(value)


def _is_list(value: object) -> TypeGuard[Iterable[object]]:
    return isinstance(value, Iterable) and not isinstance(value, (str, bytes))


def parse_duration(value: str | float) -> float:
    """Return the seconds of ``60``, ``60s``, ``2m`` or ``1.5h``; raise ``UsageError`` for anything else."""
    return _quantity(value, TIME_UNITS, "time", "60s or 2m")


def parse_bytes(value: str | int) -> int:
    """Return the bytes of ``100000``, ``100KB`` or ``1MiB``; raise ``UsageError`` for anything else."""
    return int(_quantity(value, SIZE_UNITS, "size", "100KB, 1MB or 1GB"))


def _quantity(value: object, units: Mapping[str, float], what: str, examples: str) -> float:
    """Return a number with a unit in the smallest of ``units``."""
    found = QUANTITY.fullmatch(_words(value).strip())
    unit = units.get(found[2].lower()) if found else None
    max_digits = 15  # digits of a time or size in a text: beyond, it is a slip of the keys
    if found is None or unit is None or len(found[1]) > max_digits:
        raise UsageError(f"not a {what}: {shown(value)}; write {examples}")
    return float(found[1]) * unit


def parse_levels(value: object) -> tuple[int, ...]:
    """Return the numbers of ``64,256,1024``, or of a list; raise ``UsageError`` for anything else."""
    parts = value if _is_list(value) else _words(value).split(",")
    try:
        return tuple(int(str(part)) for part in parts)
    except ValueError as error:
        raise UsageError(f"levels must be numbers of shapes, as in 64,256, not {shown(value)}") from error


def color_of(text: str) -> str | None:
    """Return ``#F80``, ``#ff8800`` or the name of a CSS colour as ``#ff8800``; None for anything else."""
    found = COLOR.fullmatch(text)
    if not found:
        from PIL import ImageColor  # not for help

        is_name = text.lower() in ImageColor.colormap
        return "#{:02x}{:02x}{:02x}".format(*ImageColor.getrgb(text)) if is_name else None
    digits = found[1].lower()
    return "#" + (digits if len(digits) == 6 else "".join(2 * digit for digit in digits))


def parse_background(value: object) -> object:
    """Return a colour as ``#ff8800``; anything else is left to be checked."""
    return color_of(value.strip()) or value if isinstance(value, str) else value


def parse_palette(value: object) -> tuple[str, ...]:
    """Return ``#f00,lime``, or a list, as ``("#ff0000", "#00ff00")``: each once, in order.

    Raises ``UsageError`` for anything else.
    """
    parts = value if _is_list(value) else re.split(r"[,\s]+", _words(value).strip(", \t\n"))
    colors: dict[str, None] = {}
    for part in parts:
        color = color_of(_words(part))
        if color is None:
            raise UsageError(f"palette must be colours such as '#ff8800,white' ({QUOTED}), not {shown(part)}")
        colors[color] = None
    return tuple(colors)
