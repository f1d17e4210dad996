"""The page and its form: settings have the names, defaults and texts of the command line."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from warpsplat.errors import UsageError, shown
from warpsplat.fit.settings import Settings, make_settings
from warpsplat.pages.environment import page
from warpsplat.pages.serve.sessions import Limits
from warpsplat.run.options import BY_NAME

FIELDS = (
    *("subject", "curves", "closed", "open", "mixed", "shape", "quality", "detail", "max-bytes"),
    *("paint", "colors", "background"),
)
"""Options of the form, in its order."""


def serve_page(limits: Limits) -> str:
    """Return the page as HTML. It is the same for all sessions: their states arrive as events."""
    options = {name: BY_NAME[name] for name in FIELDS}
    defaults = {name: option.default or "" for name, option in options.items() if option.choices}
    defaults["shape"] = options["shape"].default
    return page(
        "serve.html.j2",
        assets=("viewer.css", "serve.css", "viewer.js", "serve.js"),
        connects=True,
        options=options,
        data={"upload": limits.upload, "defaults": defaults},
    )


def settings_of(given: object, max_memory: str | None) -> tuple[dict[str, Any], Settings]:
    """Return the options that a page gives, in the order of ``FIELDS``, and the settings.

    Args:
        given: options and their values, as parsed from JSON.
        max_memory: limit of the server.

    Raises:
        UsageError: an option that the page does not offer, or an invalid value.
    """
    if not isinstance(given, Mapping):
        raise UsageError("settings must be an object")
    for name in given:
        if name not in FIELDS:
            raise UsageError(f"unknown setting {shown(name)}; there are {', '.join(FIELDS)}")
    values: dict[str, Any] = {
        name: value for name in FIELDS if (value := given.get(name)) is not None and value is not False
    }
    keywords = {BY_NAME[name].keyword: value for name, value in values.items()}
    return values, make_settings(max_memory=max_memory, **keywords)
