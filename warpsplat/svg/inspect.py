"""Checks that every foreign SVG passes first, and facts found without drawing it.

Size, encoding, nesting and entities are bounded here, so that resvg and the reader of shapes get a
well-formed document of bounded size.
"""

from __future__ import annotations

import codecs
import gzip
import io
import math
import re
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from xml.parsers import expat

from warpsplat.errors import ImageError
from warpsplat.files.inputs import input_name, read_input

NAMESPACE = "http://www.w3.org/2000/svg"

MAX_BYTES = 256 << 20
"""Longest text [bytes], uncompressed."""

MAX_DEPTH = 1000
"""Deepest nesting of elements; resvg reads 1,024 levels."""

MAX_EXPANSION = 16 << 20
"""Most characters that a document's entities may expand to."""

MAX_PIXELS = 200_000_000
"""Largest picture that is drawn [pixels]: four bytes each, as many for each layer, and 8 s to compress."""


def read_svg_text(path: Path) -> str:
    """Return the text of an SVG file, or of the standard input for ``-``; gzipped (``.svgz``) or not.

    The encoding is the one that a byte order mark or the XML declaration names; the text returned declares
    none but UTF-8.

    Raises:
        ImageError: Missing, unreadable, larger than ``MAX_BYTES`` or not text; the message names ``path``.
    """
    return svg_text(read_input(path, "an SVG", limit=MAX_BYTES), input_name(path))


def svg_text(data: bytes, name: str) -> str:
    """Return the text of an SVG file's bytes as ``read_svg_text``; ``name``: for messages."""
    try:
        if data[:2] == b"\x1f\x8b":
            with gzip.GzipFile(fileobj=io.BytesIO(data)) as packed:
                data = packed.read(MAX_BYTES + 1)
        text = _decode(data)
    except (UnicodeDecodeError, LookupError, OSError, EOFError, zlib.error):
        raise ImageError(f"{name}: not an SVG") from None
    if len(data) > MAX_BYTES:
        raise ImageError(f"{name}: is larger than {MAX_BYTES >> 20} MiB when unpacked")
    return text


DECLARED = re.compile(r"""(\s*<\?xml\b[^>]{0,200}?\sencoding\s*=\s*)["']([\w.:-]{1,40})["']""")

ENCODINGS = ("utf-8", "ascii", "iso8859", "cp", "koi8", "mac", "shift_jis", "euc", "gb", "big5")
"""Prefixes of the encodings with units of one byte; Python knows others, which no viewer reads."""


def _decode(data: bytes) -> str:
    declaration_end = 400  # characters at the start in which an XML declaration must stand
    if data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        text = data.decode("utf-16")
    elif data[:2] in {b"<\0", b"\0<"}:
        text = data.decode("utf-16-le" if data[1] == 0 else "utf-16-be")
    else:
        declared = DECLARED.match(data[:declaration_end].decode("latin-1"))
        encoding = codecs.lookup(declared[2]).name if declared else "utf-8"
        if data.startswith(codecs.BOM_UTF8):
            encoding = "utf-8-sig"
        elif not encoding.startswith(ENCODINGS):
            raise LookupError(encoding)
        text = data.decode(encoding)
    # At the start only: a search of the whole text for leading spaces is quadratic.
    return DECLARED.sub(r'\1"UTF-8"', text[:declaration_end], count=1) + text[declaration_end:]


@dataclass(frozen=True)
class SvgFacts:
    """Facts found in one pass over an SVG's text."""

    root: dict[str, str]
    """Attributes of the root element."""
    paths: int
    """Paths and basic shapes, however often ``use`` shows them. Not counted are clips, masks, and a
    background: a rectangle that fills the view box behind the others.
    """
    nodes: int
    """Points that these paths pass through; basic shapes count as one."""


DRAWN = {f"{NAMESPACE} {tag}" for tag in ("rect", "circle", "ellipse", "polygon", "polyline", "line")}
PATH, RECT = f"{NAMESPACE} path", f"{NAMESPACE} rect"
HIDDEN = {f"{NAMESPACE} {tag}" for tag in ("clipPath", "mask")}
"""Elements whose content is not drawn itself."""
ROOT = f"{NAMESPACE} svg"


def inspect_svg(text: str) -> SvgFacts:
    """Check an SVG's text and gather facts, in one pass of linear time.

    Raises:
        ImageError: Not well-formed, not an SVG, too long, nested too deep, or with entities that multiply.
    """
    root: dict[str, str] = {}
    depth = paths = nodes = longest = hidden = 0
    behind = False

    def start(tag: str, attributes: dict[str, str]) -> None:
        nonlocal depth, paths, nodes, hidden, behind
        if depth == 0:
            if tag != ROOT:
                name = tag.rpartition(" ")[2][:40]
                raise ImageError(f"not an SVG: its root is <{name}> of no or another kind")
            root.update(attributes)
        depth += 1
        if depth > MAX_DEPTH:
            raise ImageError(f"elements are nested more than {MAX_DEPTH} deep")
        hidden += tag in HIDDEN
        if hidden:
            return
        if tag == RECT and not paths and not behind and _covers(attributes, root):
            behind = True
        elif tag == PATH or tag in DRAWN:
            paths += 1
            nodes += path_nodes(attributes.get("d", "")) if tag == PATH else 1

    def end(tag: str) -> None:
        nonlocal depth, hidden
        depth -= 1
        hidden -= tag in HIDDEN

    def entity(name: str, parameter: int, value: str | None, *_: str | None) -> None:
        # The declaration comes before any use, so that nothing has been expanded yet.
        nonlocal longest
        longest = max(longest, len(value or ""))
        if "&" in (value or "") or longest * references > MAX_EXPANSION:
            raise ImageError(f"the entity {name[:40]!r} expands to too much text, so the SVG is refused")

    data = text.encode("utf-8", "surrogatepass")
    if len(data) > MAX_BYTES:
        raise ImageError(f"is larger than {MAX_BYTES >> 20} MiB")
    references = text.count("&")
    parser = expat.ParserCreate("utf-8", namespace_separator=" ")
    parser.StartElementHandler, parser.EndElementHandler, parser.EntityDeclHandler = start, end, entity
    try:
        parser.Parse(data, True)
    except expat.ExpatError as error:
        raise ImageError(f"cannot be rendered: not well-formed XML: {error}") from None
    return SvgFacts(root, paths, nodes) if paths or not behind else SvgFacts(root, 1, 1)


COMMAND = re.compile(r"([MmZzLlHhVvCcSsQqTtAa])([^MmZzLlHhVvCcSsQqTtAa]*)")
ARGUMENTS = {"m": 2, "l": 2, "t": 2, "h": 1, "v": 1, "s": 4, "q": 4, "c": 6, "a": 7, "z": 0}
"""Numbers that each path command takes for a node (SVG 1.1 section 8.3)."""

# With ``\d+\.?\d*`` there would be as many ways to match a long row of digits as it has digits.
NUMBER = re.compile(r"[-+]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][-+]?\d+)?")
SPACES = re.compile(r"[\s,]*")
NEXT_NUMBER = re.compile(rf"{SPACES.pattern}({NUMBER.pattern})")
NEXT_FLAG = re.compile(rf"{SPACES.pattern}([01])")


def numbers(text: str, *, of_arcs: bool = False) -> tuple[list[float], bool]:
    """Return the numbers that a list begins with, and whether they are all of it.

    A flag of an arc is one character, and need not be separated from the next number.
    """
    if not of_arcs and not NUMBER.sub(" ", text).strip(", \t\r\n\f"):
        return [float(value) for value in NUMBER.findall(text)], True
    values: list[float] = []
    position = 0
    while found := (NEXT_FLAG if of_arcs and len(values) % 7 in {3, 4} else NEXT_NUMBER).match(
        text, position
    ):
        values.append(float(found[1]))
        position = found.end()
    return values, of_arcs and SPACES.fullmatch(text, position) is not None


def path_nodes(data: str) -> int:
    """Return the number of points that a path passes through."""
    nodes = 0
    for command, text in COMMAND.findall(data):
        size = ARGUMENTS[command.lower()]
        values = numbers(text, of_arcs=True)[0] if size == 7 else NUMBER.findall(text)
        nodes += len(values) // size if size else 0
    return nodes


PIXELS_PER_UNIT = {
    **{"": 1.0, "px": 1.0, "in": 96.0, "cm": 96 / 2.54, "mm": 96 / 25.4, "pt": 96 / 72, "pc": 16.0},
    **{"em": 16.0, "ex": 8.0},
}
"""CSS absolute lengths, and those relative to the default font size of 16 px, as in resvg."""

SEPARATOR = r"(?:\s*,\s*|\s+|(?=[-+]))"
VIEW_BOX = re.compile(rf"\s*({NUMBER.pattern})" + 3 * rf"{SEPARATOR}({NUMBER.pattern})" + r"(?=[\s,]|$)")
LENGTH = re.compile(rf"({NUMBER.pattern})(px|in|cm|mm|pt|pc|em|ex|%|)")


def _covers(rectangle: Mapping[str, str], root: Mapping[str, str]) -> bool:
    """Return whether a rectangle covers the view box, or the size, of a root; given their attributes."""
    if {"rx", "ry", "transform"} & rectangle.keys():
        return False
    box = view_box(root) or (0.0, 0.0, *(_plain(root.get(name, "")) for name in ("width", "height")))
    for axis, (place, side) in enumerate((("x", "width"), ("y", "height"))):
        low, length = _plain(rectangle.get(place, "0")), _plain(rectangle.get(side, ""), box[2 + axis])
        if not (low <= box[axis] and low + length >= box[axis] + box[2 + axis]):
            return False
    return True


def _plain(text: str, whole: float = math.nan) -> float:
    """Return a number of pixels or units, ``whole`` for 100 %, NaN for all else."""
    found = LENGTH.fullmatch(text.strip())
    if found and found[2] == "%":
        return whole if float(found[1]) == 100 else math.nan
    return float(found[1]) if found and found[2] in {"", "px"} else math.nan


def view_box(root: Mapping[str, str]) -> tuple[float, float, float, float] | None:
    """Return the ``viewBox`` (x, y, width, height) among attributes; None if there is no valid one."""
    found = VIEW_BOX.match(root.get("viewBox", ""))
    if not found:
        return None
    x, y, width, height = map(float, found.groups())
    is_valid = width > 0 and height > 0 and all(map(math.isfinite, (x, y, width, height)))
    return (x, y, width, height) if is_valid else None


def known_size(root: Mapping[str, str]) -> tuple[float, float]:
    """Return ``svg_size``, or raise ``ImageError`` if the root does not state it."""
    if size := svg_size(root):
        return size
    raise ImageError("has neither its size nor a viewBox")


def svg_size(root: Mapping[str, str]) -> tuple[float, float] | None:
    """Return the size [px] at which resvg shows an SVG, given the attributes of its root.

    None: the root does not state it; resvg then takes the extent of the drawing.

    Raises:
        ImageError: The size is not positive, or more than ``MAX_PIXELS``.
    """
    box = view_box(root)
    own_font = "font-size" in root or "font" in root.get("style", "")
    sides: list[float | None] = []
    for i, name in enumerate(("width", "height")):
        found = LENGTH.fullmatch(root.get(name, "").lstrip())
        if found is None or (found[2] in {"em", "ex"} and own_font):
            sides.append(None)
        elif found[2] == "%":
            sides.append(float(found[1]) / 100 * box[2 + i] if box else None)
        else:
            sides.append(float(found[1]) * PIXELS_PER_UNIT[found[2]])
    width, height = sides
    if box:
        if width is None:
            width = box[2] if height is None else height * box[2] / box[3]
        if height is None:
            height = width * box[3] / box[2]
    if any(side is not None and not side > 0 for side in (width, height)):
        raise ImageError("its width or height is not positive")
    if width is None or height is None:
        return None
    if not width * height <= MAX_PIXELS:
        raise ImageError(f"is {width:.6g}x{height:.6g} pixels, more than {MAX_PIXELS // 1_000_000} million")
    return width, height
