"""Rendering of templates into self-contained files."""

from __future__ import annotations

import base64
import functools
import hashlib
from collections.abc import Sequence
from importlib import resources
from typing import Any
from urllib.parse import quote

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from warpsplat._version import __version__

MARK = "<!--warpsplat page-->"
"""Marks our pages in their heads: ``files.output`` may replace them."""


def page(template: str, *, assets: tuple[str, ...] = (), connects: bool = False, **values: Any) -> str:
    """Render a page as one file that loads nothing: styles and scripts are inlined.

    Args:
        template: name of a template that extends ``base.html.j2``.
        assets: names of styles and scripts, in order, besides ``base.css`` and ``base.js``.
        connects: whether scripts may send requests to the page's own server.
        values: variables of the template. Texts are escaped; ``|tojson`` makes data for scripts.
    """
    texts = {name: asset(name) for name in ("base.css", "base.js", *assets)}
    scripts = [Markup(text) for name, text in texts.items() if name.endswith(".js")]
    styles = [Markup(text) for name, text in texts.items() if name.endswith(".css")]
    rules = policy(scripts, connects=connects)
    made = environment().get_template(template)
    text = made.render(policy=rules, styles=styles, scripts=scripts, version=__version__, **values)
    # Names that the system could not decode have surrogates, which no file can hold.
    return text.encode("utf-8", "backslashreplace").decode()


def policy(scripts: Sequence[str], *, connects: bool) -> str:
    """Return a content security policy that runs these scripts only, and loads nothing from elsewhere.

    Even if a text got into a page as markup, despite the escaping, it could do nothing.
    """
    digests = [base64.b64encode(hashlib.sha256(text.encode()).digest()).decode() for text in scripts]
    sources = [f"'sha256-{digest}'" for digest in digests] or ["'none'"]
    rules = [
        "default-src 'none'",
        f"script-src {' '.join(sources)}",
        "style-src 'unsafe-inline'",
        "img-src 'self' file: data: blob:",
        *(["connect-src 'self'"] if connects else []),
        "base-uri 'none'",
        "form-action 'none'",
    ]
    return "; ".join(rules)


@functools.cache
def asset(name: str) -> str:
    """Return the text of a style or script, which must not contain the end tag of its element."""
    text = resources.files("warpsplat.pages").joinpath("assets", name).read_text("utf-8")
    assert "</script" not in text.lower() and "</style" not in text.lower(), name
    return text


@functools.cache
def environment() -> Environment:
    """Return the templates: every text is escaped, and a missing value is an error."""
    made = Environment(
        loader=PackageLoader("warpsplat.pages"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    made.globals["mark"] = Markup(MARK)
    made.filters["address"] = address
    return made


def address(path: str) -> str:
    """Return a relative path, with any characters, as a link."""
    return quote(path.encode("utf-8", "surrogateescape"), safe="/")


def webp_uri(data: bytes) -> str:
    """Return a WebP file as a data URI: an ``img`` can neither run scripts nor load anything."""
    return f"data:image/webp;base64,{base64.b64encode(data).decode()}"
