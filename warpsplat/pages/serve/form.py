"""The form: one table of its controls, whose ranges, defaults and texts are those of the options."""

from __future__ import annotations

import functools
import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from warpsplat.errors import UsageError, shown
from warpsplat.fit.options import Option
from warpsplat.fit.settings import make_settings
from warpsplat.pages.serve.runs import Order
from warpsplat.run.command_line import as_path, vectorize_command
from warpsplat.run.options import BY_NAME, KINDS, preset_names, with_preset

SWITCHES = (*KINDS, "mixed")
"""Options that the control ``kind`` chooses from."""

MORE = "More"
"""Heading of the controls that few people need."""


@dataclass(frozen=True)
class Control:
    """A control of the form, which sets one option."""

    name: str
    """The option, or ``kind``, which chooses one of the switches for kinds of shapes."""
    label: str
    words: Mapping[str, str] = field(default_factory=dict)
    """Choices as the page calls them, if not by their values; the empty one: none is made."""
    group: str = ""
    """Heading under which it is hidden at first; empty: it is always there."""

    @property
    def option(self) -> Option:
        """The option."""
        return BY_NAME["closed" if self.name == "kind" else self.name]

    @property
    def default(self) -> str:
        """The value without a choice; empty if the program decides."""
        if self.name == "kind":
            return "closed"
        return "" if self.option.type is int or not self.option.default else str(self.option.default)

    @property
    def hint(self) -> str:
        """The meaning of an empty value."""
        return self.words.get("", self.option.default_text or "any")

    @functools.cached_property
    def choices(self) -> dict[str, str]:
        """Words by value; empty: it takes a number or a text."""
        named = SWITCHES if self.name == "kind" else self.option.choices
        if self.name == "shape":
            named = (self.option.default, *self.option.values, *_in_presets("shape"))
        if not named:
            return {}
        empty = {} if self.default else {"": self.hint}
        return empty | {name: self.words.get(name, name.capitalize()) for name in named}

    @property
    def type(self) -> str:
        """How the page shows it: ``buttons``, ``list``, ``slider``, ``number`` or ``text``."""
        most_buttons = 3  # choices that are shown as buttons; more of them are a list
        if self.choices:
            return "buttons" if len(self.choices) <= most_buttons else "list"
        return {float: "slider", int: "text" if self.option.parse else "number"}.get(self.option.type, "text")


CONTROLS = (
    Control(
        "subject",
        "Kind of image",
        {"auto": "Automatic", "photo": "Photograph", "line": "Line art", "pixel": "Pixel art"},
    ),
    Control("quality", "Effort"),
    Control("curves", "Shapes", {"": "automatic"}),
    Control("colors", "Most colours"),
    Control("detail", "Detail"),
    Control("max-bytes", "Largest file", {"": "any, such as 50KB"}),
    Control("remove-background", "Remove background", {"": "No"}),
    Control("background", "Background colour", {"": "as in the image"}, MORE),
    Control("shape", "Form of shapes", {"curve": "Free outlines", "polygon:6": "Hexagon"}, MORE),
    Control("kind", "Fills or strokes", {"closed": "Fills", "open": "Strokes", "mixed": "Both"}, MORE),
    Control("paint", "Paint", {"": "Automatic", "auto": "Flat or gradient"}, MORE),
)
"""The controls, in their order."""

FIELDS = {control.name: control for control in CONTROLS}

PRESET = "preset"
"""Name of the list of presets."""


@functools.cache
def presets() -> dict[str, dict[str, Any]]:
    """Return what each preset sets, by the names of options, and of controls where there is one."""
    found = {}
    for name in preset_names():
        values = {key.replace("_", "-"): value for key, value in with_preset(name, {}).items()}
        kinds = [key for key in SWITCHES if values.pop(key, False)]
        found[name] = {**values, **({"kind": kinds[0]} if kinds else {})}
    return found


def _in_presets(name: str) -> list[str]:
    return [str(values[name]) for values in presets().values() if name in values]


def form_data() -> dict[str, Any]:
    """Return what the script of the page knows about the form."""
    return {
        "controls": {
            control.name: {
                name: getattr(control, name) for name in ("label", "type", "default", "hint", "choices")
            }
            for control in CONTROLS
        },
        "presets": presets(),
    }


def order_of(given: object, max_memory: str | None, image: str) -> Order:
    """Return what a page asks for.

    Args:
        given: values by the names of controls, as parsed from JSON; ``preset``: the name of one.
        max_memory: limit of the server.
        image: file name of the image.

    Raises:
        UsageError: a control that the page does not have, or an invalid value.
    """
    if not isinstance(given, Mapping):
        raise UsageError("settings must be an object")
    for name in given:
        if name not in (PRESET, *FIELDS):
            raise UsageError(f"unknown setting {shown(name)}; there are {', '.join((PRESET, *FIELDS))}")
    values = {name: given[name] for name in (PRESET, *FIELDS) if given.get(name) is not None}
    preset, kind = values.get(PRESET), values.get("kind")
    if preset is not None and preset not in preset_names():  # a path is none: others may be asking
        raise UsageError(f"there is no preset {shown(preset)}")
    if kind is not None and kind not in FIELDS["kind"].choices:
        raise UsageError(f"kind must be one of {', '.join(FIELDS['kind'].choices)}, not {shown(kind)}")
    keywords = {FIELDS[name].option.keyword: values[name] for name in values if name not in (PRESET, "kind")}
    keywords |= {str(kind): True} if kind else {}
    settings, draft = (
        make_settings(**with_preset(preset, {"max_memory": max_memory, **keywords, **quality}))
        for quality in ({}, {"quality": "draft"})
    )
    path = as_path(image)
    command = vectorize_command(settings, path, f"{os.path.splitext(path)[0]}.svg", preset=preset)
    return Order(values, settings, None if draft == settings else draft, command)
