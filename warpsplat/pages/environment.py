"""Templates -> one self-contained file."""

from __future__ import annotations

import base64
import functools
import hashlib
from importlib import resources
from typing import Any
from urllib.parse import quote

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from warpsplat._version import __version__
from warpsplat.errors import printable

MARK = "<!--warpsplat page-->"
"""In the head of every page, by which ``files.output`` knows that it may be replaced."""

BASE_ASSETS = ("base.css",)
"""What every page has."""


def page(template: str, *, assets: tuple[str, ...] = (), connects: bool = False, **values: Any) -> str:
    """A page as one file: style and scripts are inlined, and nothing is loaded from anywhere.

    Args:
        template: name of a template, which extends ``base.html.j2``.
        assets: style sheets and scripts by name, in order, besides the base's.
        connects: whether its scripts may ask the server that it came from.
        values: of the template. Texts are escaped wherever they stand; ``|tojson`` makes data for scripts.
    """
    names = (*BASE_ASSETS, *assets)
    scripts = [asset(name) for name in names if name.endswith(".js")]
    styles = [asset(name) for name in names if name.endswith(".css")]
    text = (
        environment()
        .get_template(template)
        .render(
            policy=policy(scripts, connects=connects),
            styles=[Markup(style) for style in styles],
            scripts=[Markup(script) for script in scripts],
            version=__version__,
            **values,
        )
    )
    # A name that the system could not decode has surrogates, which no file can hold.
    return text.encode("utf-8", "backslashreplace").decode()


def policy(scripts: list[str], *, connects: bool = False) -> str:
    """A content security policy that lets run these scripts and no other, and loads nothing from elsewhere.

    A text that got into a page as markup, against all escaping, would still do nothing.
    """
    hashes = " ".join(
        f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'" for text in scripts
    )
    rules = [
        "default-src 'none'",
        f"script-src {hashes or chr(39) + 'none' + chr(39)}",
        "style-src 'unsafe-inline'",
        "img-src 'self' file: data: blob:",
        *(["connect-src 'self'"] if connects else []),
        "base-uri 'none'",
        "form-action 'none'",
    ]
    return "; ".join(rules)


@functools.cache
def asset(name: str) -> str:
    """The text of a style sheet or script; it stands in an element that only its own end tag ends."""
    text = resources.files("warpsplat.pages").joinpath("assets", name).read_text("utf-8")
    assert "</script" not in text.lower() and "</style" not in text.lower(), name
    return text


@functools.cache
def environment() -> Environment:
    """The templates, where every text is escaped and every missing value is an error."""
    made = Environment(
        loader=PackageLoader("warpsplat.pages"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    made.globals["mark"] = Markup(MARK)
    made.filters["printable"] = printable
    made.filters["address"] = address
    return made


def address(path: str) -> str:
    """A relative path as a link: whatever is in a file's name, it names that file."""
    return quote(path.encode("utf-8", "surrogateescape"), safe="/")
