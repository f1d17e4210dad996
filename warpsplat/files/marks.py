"""Marks of files written here, so that nothing else is replaced, and the key of the job that made each
picture.

An SVG, an EPS and a page have a comment, a PNG a text chunk behind its header, a GIF a comment, a PDF, a DXF,
a WebP and an MP4 something at their ends that readers ignore.
"""

from __future__ import annotations

import re
import struct
import zlib

HEAD = 2000
"""Bytes at the start of a file in which its mark stands."""

TAIL = 64
"""Bytes at the end of a file in which its mark stands."""

SVG_MARKS = b"<!--warpsplat", b"<metadata>warpsplat "
"""In the head of every SVG written here (``svg.write_svg``), now and by earlier versions."""

SHORT_SVG = re.compile(
    rb'<svg viewBox="0 0 [\d.]+ [\d.]+" xmlns="http://www\.w3\.org/2000/svg" height="\d+" width="\d+">'
)
"""The head of short ones: nobody else has the attributes in this order (``svg.write.shortened``)."""

PAGE_MARK = b"<!--warpsplat page-->"
"""In the head of every page written here (``pages.MARK``)."""

GIF_COMMENT = b"warpsplat"
GIF_MARK = b"!\xfe" + bytes([len(GIF_COMMENT)]) + GIF_COMMENT

WEBP_MARK = b"wspl\x0a\0\0\0warpsplat\n"
"""A chunk of a private kind at the end."""

MP4_MARK = b"\0\0\0\x12freewarpsplat\n"
"""A box of free space at the end."""

PNG_SIGNATURE = b"\x89PNG\r\n\x1a\n"

PNG_HEADER = 33
"""Length of a PNG's signature and header chunk [bytes]."""

PNG_MARK = b"tEXtSoftware\0warpsplat"
"""Type, keyword and beginning of the text of the chunk."""

PNG_END = b"IEND\xaeB`\x82"
"""The end of a complete PNG."""

PNG_KEY = re.compile(re.escape(PNG_MARK) + rb" ([\w.]{1,20})")

PDF_START = b"%PDF-"

PDF_KEY = re.compile(rb"\n%warpsplat(?: ([\w.]{1,20}))?\n\Z")

DXF_START = b"  0\nSECTION\n"
"""The beginning of DXFs that the package writes which we use."""

DXF_END = b"  0\nEOF"

DXF_KEY = re.compile(rb"\n999\nwarpsplat(?: ([\w.]{1,20}))?\n  0\nEOF\n\Z")
"""A comment before the end."""

EPS_START = b"%!PS-Adobe-3.0 EPSF-3.0\n"

EPS_KEY = re.compile(re.escape(EPS_START) + rb"%%Creator: warpsplat(?: ([\w.]{1,20}))?\n")

EPS_END = b"%%EOF\n"

GZIP = b"\x1f\x8b"
"""The beginning of gzipped files."""


def mark_png(png: bytes, key: str = "") -> bytes:
    """Return a PNG with a ``Software`` chunk, which has the ``key`` of the job that made it, if any."""
    chunk = PNG_MARK + f" {key}".rstrip().encode()
    whole = struct.pack(">I", len(chunk) - 4) + chunk + struct.pack(">I", zlib.crc32(chunk))
    return png[:PNG_HEADER] + whole + png[PNG_HEADER:]


def mark_pdf(pdf: bytes, key: str = "") -> bytes:
    """Return a PDF with a comment behind its end, as ``mark_png``."""
    return pdf + b"\n%warpsplat" + f" {key}".rstrip().encode() + b"\n"


def mark_dxf(dxf: bytes, key: str = "") -> bytes:
    """Return a DXF with a comment before its end, as ``mark_png``."""
    body = dxf[: dxf.rindex(DXF_END)]
    return body + b"999\nwarpsplat" + f" {key}".rstrip().encode() + b"\n" + DXF_END + b"\n"


def mark_eps(eps: bytes, key: str = "") -> bytes:
    """Return an EPS with a comment behind its first line, as ``mark_png``."""
    head, rest = eps[: len(EPS_START)], eps[len(EPS_START) :]
    return head + b"%%Creator: warpsplat" + f" {key}".rstrip().encode() + b"\n" + rest


def is_marked(head: bytes, tail: bytes) -> bool:
    """Return whether a file was written here or is empty; by its first ``HEAD`` and last ``TAIL`` bytes."""
    if head.startswith(PDF_START):
        return PDF_KEY.search(tail) is not None
    if head.startswith(DXF_START):
        return DXF_KEY.search(tail) is not None
    if head.startswith(EPS_START):
        return EPS_KEY.match(head) is not None
    for place, signature, mark in ((0, b"RIFF", WEBP_MARK), (4, b"ftyp", MP4_MARK)):
        if head.startswith(signature, place):
            return tail.endswith(mark)
    head = unpacked(head)
    marks = (*SVG_MARKS, PAGE_MARK, PNG_MARK, GIF_MARK)
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
    found = None
    if data.startswith(PNG_SIGNATURE) and data.endswith(PNG_END):
        found = PNG_KEY.match(data, PNG_HEADER + 4)  # behind the length of the chunk
    elif data.startswith(PDF_START):
        found = PDF_KEY.search(data[-TAIL:])
    elif data.startswith(DXF_START):
        found = DXF_KEY.search(data[-TAIL:])
    elif data.endswith(EPS_END):
        found = EPS_KEY.match(data)
    return (found[1] or b"").decode("ascii", "replace") if found else ""


def is_result(head: bytes) -> bool:
    """Return whether a file with this beginning is a PNG with a key: the result of a job."""
    return head.startswith(PNG_SIGNATURE) and PNG_KEY.match(head, PNG_HEADER + 4) is not None
