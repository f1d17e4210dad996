"""An uploaded image: its file, and a picture of it for browsers.

The file itself is never sent back: what a browser gets was drawn and encoded here.
"""

from __future__ import annotations

import io
import re
from dataclasses import dataclass
from typing import Any

from warpsplat.errors import ImageError, printable
from warpsplat.files.image import WEBP_SIDE, image_facts, load_image
from warpsplat.native import release_memory
from warpsplat.run.render import to_pillow
from warpsplat.scene import FloatArray

SHOWN_PIXELS = 4_000_000
"""Maximum pixels of a displayed picture, as many as a screen has."""

LOSSLESS_PIXELS = 1_000_000
"""Maximum pixels of a lossless picture."""

WEBP_QUALITY = 92

LONGEST_NAME = 100
"""Maximum characters of a file name."""

DEFAULT_NAME = "image"


@dataclass(frozen=True)
class Picture:
    """An image and its displayed picture."""

    name: str
    data: bytes
    """Name of its file."""
    width: int
    """[px]"""
    height: int
    """[px]"""
    shown: bytes
    """A picture of it, upright and in sRGB."""
    media: str
    """Its media type."""
    transparent: bool
    """Whether it has opacity."""

    @property
    def size(self) -> int:
        """Return its memory [bytes]."""
        return len(self.data) + len(self.shown)

    def as_dict(self) -> dict[str, Any]:
        """Return JSON values."""
        return {
            "name": self.name,
            "width": self.width,
            "height": self.height,
            "bytes": len(self.data),
            "transparent": self.transparent,
        }


def plain_name(name: str) -> str:
    """Return the last part of a file name, printable and not too long."""
    last = printable(re.split(r"[/\\]", name)[-1]).strip()
    stem, dot, ending = last.rpartition(".")
    if len(last) > LONGEST_NAME:
        last = f"{stem[: LONGEST_NAME - 10]}{dot}{ending[:8]}" if stem else last[:LONGEST_NAME]
    return last if last.strip(".") else DEFAULT_NAME


def read_picture(data: bytes, name: str) -> Picture:
    """Read an image file.

    Raises:
        ImageError: they are no image that can be read; the message is one line.
    """
    if not data:
        raise ImageError(f"{name}: nothing came")
    facts = image_facts(data)
    factor = 1
    while facts and (
        facts.width * facts.height > SHOWN_PIXELS * factor**2
        or max(facts.width, facts.height) > WEBP_SIDE * factor
    ):
        factor *= 2
    pixels = load_image(data, name, paper=None, factor=factor)
    height, width = pixels.shape[:2]
    shown, media = _encoded(pixels)
    transparent = pixels.shape[2] == 4
    del pixels
    release_memory()
    if facts:
        width, height = facts.width, facts.height
    return Picture(name, data, width, height, shown, media, transparent)


def _encoded(pixels: FloatArray) -> tuple[bytes, str]:
    """Encode a picture for browsers; return the file and its media type."""
    buffer = io.BytesIO()
    image = to_pillow(pixels)
    if image.width * image.height <= LOSSLESS_PIXELS:
        image.save(buffer, "PNG", compress_level=3)
        return buffer.getvalue(), "image/png"
    image.save(buffer, "WEBP", quality=WEBP_QUALITY, method=2)
    return buffer.getvalue(), "image/webp"
