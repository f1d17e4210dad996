"""Numbers, colours and whole files as short texts."""

from __future__ import annotations

import re

import numpy as np

from warpsplat.scene import FloatArray


def number(value: float, decimals: int) -> str:
    """Return the shortest decimal form: no trailing zeros, no leading zero, no negative zero."""
    text = f"{value:.{decimals}f}"
    if "." in text:
        text = text.rstrip("0").rstrip(".")
    if text in {"-0", ""}:
        return "0"
    return re.sub(r"^(-?)0\.", r"\1.", text)


def hex_colors(colors: FloatArray) -> list[str]:
    """Return sRGB colours in [0, 1], shape (n, 3), as ``#rrggbb``, or as ``#rgb`` where that is the same."""
    levels = np.clip(np.round(colors.astype(np.float64) * 255), 0, 255).astype(np.int64)
    texts = [f"#{r:02x}{g:02x}{b:02x}" for r, g, b in levels.tolist()]
    return [f"#{t[1]}{t[3]}{t[5]}" if t[1] == t[2] and t[3] == t[4] and t[5] == t[6] else t for t in texts]


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
