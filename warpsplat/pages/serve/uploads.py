"""An uploaded image: its file, and a picture of it that any browser shows.

The file itself is never sent back: browsers get a picture that was decoded and encoded here.
"""

from __future__ import annotations

import io
import re
from dataclasses import dataclass
from typing import Any

from warpsplat.errors import ImageError, printable
from warpsplat.native import release_memory
from warpsplat.pages.reports.pictures import shown_image
from warpsplat.run.render import to_pillow

LONGEST_NAME = 100
"""Most characters of a file's name."""

DEFAULT_NAME = "image"


@dataclass(frozen=True)
class Upload:
    """An uploaded image, and the picture that is shown of it."""

    name: str
    data: bytes
    """The file."""
    width: int
    """Width of the image [px]."""
    height: int
    """Height of the image [px]."""
    picture: bytes
    """Upright and in sRGB."""
    media_type: str
    """Media type of the picture."""

    @property
    def size(self) -> int:
        """Memory that it takes [bytes]."""
        return len(self.data) + len(self.picture)

    def as_dict(self) -> dict[str, Any]:
        """Return the facts for JSON."""
        return {"name": self.name, "width": self.width, "height": self.height, "bytes": len(self.data)}


def plain_name(name: str) -> str:
    """Return the last part of a file's name as one printable line of at most ``LONGEST_NAME`` characters."""
    last = printable(re.split(r"[/\\]", name)[-1]).strip()
    stem, dot, ending = last.rpartition(".")
    if len(last) > LONGEST_NAME:
        last = f"{stem[: LONGEST_NAME - 10]}{dot}{ending[:8]}" if stem else last[:LONGEST_NAME]
    return last if last.strip(".") else DEFAULT_NAME


def read_upload(data: bytes, name: str) -> Upload:
    """Return the upload of an image file.

    Raises:
        ImageError: the image cannot be read; the message is one line.
    """
    if not data:
        raise ImageError(f"{name}: the file is empty")
    shown = shown_image(data, name, 4_000_000)  # a screen has as many
    image = to_pillow(shown.pixels)
    buffer = io.BytesIO()
    if image.width * image.height <= 1_000_000:
        media_type = "image/png"
        image.save(buffer, "PNG", compress_level=3)
    else:
        media_type = "image/webp"
        image.save(buffer, "WEBP", quality=92, method=2)
    width, height = shown.width, shown.height
    del shown, image
    release_memory()
    return Upload(name, data, width, height, buffer.getvalue(), media_type)
