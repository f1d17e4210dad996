"""Inline images: kitty's graphics protocol and iTerm2's."""

from __future__ import annotations

import base64
import io

from PIL import Image

CHUNK = 4096
"""Maximum base64 characters in a kitty sequence."""


def kitty(picture: Image.Image, columns: int, rows: int, name: int) -> str:
    """Return an image drawn at the cursor, which does not move.

    Args:
        picture: to draw.
        columns: that it is wide.
        rows: that it is high.
        name: number from 1; a picture of the same number is replaced.
    """
    text = base64.b64encode(png(picture)).decode("ascii")
    chunks = [text[i : i + CHUNK] for i in range(0, len(text), CHUNK)]
    # a=T: draw at once; f=100: a PNG; C=1: leave the cursor; q=2: no answers, which would be typed input.
    first = f"a=T,f=100,i={name},p=1,c={columns},r={rows},C=1,q=2,"
    return "".join(
        f"\x1b_G{'' if i else first}m={int(i + 1 < len(chunks))};{chunk}\x1b\\"
        for i, chunk in enumerate(chunks)
    )


def iterm(picture: Image.Image, columns: int, rows: int) -> str:
    """Return an image drawn at the cursor, ``columns`` wide and ``rows`` high."""
    data = png(picture)
    size = f"size={len(data)};width={columns};height={rows}"
    text = base64.b64encode(data).decode("ascii")
    return f"\x1b]1337;File=inline=1;{size};preserveAspectRatio=0:{text}\x07"


def png(picture: Image.Image) -> bytes:
    """Encode a PNG quickly."""
    packed = io.BytesIO()
    picture.save(packed, "PNG", compress_level=1)
    return packed.getvalue()
