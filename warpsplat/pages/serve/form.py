"""The settings on the page, with names, defaults and help of the command line."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from warpsplat.errors import UsageError, shown
from warpsplat.fit.settings import Settings
from warpsplat.run.options import BY_NAME, settings_from

FIELDS = ("subject", "curves", "closed", "open", "mixed", "quality", "paint", "colors")
"""Flags, in the order of the page."""

JSON_NAMES = {bool: "true or false", int: "a whole number", str: "a text"}


def settings_of(given: object, max_memory: str | None = None) -> tuple[dict[str, Any], Settings]:
    """Parse a page's settings.

    Args:
        given: flags without their dashes and their values, as JSON has them.
        max_memory: of the server.

    Returns:
        What was given, in the order of ``FIELDS``, and the settings.

    Raises:
        UsageError: a flag that the page does not offer, or a value that cannot be used.
    """
    if not isinstance(given, Mapping):
        raise UsageError("settings must be an object")
    for name in given:
        if name not in FIELDS:
            raise UsageError(f"unknown setting {shown(name)}; there are {', '.join(FIELDS)}")
    values: dict[str, Any] = {
        name: value for name in FIELDS if (value := given.get(name)) is not None and value is not False
    }
    keywords: dict[str, Any] = {"max_memory": max_memory}
    for name, value in values.items():
        option = BY_NAME[name]
        if type(value) is not option.type:  # a bool is no number here
            raise UsageError(f"{name} must be {JSON_NAMES[option.type]}, not {shown(value)}")
        if option.setting in keywords:
            raise UsageError("closed and open do not go together")
        keywords[option.setting] = value if option.kind is None else option.kind
    return values, settings_from(keywords)
