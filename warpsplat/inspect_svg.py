"""What an SVG's text says: its nodes, counted without drawing it."""

from __future__ import annotations

import gzip
import re
import zlib
from pathlib import Path

from warpsplat.errors import ImageError

DRAWN = re.compile(rb"<(?:path|circle|ellipse|polygon|polyline|line)\b")

PATH_DATA = re.compile(r"<path\b[^>]*?\sd=[\"']([^\"']*)")
COMMAND = re.compile(r"([a-zA-Z])([^a-zA-Z]*)")
NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:e[-+]?\d+)?", re.IGNORECASE)
ARGUMENTS = {"m": 2, "l": 2, "t": 2, "h": 1, "v": 1, "s": 4, "q": 4, "c": 6, "a": 7}
"""Numbers that each node of a path command takes (SVG 1.1 section 8.3)."""


def count_nodes(text: str) -> int:
    """Nodes of all paths of an SVG text; other drawn shapes count as one."""
    nodes = len(DRAWN.findall(text.encode())) - text.count("<path")
    for data in PATH_DATA.findall(text):
        for command, rest in COMMAND.findall(data):
            size = ARGUMENTS.get(command.lower())
            if size:
                nodes += len(NUMBER.findall(rest)) // size
    return max(nodes, 0)


def read_svg_text(path: Path) -> str:
    """Text of an SVG file, gzipped (``.svgz``) or not.

    Raises:
        ImageError: missing, unreadable or not text.
    """
    try:
        data = path.read_bytes()
        if data[:2] == b"\x1f\x8b":
            data = gzip.decompress(data)
        return data.decode("utf-8")
    except FileNotFoundError:
        raise ImageError(f"{path}: no such file") from None
    except IsADirectoryError:
        raise ImageError(f"{path}: is a folder, not an SVG") from None
    except PermissionError:
        raise ImageError(f"{path}: no permission to read it") from None
    except (UnicodeDecodeError, OSError, EOFError, zlib.error):
        raise ImageError(f"{path}: not an SVG") from None
