"""The page, made once: all that differs from session to session comes as events."""

from __future__ import annotations

from warpsplat.fit.options import Option
from warpsplat.pages import page
from warpsplat.pages.serve.form import FIELDS
from warpsplat.pages.serve.limits import Limits
from warpsplat.run.options import BY_NAME


def serve_page(limits: Limits) -> str:
    """The page as HTML, with the form that the table of options makes."""
    options = {name: BY_NAME[name] for name in FIELDS}
    return page(
        "serve.html.j2",
        assets=("viewer.css", "serve.css", "viewer.js", "serve.js"),
        connects=True,
        options=options,
        facts={"upload": limits.upload, "defaults": {name: default_of(o) for name, o in options.items()}},
    )


def default_of(option: Option) -> str:
    """What a choice has when nothing is chosen."""
    return option.default if option.choices else ""
