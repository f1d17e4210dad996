"""Geometry of SVG elements: basic shapes as path data, boxes, transforms as matrices."""

from __future__ import annotations

import re
from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from warpsplat.errors import ImageError
from warpsplat.portable import elementary
from warpsplat.portable.linear import product
from warpsplat.svg.inspect import NUMBER, numbers, view_box
from warpsplat.svg.paths import Points, Subpath
from warpsplat.svg.values import SvgViewport, length

Matrix = npt.NDArray[np.float64]

ACROSS = {"x", "cx", "x1", "x2", "fx", "width", "rx"}
DOWN = {"y", "cy", "y1", "y2", "fy", "height", "ry"}
"""Attributes whose percentages refer to the viewport's width, and to its height; all others: its diagonal."""


def attribute(attributes: Mapping[str, str], name: str, viewport: SvgViewport) -> float | None:
    """Return a length among the attributes [user units]; None if it is missing or not a length."""
    text = attributes.get(name)
    if text is None:
        return None
    reference = viewport.width if name in ACROSS else viewport.height if name in DOWN else viewport.diagonal
    return length(text, reference, name, viewport.font_size)


def outline(tag: str, attributes: Mapping[str, str], viewport: SvgViewport) -> str:
    """Return the path data of a shape element; empty: it draws nothing."""

    def get(name: str, other: str = "") -> float:
        """Return a length; if it is missing, or a negative radius, the ``other``, or 0."""
        value = attribute(attributes, name, viewport)
        if other and (value is None or value < 0):
            value = max(get(other), 0.0)
        return value or 0.0

    if tag == "path":
        return attributes.get("d", "")
    if tag == "line":
        return f"M{get('x1')!r} {get('y1')!r}L{get('x2')!r} {get('y2')!r}"
    if tag in {"polyline", "polygon"}:
        return _poly(attributes.get("points", ""), closed=tag == "polygon")
    if tag == "rect":
        width, height = get("width"), get("height")
        rx, ry = min(get("rx", "ry"), width / 2), min(get("ry", "rx"), height / 2)
        return _rect(get("x"), get("y"), width, height, rx, ry)
    rx, ry = (get("r"), get("r")) if tag == "circle" else (get("rx", "ry"), get("ry", "rx"))
    if not (rx > 0 and ry > 0):
        return ""
    x, y = get("cx"), get("cy")
    arc = f"A{rx!r} {ry!r} 0 0 1 "
    ends = ((x, y + ry), (x - rx, y), (x, y - ry), (x + rx, y))
    return f"M{x + rx!r} {y!r}" + "".join(f"{arc}{u!r} {v!r}" for u, v in ends) + "z"


def _poly(text: str, *, closed: bool) -> str:
    values, _ = numbers(text)
    values = values[: len(values) // 2 * 2]
    return f"M{' '.join(map(repr, values))}{'z' if closed else ''}" if len(values) >= 4 else ""


def _rect(x: float, y: float, width: float, height: float, rx: float, ry: float) -> str:
    if not (width > 0 and height > 0):
        return ""
    if not (rx > 0 and ry > 0):
        return f"M{x!r} {y!r}h{width!r}v{height!r}h{-width!r}z"
    across, down = width - 2 * rx, height - 2 * ry
    right, left = (f"h{across!r}", f"h{-across!r}") if across else ("", "")
    descent, ascent = (f"v{down!r}", f"v{-down!r}") if down else ("", "")
    arc = f"a{rx!r} {ry!r} 0 0 1 "
    return (
        f"M{x + rx!r} {y!r}{right}{arc}{rx!r} {ry!r}{descent}{arc}{-rx!r} {ry!r}"
        f"{left}{arc}{-rx!r} {-ry!r}{ascent}{arc}{rx!r} {-ry!r}z"
    )


def tight_box(subpaths: list[Subpath]) -> Points:
    """Return the least and the largest coordinates of the curves, shape (2, 2)."""
    ends = np.concatenate([subpath.points[::3] for subpath in subpaths])
    low, high = ends.min(axis=0), ends.max(axis=0)
    p0, p1, p2, p3 = (
        np.concatenate([s.points[i::3][: len(s.points) // 3] for s in subpaths]) for i in range(4)
    )
    a, b, c = p3 - 3 * p2 + 3 * p1 - p0, 2 * (p2 - 2 * p1 + p0), p1 - p0
    root = np.sqrt(np.maximum(b * b - 4 * a * c, 0.0))
    q = -0.5 * (b + np.where(b < 0, -root, root))
    for root in (q / a, c / q):  # the stable form of both solutions; NaN: there is none
        t = np.clip(np.nan_to_num(root, nan=0.0, posinf=0.0, neginf=0.0), 0.0, 1.0)
        u = 1 - t
        extreme = u * u * u * p0 + 3 * u * u * t * p1 + 3 * u * t * t * p2 + t * t * t * p3
        low, high = np.minimum(low, extreme.min(axis=0)), np.maximum(high, extreme.max(axis=0))
    return np.stack([low, high])


def similarity(matrix: Matrix) -> float | None:
    """Return the factor by which a map scales; None if directions differ by more than a hundredth."""
    (a, b), (c, d) = np.nan_to_num(matrix[:2, :2])
    with np.errstate(all="ignore"):  # overflow is found where the result is used
        # Half the sum and half the difference of the singular values, in either order.
        turning = elementary.hypot((a + d) / 2, (c - b) / 2)
        mirroring = elementary.hypot((a - d) / 2, (c + b) / 2)
        is_uniform = abs(turning - mirroring) >= 0.99 * (turning + mirroring)
    return float(max(turning, mirroring)) if is_uniform else None


def moved(matrix: Matrix, points: Points) -> Points:
    """Return points under an affine map."""
    return np.asarray(product(points, matrix[:2, :2].T) + matrix[:2, 2])


def translation(x: float, y: float) -> Matrix:
    """Return the map that moves by (x, y)."""
    matrix = np.eye(3)
    matrix[:2, 2] = x, y
    return matrix


ALIGN = re.compile(r"x(Min|Mid|Max)Y(Min|Mid|Max)")


def view_box_map(attributes: Mapping[str, str], width: float, height: float) -> Matrix | None:
    """Return the map of an element's ``viewBox`` to its ``width`` x ``height``; None if it has no box.

    Raises:
        ImageError: The box lies too far away, or ``preserveAspectRatio`` is invalid.
    """
    box = view_box(attributes)
    if box is None:
        return None
    x, y, box_width, box_height = box
    fit = np.array([width / box_width, height / box_height])
    words = attributes.get("preserveAspectRatio", "xMidYMid").split()
    align = words[0] if words else "xMidYMid"
    shift = np.zeros(2)
    if align != "none":
        fit[:] = fit.max() if "slice" in words else fit.min()
        found = ALIGN.fullmatch(align)
        if not found:
            raise ImageError(f"preserveAspectRatio {align[:40]!r} is not known")
        part = np.array([{"Min": 0.0, "Mid": 0.5, "Max": 1.0}[word] for word in found.groups()])
        shift = part * (np.array([width, height]) - fit * (box_width, box_height))
    view = np.diag([*fit, 1.0])
    with np.errstate(all="ignore"):
        view[:2, 2] = shift - fit * (x, y)
    if not np.isfinite(view).all():
        raise ImageError("its viewBox is too far from the origin to be drawn")
    return view


COUNTS = {"matrix": {6}, "translate": {1, 2}, "scale": {1, 2}, "rotate": {1, 3}, "skewX": {1}, "skewY": {1}}
"""Numbers of arguments of each transform function."""

FUNCTION = re.compile(rf"[\s,]*({'|'.join(COUNTS)})\s*\(([^()]*)\)")


def parse_transform(text: str) -> Matrix:
    """Return a ``transform`` as a 3x3 matrix; the identity for a text that is none.

    Raises:
        ImageError: A function or unit is one that only some viewers support.
    """
    matrix = np.eye(3)
    position = 0
    text = text.strip()
    if text in {"", "none"}:
        return matrix
    while position < len(text):
        found, one = FUNCTION.match(text, position), None
        if found and not NUMBER.sub("", found[2]).strip(" ,\t\r\n"):
            one = _function(found[1], [float(value) for value in NUMBER.findall(found[2])])
        if found is None or one is None:
            if "(" not in text:
                return np.eye(3)
            raise ImageError(f"transform {text[:40]!r} is not supported")
        matrix = product(matrix, one)
        position = found.end()
    return matrix


PLACES = {"left": 0.0, "top": 0.0, "center": 0.5, "right": 1.0, "bottom": 1.0}


def about(origin: str, viewport: SvgViewport, matrix: Matrix) -> Matrix:
    """Return a transform about its ``transform-origin``.

    Raises:
        ImageError: The origin is invalid.
    """
    if origin in {"", "none"}:
        return matrix
    words, font_size = origin.split()[:2], viewport.font_size
    if words[0] in {"top", "bottom"} or words[1:] in (["left"], ["right"]):
        words = [*words[1:], "center"][:1] + words[:1]  # the vertical one is first
    at = []
    for word, size in zip([*words, "center"], (viewport.width, viewport.height), strict=False):
        place = PLACES[word] * size if word in PLACES else length(word, size, "transform-origin", font_size)
        if place is None:
            raise ImageError(f"transform-origin {origin[:40]!r} is not known")
        at.append(place)
    return _about(matrix, *at)


def _about(matrix: Matrix, x: float, y: float) -> Matrix:
    return product(product(translation(x, y), matrix), translation(-x, -y))


def _function(name: str, v: list[float]) -> Matrix | None:
    """Return the matrix of a transform function; None if it does not take so many arguments."""
    if len(v) not in COUNTS[name]:
        return None
    if name == "matrix":
        return np.array([v[::2], v[1::2], [0, 0, 1]])
    if name == "translate":
        return translation(v[0], v[1] if len(v) == 2 else 0)
    if name == "scale":
        return np.diag([v[0], v[-1], 1])
    angle = np.deg2rad(v[0])
    matrix = np.eye(3)
    if name != "rotate":
        matrix[(0, 1) if name == "skewX" else (1, 0)] = elementary.tan(angle)
        return matrix
    cosine, sine = float(elementary.cos(angle)), float(elementary.sin(angle))
    matrix[:2, :2] = [[cosine, -sine], [sine, cosine]]
    return _about(matrix, v[1], v[2]) if len(v) == 3 else matrix
