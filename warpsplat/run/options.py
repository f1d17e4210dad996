"""The options that ``Settings`` declares, as users know them: flags, keys of batch files, keywords."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from warpsplat.errors import UsageError, cause_of, printable
from warpsplat.extensions import declared, load
from warpsplat.fit.optics import WORDS
from warpsplat.fit.options import QUOTED, Option, options_of, parse_palette
from warpsplat.fit.settings import Density, Settings, default_rates, make_settings
from warpsplat.scene import Kind

MOST_BYTES = 10_000
"""Most that is read of a file with the value of an option."""

_declared = [each for made in options_of(Settings) for each in (*made.shorthands, made) if each.help]

OPTIONS: tuple[Option, ...] = tuple(each for each in _declared if not each.research)
"""Options that have flags, in the order of the help."""

BY_NAME: Mapping[str, Option] = {option.name: option for option in OPTIONS}

KINDS: Mapping[str, Kind] = {option.name: option.value for option in OPTIONS if option.field == "kind"}
"""Flags and keys of the kinds of shapes."""

NESTED: Mapping[str, tuple[str, ...]] = {
    "rates": tuple(default_rates()),
    "density": tuple(option.name for option in options_of(Density)),
}
"""Keys of batch files whose values are mappings, and the keys in these; those that are left out stay."""

RESEARCH_KEYS: tuple[str, ...] = tuple(o.name for o in _declared if o.research and o.name not in NESTED)
"""Further keys of batch files, of single values."""


def read_value(name: str, path: Path, others: str) -> str:
    """Read the value of an option in a text file.

    Raises ``UsageError`` if it cannot be read or is too long; ``others``: which values are no files.
    """
    try:
        with path.open("rb") as file:
            found = file.read(MOST_BYTES + 1)
        if len(found) > MOST_BYTES:
            raise UsageError(f"{name} {printable(str(path))}: has more than {MOST_BYTES} bytes")
        return found.decode("ascii")
    except (OSError, ValueError) as error:
        cause = "not text" if isinstance(error, UnicodeDecodeError) else cause_of(error)
        raise UsageError(f"{name} {printable(str(path))}: {cause}; {others}") from error


def preset_names() -> Sequence[str]:
    """Return the names of all presets."""
    target = declared("provides").get("preset_names")
    return load(target)() if target else ()


def with_preset(preset: str | None, given: dict[str, Any]) -> dict[str, Any]:
    """Return the options ``given``, None being left out, over those of a preset, if one is named.

    Raises ``UsageError`` for an unknown preset.
    """
    if preset is None:
        return given
    target = declared("provides").get("with_preset")
    if target is None:
        raise UsageError("presets need the extension batch, which is not installed")
    made: dict[str, Any] = load(target)(preset, given)
    return made


def settings_from(given: Mapping[str, Any]) -> Settings:
    """Return ``make_settings`` of keywords in which a palette and optics may be the names of files."""
    palette, optics = given.get("palette"), given.get("optics")
    if isinstance(palette, str) and palette.strip() and "#" not in palette:
        try:
            parse_palette(palette)  # names of colours
        except UsageError:
            others = f"colours are names, or such as '#f80' {QUOTED}"
            given = {**given, "palette": read_value("palette", Path(palette), others)}
    if isinstance(optics, str) and optics.endswith(".json"):
        given = {**given, "optics": read_value("optics", Path(optics), f"others are {', '.join(WORDS)}")}
    return make_settings(**given)
