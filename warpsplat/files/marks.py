"""What a picture that was written here says of itself: that it was, and which job made it.

An SVG says the same in a comment (``svg.write``). A PNG has a text chunk behind its header, a PDF a comment
behind its end.
"""

from __future__ import annotations

import re
import struct
import zlib

PNG_SIGNATURE = b"\x89PNG\r\n\x1a\n"

PNG_HEADER = 33
"""Length of a PNG's signature and header chunk [bytes]."""

PNG_MARK = b"tEXtSoftware\0warpsplat"
"""Type, keyword and beginning of the text of the chunk."""

PNG_END = b"IEND\xaeB`\x82"
"""How a PNG ends that was not cut short."""

PNG_KEY = re.compile(re.escape(PNG_MARK) + rb" ([\w.]{1,20})")

PDF_START = b"%PDF-"

PDF_TAIL = 64
"""Bytes at the end of a PDF in which its mark stands."""

PDF_KEY = re.compile(rb"\n%warpsplat(?: ([\w.]{1,20}))?\n\Z")


def mark_png(png: bytes, key: str = "") -> bytes:
    """A PNG with a ``Software`` chunk, which has the ``key`` of the job that made it, if there is one."""
    chunk = PNG_MARK + _spaced(key)
    whole = struct.pack(">I", len(chunk) - 4) + chunk + struct.pack(">I", zlib.crc32(chunk))
    return png[:PNG_HEADER] + whole + png[PNG_HEADER:]


def mark_pdf(pdf: bytes, key: str = "") -> bytes:
    """A PDF with a comment behind its end, as ``mark_png``."""
    return pdf + b"\n%warpsplat" + _spaced(key) + b"\n"


def _spaced(key: str) -> bytes:
    return f" {key}".encode() if key else b""


def is_marked_pdf(tail: bytes) -> bool:
    """Whether a PDF with these last ``PDF_TAIL`` bytes was written here."""
    return PDF_KEY.search(tail) is not None


def picture_key(data: bytes) -> str:
    """The key that a whole picture bears; empty if it has none, was cut short, or is no picture."""
    found = None
    if data.startswith(PNG_SIGNATURE) and data.endswith(PNG_END):
        found = PNG_KEY.match(data, PNG_HEADER + 4)  # behind the length of the chunk
    elif data.startswith(PDF_START):
        found = PDF_KEY.search(data[-PDF_TAIL:])
    return (found[1] or b"").decode("ascii", "replace") if found else ""


def is_result(head: bytes) -> bool:
    """Whether a file that begins like this is the picture of a job: a PNG that bears a key."""
    return head.startswith(PNG_SIGNATURE) and PNG_KEY.match(head, PNG_HEADER + 4) is not None
