"""Parsed pages, and texts that would be harmful as markup."""

from __future__ import annotations

import json
import re
from html.parser import HTMLParser
from typing import Any

NASTY = [
    "</script><script>alert(1)</script>",
    "\"' onmouseover=alert(1) x=",
    "<!--<script>",
    "]]></title><img src=x onerror=alert(1)>",
    "{{ 7*7 }}{% include 'base.html.j2' %}",
    "javascript:alert(1)",
    "a\udcff\x00\u2028b",
]


class Tags(HTMLParser):
    """The elements of a page, their attributes, and the targets of its links."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tags: list[str] = []
        self.attributes: list[str] = []
        self.links: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        self.attributes += [name for name, _ in attrs]
        self.links += [value or "" for name, value in attrs if name == "href" and tag == "a"]


def data_of(text: str) -> dict[str, Any]:
    """Return the data of a page's script."""
    found = re.search(r'<script type="application/json" id="data">(.*?)</script>', text, re.DOTALL)
    assert found
    values: dict[str, Any] = json.loads(found[1])
    return values
