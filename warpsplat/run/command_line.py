"""Write settings as a command line."""

from __future__ import annotations

import os
import shlex
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from warpsplat.errors import UsageError
from warpsplat.fit.settings import DEFAULT_QUALITY, QUALITIES, Quality, Settings, levels_of, make_settings
from warpsplat.run.options import KINDS, OPTIONS, with_preset


def vectorize_command(
    settings: Settings, image: str, output: str, *further: str, preset: str | None = None
) -> str:
    """Return the shortest command that makes ``output`` of ``image`` by ``settings``, with ``further`` words.

    A comment follows if no command can, as with settings that only batch files have. ``preset``: one that the
    settings were made with: it may say what no flag does.
    """
    choices = []
    for name in dict.fromkeys((preset, None)):
        quality, given = flags_of(settings, name)
        choices.append((_settings(quality, given, name) == settings, _words(quality, given, name)))
    exact = [words for is_exact, words in choices if is_exact]
    words = min(exact or [choices[-1][1]], key=len)
    line = shlex.join(["warpsplat", "vectorize", as_path(image), *words, *further, "-o", output])
    return line if exact else f"{line}  # and settings without a flag"


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
    refine_iterations = 200  # default number of steps of warpsplat refine
    default = make_settings(iterations=refine_iterations)
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


def flags_of(settings: Settings, preset: str | None = None) -> tuple[Quality, dict[str, Any]]:
    """Return the quality and the fewest other arguments that, over a preset, give ``settings``."""
    choices = [(quality, _given(settings, quality, preset)) for quality in QUALITIES]
    exact = [one for one in choices if _settings(*one, preset) == settings]
    return min(exact or choices, key=lambda one: (len(one[1]), one[0] != DEFAULT_QUALITY))


def _given(settings: Settings, quality: Quality, preset: str | None) -> dict[str, Any]:
    given: dict[str, Any] = {"renderer": settings.renderer} if settings.renderer != "exact" else {}
    default = _settings(quality, given, preset) or Settings()
    for name in (option.field for option in OPTIONS if option.keyword == option.field):
        if getattr(settings, name) != getattr(default, name):
            given[name] = getattr(settings, name)
    if settings.kind != default.kind:
        given["kind"] = settings.kind
    if settings.is_limited:  # implies it
        given.pop("opaque", None)
    if settings.levels and settings.levels != levels_of(settings.curves):
        given.pop("curves", None)
    elif not settings.simplify:
        if default.simplify:
            given["curves"] = settings.curves
        if given.pop("levels", None):
            given["layered"] = True
    # No flag takes back what a preset sets.
    return {
        name: value for name, value in given.items() if value is not False and value not in (None, (), "")
    }


def _settings(quality: Quality, given: dict[str, Any], preset: str | None = None) -> Settings | None:
    """Return the settings, or None if the arguments cannot be combined."""
    named = {} if quality == DEFAULT_QUALITY else {"quality": quality}
    kinds = {name: True for name, kind in KINDS.items() if kind == given.get("kind")}
    others = {name: value for name, value in given.items() if name != "kind"}
    try:
        return make_settings(**with_preset(preset, {**named, **kinds, **others}))
    except UsageError:
        return None


def _words(quality: Quality, given: dict[str, Any], preset: str | None = None) -> list[str]:
    words = ["--preset", preset] if preset else []
    if quality != DEFAULT_QUALITY:
        words += ["--quality", quality]
    for option in OPTIONS:
        value = given.get(option.keyword if option.value is None else option.field)
        if option.type is bool and (value if option.value is None else value == option.value):
            words.append(f"--{option.name}")
        elif option.type is not bool and value is not None:
            text = _text(option.name, value)
            words += [f"--{option.name}={text}"] if text.startswith("-") else [f"--{option.name}", text]
    return words


def _text(name: str, value: Any) -> str:
    if isinstance(value, (tuple, list)):
        return ",".join(map(str, value))
    return f"{value:g}s" if name == "time-budget" else str(value)
