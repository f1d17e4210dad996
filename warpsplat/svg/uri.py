"""SVG text as a data URI (RFC 2397), for style sheets and pages."""

from __future__ import annotations

import re

RESERVED = re.compile("[^ !'()*,./0-9:=A-Z_a-z-]")
"""What is escaped: all but what pages and style sheets take as it is between double quotes."""


TAG = re.compile("<[^>]*>")


def data_uri(text: str) -> str:
    """A file written here as a URI, without line breaks, to stand between double quotes.

    Attributes get single quotes, which need no escape.
    """
    plain = TAG.sub(lambda found: found[0].replace('"', "'"), text.replace("\n", ""))
    return "data:image/svg+xml," + RESERVED.sub(lambda found: _escaped(found[0]), plain)


def _escaped(character: str) -> str:
    return "".join(f"%{byte:02X}" for byte in character.encode())
