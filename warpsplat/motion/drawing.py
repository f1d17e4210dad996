"""Animations of the order of drawing: strokes grow as if drawn by a pen, all other shapes fade in."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np

from warpsplat.motion.films import Frame, frame_count, rasterised, zoom_and_size
from warpsplat.portable.linear import product
from warpsplat.run.svg import size_of
from warpsplat.svg import document
from warpsplat.svg.inspect import NAMESPACE
from warpsplat.svg.numbers import number
from warpsplat.svg.paths import cubics
from warpsplat.svg.write import MARK

SPACE = f"{{{NAMESPACE}}}"
LINK = "http://www.w3.org/1999/xlink"

DRAWN = {SPACE + tag for tag in (*document.DRAWN, "text", "image", "use")}
"""Elements that appear as a whole."""

HIDDEN = {
    SPACE + tag
    for tag in ("defs", "clipPath", "mask", "symbol", "marker", "pattern", "filter", "metadata", "style")
}
"""Elements whose content is not drawn where it stands."""

DASHES = "stroke-dasharray"

FADE = 0.3
"""Time in which a shape fades in [s]."""


class DrawnElement(NamedTuple):
    """An element, and when it is drawn."""

    element: ET.Element
    length: float
    """Length of a stroke in its own units; 0: it fades in."""
    start: float
    """[s]"""
    seconds: float


def schedule(root: ET.Element, seconds: float) -> list[DrawnElement]:
    """Return the elements in drawing order, with their times.

    Each stroke's time is proportional to its length; all other elements take as long as the mean stroke.
    """
    found = list(_drawn(root, stroked=False, filled=True))
    if found and found[0][0].tag == f"{SPACE}rect":
        found = found[1:]  # the background is there from the beginning
    lengths = np.array([length for _, length in found])
    mean = lengths[lengths > 0].mean() if (lengths > 0).any() else 1.0
    weights = np.where(lengths > 0, lengths / mean, 1.0)
    ends = np.cumsum(weights) / max(weights.sum(), 1e-9) * seconds
    min_stroke_seconds = 0.02
    return [
        DrawnElement(
            element, length, float(end - share), max(min_stroke_seconds, float(share)) if length else FADE
        )
        for (element, length), end, share in zip(found, ends, np.diff(ends, prepend=0.0), strict=True)
    ]


def _drawn(element: ET.Element, *, stroked: bool, filled: bool) -> Iterator[tuple[ET.Element, float]]:
    """Yield the elements that are drawn, with the lengths of paths that are only stroked, else 0."""
    if element.tag in HIDDEN:
        return
    stroked = (_property(element, "stroke") or ("" if stroked else "none")) != "none"
    filled = (_property(element, "fill") or ("" if filled else "none")) != "none"
    if element.tag in DRAWN:
        line = element.tag == f"{SPACE}path" and stroked and not filled and not _property(element, DASHES)
        yield element, path_length(element.get("d", "")) if line else 0.0
        return
    for child in element:
        yield from _drawn(child, stroked=stroked, filled=filled)


def _property(element: ET.Element, name: str) -> str | None:
    """Return the element's own value of a property, which may be in its style."""
    for declaration in element.get("style", "").split(";"):
        key, _, value = declaration.partition(":")
        if key.strip() == name:
            return value.strip()
    return element.get(name)


def path_length(data: str) -> float:
    """Return the length of the longest subpath [own units]: dashes restart at each."""
    pieces = 8  # line segments that approximate a cubic's length
    t = np.linspace(0, 1, pieces + 1)[:, None]
    s = 1 - t
    weights = np.concatenate([s * s * s, 3 * s * s * t, 3 * s * t * t, t * t * t], axis=1)
    longest = 0.0
    for subpath in cubics(data, keep_dots=True):
        count = (len(subpath.points) - 1) // 3
        vertices = product(weights, subpath.points[3 * np.arange(count)[:, None] + np.arange(4)])
        longest = max(longest, float(np.linalg.norm(np.diff(vertices, axis=1), axis=2).sum()))
    return longest


def _parsed(text: str) -> ET.Element:
    ET.register_namespace("", NAMESPACE)
    ET.register_namespace("xlink", LINK)
    return ET.fromstring(text.encode())


def film(text: str, path: Path, width: int | None, seconds: float, *, own: bool) -> Iterator[Frame]:
    """Yield the frames of a film; the last one is the file as a viewer shows it.

    ``width``: see ``zoom_of``; ``own``: whether warpsplat wrote the SVG.
    """
    zoom, size = zoom_and_size(text, path, width)
    root = _parsed(text)
    elements = schedule(root, seconds)
    if own:
        for name, side in zip(("width", "height"), size_of(text, path.name), strict=True):
            root.set(name, f"{side * zoom:.9g}")
    count = frame_count(path, size, seconds)
    originals = [dict(drawn.element.attrib) for drawn in elements]
    for frame in range(count):
        now = seconds * (frame + 0.5) / count
        for drawn, attributes in zip(elements, originals, strict=True):
            _show_part(drawn, attributes, now)
        yield rasterised(ET.tostring(root, encoding="unicode"), size, None if own else zoom), seconds / count
    yield rasterised(text, size, zoom), 0.0


def _show_part(drawn: DrawnElement, attributes: dict[str, str], now: float) -> None:
    """Show as much of an element as is drawn at ``now`` [s]."""
    element, share = drawn.element, (now - drawn.start) / drawn.seconds
    element.attrib.clear()
    element.attrib.update(attributes)
    if share <= 0:
        element.set("display", "none")
    elif share < 1 and drawn.length:
        element.set(DASHES, f"{share * drawn.length:.6g} {2 * drawn.length:.6g}")
    elif share < 1:
        element.set("opacity", f"{share * float(attributes.get('opacity', 1)):.3f}")


STYLE = (
    "<style>"
    f".wf{{animation:wf {number(FADE, 2)}s backwards}}"
    ".ws{animation:ws 1s linear backwards}"
    "@keyframes wf{from{opacity:0}}"
    "@keyframes ws{from{stroke-dashoffset:var(--l);visibility:hidden}"
    "1%{visibility:visible}from,to{stroke-dasharray:var(--l)}to{stroke-dashoffset:0}}"
    "@media(prefers-reduced-motion:reduce){.wf,.ws{animation:none}}"
    "</style>"
)


def animated_svg(text: str, seconds: float) -> str:
    """Return an SVG whose elements are drawn one after the other, once, also in ``<img>``.

    Style sheets animate it. Where nothing is animated, or readers prefer less motion, it shows the file.
    """
    root = _parsed(text)
    for drawn in schedule(root, seconds):
        timing = f"animation-delay:{number(drawn.start, 2)}s"
        if drawn.length:
            timing += f";animation-duration:{number(drawn.seconds, 2)}s;--l:{math.ceil(drawn.length)}px"
        _append(drawn.element, "style", timing, ";")
        _append(drawn.element, "class", "ws" if drawn.length else "wf", " ")
    head, bracket, rest = ET.tostring(root, encoding="unicode").partition(">")
    return f"{head}{bracket}{MARK}-->\n{STYLE}{rest.lstrip()}\n"


def _append(element: ET.Element, name: str, value: str, separator: str) -> None:
    """Append to an attribute."""
    before = element.get(name, "").rstrip("; ")
    element.set(name, f"{before}{separator}{value}" if before else value)
