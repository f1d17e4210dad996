"""The settings on the page, with names, defaults and help of the command line."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from warpsplat.errors import UsageError, shown
from warpsplat.fit.settings import Settings, make_settings

FIELDS = ("subject", "curves", "closed", "open", "mixed", "quality", "paint", "colors")
"""Options, in the order of the page."""


def settings_of(given: object, max_memory: str | None = None) -> tuple[dict[str, Any], Settings]:
    """Return what a page asks for.

    Args:
        given: options and their values, as JSON has them.
        max_memory: of the server.

    Returns:
        What was given, in the order of ``FIELDS``, and the settings.

    Raises:
        UsageError: an option that the page does not offer, or a value that cannot be used.
    """
    if not isinstance(given, Mapping):
        raise UsageError("settings must be an object")
    for name in given:
        if name not in FIELDS:
            raise UsageError(f"unknown setting {shown(name)}; there are {', '.join(FIELDS)}")
    values: dict[str, Any] = {
        name: value for name in FIELDS if (value := given.get(name)) is not None and value is not False
    }
    return values, make_settings(max_memory=max_memory, **values)
