"""Write settings as a command line."""

from __future__ import annotations

import os
import shlex
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

from warpsplat.errors import UsageError
from warpsplat.fit.settings import DEFAULT_QUALITY, QUALITIES, Quality, Settings, levels_of, make_settings
from warpsplat.run.options import OPTIONS
from warpsplat.scene import Kind

REFINE_ITERATIONS = 200
"""Default number of steps of ``warpsplat refine``."""


def vectorize_command(settings: Settings, image: str, output: str, *further: str) -> str:
    """Return the command that makes ``output`` of ``image`` with ``settings``; ``further``: further words.

    A comment follows if flags cannot express them, as with settings that only batch files have.
    """
    quality, given = flags_of(settings)
    line = shlex.join(
        ["warpsplat", "vectorize", as_path(image), *_words(quality, given), *further, "-o", output]
    )
    return line if _settings(quality, given) == settings else f"{line}  # and settings without a flag"


def several_command(
    settings: Settings, numbers: Sequence[int], image: str, output: os.PathLike[str] | None, *further: str
) -> str:
    """Return the command that makes files of several ``numbers`` of shapes; without an ``output``, here."""
    quality, given = flags_of(replace(settings, curves=max(numbers), simplify=False))
    words = _words(quality, {**given, "curves": ",".join(map(str, numbers))})
    where = () if output is None else ("-o", os.fspath(output))
    return shlex.join(["warpsplat", "vectorize", as_path(image), *words, *further, *where])


def refine_command(settings: Settings, svg: str, image: str, output: str, *further: str) -> str:
    """Return the command that makes ``output`` of ``svg`` and ``image``."""
    default = make_settings(iterations=REFINE_ITERATIONS)
    names = ("iterations", *(option.field for option in OPTIONS if option.refine))
    given = {
        name: value
        for name in names
        if (value := getattr(settings, name)) is not None and value != getattr(default, name)
    }
    words = _words(DEFAULT_QUALITY, given)
    return shlex.join(["warpsplat", "refine", as_path(svg), as_path(image), *words, *further, "-o", output])


def as_path(name: str) -> str:
    """Return a file name that is not parsed as a flag."""
    return f"./{name}" if name.startswith("-") and name != "-" else name


def flags_of(settings: Settings) -> tuple[Quality, dict[str, Any]]:
    """Return the quality and the fewest other arguments of ``make_settings`` that give ``settings``."""
    choices = [(quality, _given(settings, quality)) for quality in QUALITIES]
    exact = [one for one in choices if _settings(*one) == settings]
    return min(exact or choices, key=lambda one: (len(one[1]), one[0] != DEFAULT_QUALITY))


def _given(settings: Settings, quality: Quality) -> dict[str, Any]:
    given: dict[str, Any] = {"renderer": settings.renderer} if settings.renderer != "exact" else {}
    default = _settings(quality, given) or Settings()
    for name in (option.field for option in OPTIONS if option.keyword == option.field):
        if getattr(settings, name) != getattr(default, name):
            given[name] = getattr(settings, name)
    if settings.kind == Kind.STROKE:
        given["kind"] = settings.kind
    if settings.is_limited:  # implies it
        given.pop("opaque", None)
    if settings.levels and settings.levels != levels_of(settings.curves):
        given.pop("curves", None)
    elif not settings.simplify:
        given["curves"] = settings.curves
        if given.pop("levels", None):
            given["layered"] = True
    return given


def _settings(quality: Quality, given: dict[str, Any]) -> Settings | None:
    """Return the settings, or None if the arguments cannot be combined."""
    try:
        return make_settings(quality, **given)
    except UsageError:
        return None


def _words(quality: Quality, given: dict[str, Any]) -> Iterator[str]:
    if quality != DEFAULT_QUALITY:
        yield from ("--quality", quality)
    for option in OPTIONS:
        value = given.get(option.keyword if option.value is None else option.field)
        if option.type is bool and (value if option.value is None else value == option.value):
            yield f"--{option.name}"
        elif option.type is not bool and value is not None:
            text = _text(option.name, value)
            yield from (f"--{option.name}={text}",) if text.startswith("-") else (f"--{option.name}", text)


def _text(name: str, value: Any) -> str:
    if isinstance(value, (tuple, list)):
        return ",".join(map(str, value))
    return f"{value:g}s" if name == "time-budget" else str(value)
