"""SVG text as a data URI (RFC 2397), for style sheets and pages."""

from __future__ import annotations

import re

RESERVED = re.compile("[^ !'()*,./0-9:=A-Z_a-z-]")
"""Characters that are escaped: all that pages and style sheets do not accept between double quotes."""

TAG = re.compile("<[^>]*>")


def data_uri(text: str) -> str:
    """Return a file written here as a URI without line breaks, for use between double quotes.

    Attributes get single quotes, which need no escape.
    """
    plain = TAG.sub(lambda found: found[0].replace('"', "'"), text.replace("\n", ""))
    return "data:image/svg+xml," + RESERVED.sub(
        lambda found: "".join(f"%{byte:02X}" for byte in found[0].encode()), plain
    )
