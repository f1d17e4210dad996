"""Animate the drawing of a file: strokes grow as a pen draws them, all else appears."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from warpsplat.motion.films import Frame, ticks_of, zoom_of
from warpsplat.motion.shown import picture, screen, size_of
from warpsplat.portable.linear import product
from warpsplat.svg.numbers import number
from warpsplat.svg.paths import cubics
from warpsplat.svg.write import MARK, NAMESPACE

SPACE = f"{{{NAMESPACE}}}"
LINK = "http://www.w3.org/1999/xlink"

DRAWN = {
    SPACE + tag
    for tag in ("path", "rect", "circle", "ellipse", "line", "polyline", "polygon", "text", "image", "use")
}
"""Elements that appear as a whole."""

HIDDEN = {
    SPACE + tag
    for tag in ("defs", "clipPath", "mask", "symbol", "marker", "pattern", "filter", "metadata", "style")
}
"""Elements whose content is not drawn in place."""

FADE = 0.3
"""Time for a shape to appear [s]."""

SHORTEST = 0.02
"""Minimum time to draw a stroke [s]."""

PIECES = 8
"""Straight pieces to measure a cubic's length."""


@dataclass(frozen=True)
class Turn:
    """Timing of an element."""

    element: ET.Element
    length: float
    """Length of a stroke [its own units]; 0: the element appears as a whole."""
    start: float
    """[s]"""
    seconds: float
    """Duration."""


def turns(root: ET.Element, seconds: float) -> list[Turn]:
    """Return the timing of all elements, in painter's order: equal times for those that appear, and times by
    length, with the same mean, for strokes.
    """
    found = list(_drawn(root, stroked=False, filled=True))
    if found and found[0][0].tag == f"{SPACE}rect":
        found = found[1:]  # the paper is there from the beginning
    lengths = np.array([length for _, length in found])
    mean = lengths[lengths > 0].mean() if (lengths > 0).any() else 1.0
    weights = np.where(lengths > 0, lengths / mean, 1.0)
    ends = np.cumsum(weights) / max(weights.sum(), 1e-9) * seconds
    return [
        Turn(element, length, float(end - share), max(SHORTEST, float(share)) if length else FADE)
        for (element, length), end, share in zip(found, ends, np.diff(ends, prepend=0.0), strict=True)
    ]


def _drawn(element: ET.Element, *, stroked: bool, filled: bool) -> Iterator[tuple[ET.Element, float]]:
    """Yield the drawn elements, with the lengths of those that are only stroked."""
    if element.tag in HIDDEN:
        return
    stroked, filled = _painted(element, "stroke", stroked), _painted(element, "fill", filled)
    if element.tag in DRAWN:
        line = element.tag == f"{SPACE}path" and stroked and not filled and not _says(element, DASHES)
        yield element, path_length(element.get("d", "")) if line else 0.0
        return
    for child in element:
        yield from _drawn(child, stroked=stroked, filled=filled)


DASHES = "stroke-dasharray"


def _painted(element: ET.Element, paint: str, inherited: bool) -> bool:
    value = _says(element, paint)
    return inherited if value is None else value != "none"


def _says(element: ET.Element, name: str) -> str | None:
    """Return the value of a property in an element itself."""
    for part in element.get("style", "").split(";"):
        key, _, value = part.partition(":")
        if key.strip() == name:
            return value.strip()
    return element.get(name)


def path_length(data: str) -> float:
    """Return the length of the longest subpath [its own units]: dashes restart at each."""
    t = np.linspace(0, 1, PIECES + 1)[:, None]
    s = 1 - t
    weights = np.concatenate([s * s * s, 3 * s * s * t, 3 * s * t * t, t * t * t], axis=1)
    longest = 0.0
    for subpath in cubics(data, keep_dots=True):
        count = (len(subpath.points) - 1) // 3
        controls = subpath.points[3 * np.arange(count)[:, None] + np.arange(4)]
        vertices = product(weights, controls)
        longest = max(longest, float(np.linalg.norm(np.diff(vertices, axis=1), axis=2).sum()))
    return longest


def _read(text: str) -> ET.Element:
    ET.register_namespace("", NAMESPACE)
    ET.register_namespace("xlink", LINK)
    return ET.fromstring(text.encode())


def _written(root: ET.Element) -> str:
    return ET.tostring(root, encoding="unicode")


# A film.


def pictures(text: str, path: Path, width: int | None, seconds: float, *, own: bool) -> Iterator[Frame]:
    """Yield the frames of the drawing of an SVG; the last one is the file as a viewer shows it.

    ``own``: it was written here.
    """
    zoom = zoom_of(path, size_of(text), width)
    size = screen(text, zoom)
    root = _read(text)
    drawn = turns(root, seconds)
    if own:
        for name, side in zip(("width", "height"), size_of(text), strict=True):
            root.set(name, f"{side * zoom:.9g}")
    frames = ticks_of(path, size, seconds)
    unchanged = [dict(turn.element.attrib) for turn in drawn]
    for frame in range(frames):
        now = seconds * (frame + 0.5) / frames
        for turn, attributes in zip(drawn, unchanged, strict=True):
            _set(turn, attributes, now)
        yield picture(_written(root), size, None if own else zoom), seconds / frames
    yield picture(text, size, zoom), 0.0


def _set(turn: Turn, attributes: dict[str, str], now: float) -> None:
    """Show the part of an element that is drawn by a time [s]."""
    element, share = turn.element, (now - turn.start) / turn.seconds
    element.attrib.clear()
    element.attrib.update(attributes)
    if share >= 1:
        return
    if share <= 0:
        element.set("display", "none")
    elif turn.length:
        element.set(DASHES, f"{share * turn.length:.6g} {2 * turn.length:.6g}")
    else:
        element.set("opacity", f"{share * float(attributes.get('opacity', 1)):.3f}")


# An SVG.

STYLE = (
    "<style>"
    ".wf{{animation:wf {fade}s backwards}}"
    ".ws{{animation:ws 1s linear backwards}}"
    "@keyframes wf{{from{{opacity:0}}}}"
    "@keyframes ws{{from{{stroke-dashoffset:var(--l);visibility:hidden}}"
    "1%{{visibility:visible}}from,to{{stroke-dasharray:var(--l)}}to{{stroke-dashoffset:0}}}}"
    "@media(prefers-reduced-motion:reduce){{.wf,.ws{{animation:none}}}}"
    "</style>"
)


def vector(text: str, seconds: float) -> str:
    """Return an SVG that draws its elements one after the other and ends as the original file.

    Style sheets play it, once, also in ``<img>``. Where nothing is animated, or readers ask for less motion,
    it is the file.
    """
    root = _read(text)
    for turn in turns(root, seconds):
        element = turn.element
        timing = f"animation-delay:{number(turn.start, 2)}s"
        if turn.length:
            timing += f";animation-duration:{number(turn.seconds, 2)}s;--l:{math.ceil(turn.length)}px"
        _add(element, "style", timing, ";")
        _add(element, "class", "ws" if turn.length else "wf", " ")
    head, found, rest = _written(root).partition(">")
    return f"{head}{found}{MARK}-->\n{STYLE.format(fade=number(FADE, 2))}{rest.lstrip()}\n"


def _add(element: ET.Element, name: str, value: str, between: str) -> None:
    """Add to an attribute."""
    before = element.get(name, "").rstrip("; ")
    element.set(name, f"{before}{between}{value}" if before else value)
