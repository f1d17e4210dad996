"""Marks of files written here, so that nothing else is replaced, and the key of the job that made each
picture.

An SVG, an EPS and a page have a comment, a PNG a text chunk behind its header, a GIF a comment, a PDF, a DXF,
a WebP and an MP4 something at their ends that readers ignore.
"""

from __future__ import annotations

import re
import struct
import zlib

HEAD, TAIL = 2000, 64
"""Bytes at the start and at the end of a file in which its mark stands."""

SVG_MARK = b"<!--warpsplat"
"""In the head of SVGs (``svg.write.MARK``) and of pages (``pages.environment.MARK``)."""

SHORT_SVG = re.compile(
    rb'<svg viewBox="0 0 [\d.]+ [\d.]+" xmlns="http://www\.w3\.org/2000/svg" height="\d+" width="\d+">'
)
"""The head of short ones: nobody else has the attributes in this order (``svg.write.shortened``)."""

GIF_COMMENT = b"warpsplat"

WEBP_MARK = b"wspl\x0a\0\0\0warpsplat\n"
"""A chunk of a private kind at the end."""

MP4_MARK = b"\0\0\0\x12freewarpsplat\n"
"""A box of free space at the end."""

PNG_HEADER = 33
"""Length of a PNG's signature and header chunk [bytes]."""

PNG_MARK = b"tEXtSoftware\0warpsplat"
"""Type, keyword and beginning of the text of the chunk."""

PNG_END = b"IEND\xaeB`\x82"
"""The end of a complete PNG."""

KEY = rb"warpsplat(?: ([\w.]{1,20}))?\n"

PNG_KEY = re.compile(rb"\A\x89PNG\r\n\x1a\n.{29}" + re.escape(PNG_MARK) + rb" ([\w.]{1,20})", re.DOTALL)
"""The signature, the header and the length of the chunk, and the chunk."""

DXF_END = b"  0\nEOF"

EPS_START, EPS_END = b"%!PS-Adobe-3.0 EPSF-3.0\n", b"%%EOF\n"

COMMENTS = {
    b"%PDF-": re.compile(rb"\n%" + KEY + rb"\Z"),
    b"  0\nSECTION\n": re.compile(rb"\n999\n" + KEY + DXF_END + rb"\n\Z"),
    EPS_START: re.compile(rb"\A" + re.escape(EPS_START) + rb"%%Creator: " + KEY),
}
"""The comments in PDFs, DXFs and EPSs, by the beginnings of such files."""

GZIP = b"\x1f\x8b"
"""The beginning of gzipped files."""


def _text(key: str) -> bytes:
    """Return the text of a mark with the ``key`` of the job that made the file, if any."""
    return f"warpsplat {key}".rstrip().encode()


def mark_png(png: bytes, key: str = "") -> bytes:
    """Return a PNG with a ``Software`` chunk, which has the ``key`` of the job that made it, if any."""
    chunk = PNG_MARK.removesuffix(b"warpsplat") + _text(key)
    whole = struct.pack(">I", len(chunk) - 4) + chunk + struct.pack(">I", zlib.crc32(chunk))
    return png[:PNG_HEADER] + whole + png[PNG_HEADER:]


def mark_pdf(pdf: bytes, key: str = "") -> bytes:
    """Return a PDF with a comment behind its end, as ``mark_png``."""
    return pdf + b"\n%" + _text(key) + b"\n"


def mark_dxf(dxf: bytes, key: str = "") -> bytes:
    """Return a DXF with a comment before its end, as ``mark_png``."""
    return dxf[: dxf.rindex(DXF_END)] + b"999\n" + _text(key) + b"\n" + DXF_END + b"\n"


def mark_eps(eps: bytes, key: str = "") -> bytes:
    """Return an EPS with a comment behind its first line, as ``mark_png``."""
    return EPS_START + b"%%Creator: " + _text(key) + b"\n" + eps.removeprefix(EPS_START)


def is_marked(head: bytes, tail: bytes) -> bool:
    """Return whether a file was written here or is empty; by its first ``HEAD`` and last ``TAIL`` bytes."""
    for start, comment in COMMENTS.items():
        if head.startswith(start):
            return comment.search(head + tail) is not None
    for place, signature, mark in ((0, b"RIFF", WEBP_MARK), (4, b"ftyp", MP4_MARK)):
        if head.startswith(signature, place):
            return tail.endswith(mark)
    head = unpacked(head)
    gif_mark = b"!\xfe" + bytes([len(GIF_COMMENT)]) + GIF_COMMENT
    marks = (SVG_MARK, PNG_MARK, gif_mark)
    return not head or SHORT_SVG.match(head) is not None or any(mark in head for mark in marks)


def unpacked(head: bytes) -> bytes:
    """Return the beginning of a file, decompressed if it is gzipped."""
    if not head.startswith(GZIP):
        return head
    try:
        return zlib.decompressobj(wbits=zlib.MAX_WBITS | 16).decompress(head)
    except zlib.error:
        return head


def picture_key(data: bytes) -> str:
    """Return the key in a PNG, PDF, DXF or EPS; empty: it has none, was truncated, or is something else."""
    found = PNG_KEY.match(data) if data.endswith(PNG_END) else None
    for start, comment in COMMENTS.items():
        if data.startswith(start) and (start != EPS_START or data.endswith(EPS_END)):
            found = comment.search(data[:HEAD] + data[-TAIL:])
    return (found[1] or b"").decode("ascii", "replace") if found else ""


def is_result(head: bytes) -> bool:
    """Return whether a file with this beginning is a PNG with a key: the result of a job."""
    return PNG_KEY.match(head) is not None
