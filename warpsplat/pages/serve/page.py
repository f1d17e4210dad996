"""The page, made once: everything specific to a session comes as events."""

from __future__ import annotations

from warpsplat.fit.options import Option
from warpsplat.pages import page
from warpsplat.pages.serve.form import FIELDS
from warpsplat.pages.serve.limits import Limits
from warpsplat.run.options import BY_NAME


def serve_page(limits: Limits) -> str:
    """Return the page as HTML, with a form made from the table of options."""
    options = {name: BY_NAME[name] for name in FIELDS}
    return page(
        "serve.html.j2",
        assets=("viewer.css", "serve.css", "viewer.js", "serve.js"),
        connects=True,
        options=options,
        facts={"upload": limits.upload, "defaults": {name: default_of(o) for name, o in options.items()}},
    )


def default_of(option: Option) -> str:
    """Return the default of a choice."""
    return option.default if option.choices else ""
