"""Geometry of SVG elements: basic shapes as path data, winding numbers, transforms as matrices."""

from __future__ import annotations

import re
from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from warpsplat.errors import ImageError
from warpsplat.svg.inspect import NUMBER
from warpsplat.svg.paths import Points
from warpsplat.svg.style import length

Matrix = npt.NDArray[np.float64]


def outline(tag: str, attributes: Mapping[str, str], size: tuple[float, float]) -> tuple[str, bool]:
    """Path data of a shape element (empty: draws nothing), and whether it is a rectangle of sharp corners.

    ``size`` is what percentages refer to.
    """
    along = {"x": size[0], "y": size[1], "r": float(np.hypot(*size)) / 2**0.5}
    along |= {"cx": size[0], "x1": size[0], "x2": size[0], "width": size[0], "rx": size[0]}
    along |= {"cy": size[1], "y1": size[1], "y2": size[1], "height": size[1], "ry": size[1]}

    def get(name: str, default: float = 0.0) -> float:
        text = attributes.get(name, "auto")
        return default if text == "auto" else length(text, along[name], name)

    if tag == "path":
        return attributes.get("d", ""), False
    if tag == "line":
        return f"M{get('x1')!r} {get('y1')!r}L{get('x2')!r} {get('y2')!r}", False
    if tag in {"polyline", "polygon"}:
        return _poly(attributes.get("points", ""), closed=tag == "polygon"), False
    if tag == "rect":
        width, height = get("width"), get("height")
        rx, ry = get("rx", -1.0), get("ry", -1.0)
        rx, ry = (ry if rx < 0 else rx), (rx if ry < 0 else ry)
        rx, ry = min(rx, width / 2), min(ry, height / 2)
        return _rect(get("x"), get("y"), width, height, rx, ry), not (rx > 0 and ry > 0)
    if tag == "circle":
        rx = ry = get("r")
    else:
        rx, ry = get("rx", -1.0), get("ry", -1.0)
        rx, ry = (ry if rx < 0 else rx), (rx if ry < 0 else ry)
    if not (rx > 0 and ry > 0):
        return "", False
    x, y = get("cx"), get("cy")
    arc = f"A{rx!r} {ry!r} 0 0 1 "
    ends = ((x, y + ry), (x - rx, y), (x, y - ry), (x + rx, y))
    return f"M{x + rx!r} {y!r}" + "".join(f"{arc}{u!r} {v!r}" for u, v in ends) + "z", False


def _poly(text: str, *, closed: bool) -> str:
    values = NUMBER.findall(text)
    values = values[: len(values) // 2 * 2]
    return f"M{' '.join(values)}{'z' if closed else ''}" if len(values) >= 4 else ""


def _rect(x: float, y: float, width: float, height: float, rx: float, ry: float) -> str:
    if not (width > 0 and height > 0):
        return ""
    if not (rx > 0 and ry > 0):
        return f"M{x!r} {y!r}h{width!r}v{height!r}h{-width!r}z"
    across, down = width - 2 * rx, height - 2 * ry
    arc = f"a{rx!r} {ry!r} 0 0 1 "
    return (
        f"M{x + rx!r} {y!r}h{across!r}{arc}{rx!r} {ry!r}v{down!r}{arc}{-rx!r} {ry!r}"
        f"h{-across!r}{arc}{-rx!r} {-ry!r}v{-down!r}{arc}{rx!r} {-ry!r}z"
    )


def winding(subpaths: list[Points], size: int = 128) -> npt.NDArray[np.intp]:
    """Winding numbers of closed subpaths at ``size`` x ``size`` points of their box."""
    t = np.arange(8)[:, None] / 8
    weights = np.concatenate([(1 - t) ** 3, 3 * t * (1 - t) ** 2, 3 * t * t * (1 - t), t**3], axis=1)
    starts, ends = [], []
    for points in subpaths:
        each = points[np.arange(0, len(points) - 1, 3)[:, None] + np.arange(4)]
        polygon = np.einsum("tk,ckx->ctx", weights, each).reshape(-1, 2)
        polygon = np.concatenate([polygon, points[-1:]])
        starts.append(polygon)
        ends.append(np.roll(polygon, -1, axis=0))
    a, b = np.concatenate(starts), np.concatenate(ends)
    low, high = a.min(axis=0), a.max(axis=0)
    unit = np.where(high > low, high - low, 1.0) / size
    a, b = (a - low) / unit - 0.5, (b - low) / unit - 0.5
    turns = np.zeros((size, size + 1), np.intp)
    for row in range(size):
        crossing = (a[:, 1] <= row) != (b[:, 1] <= row)
        p, q = a[crossing], b[crossing]
        x = p[:, 0] + (row - p[:, 1]) / (q[:, 1] - p[:, 1]) * (q[:, 0] - p[:, 0])
        column = np.clip(np.ceil(x), 0, size).astype(np.intp)
        np.add.at(turns[row], column, np.where(q[:, 1] > p[:, 1], 1, -1))
    return np.cumsum(turns, axis=1)[:, :size]


FUNCTION = re.compile(r"[\s,]*(matrix|translate|scale|rotate|skewX|skewY)\s*\(([^()]*)\)")


def parse_transform(text: str) -> Matrix:
    """A ``transform`` as a 3x3 matrix.

    Raises:
        ImageError: not a list of the functions of SVG 1.1.
    """
    matrix = np.eye(3)
    position = 0
    text = text.strip()
    if text in {"", "none"}:
        return matrix
    while position < len(text):
        found = FUNCTION.match(text, position)
        values = [float(v) for v in NUMBER.findall(found[2])] if found else []
        one = (
            _function(found[1], values) if found and not NUMBER.sub("", found[2]).strip(" ,\t\r\n") else None
        )
        if found is None or one is None:
            raise ImageError(f"transform {text[:40]!r} is not supported")
        matrix = matrix @ one
        position = found.end()
    return matrix


def _function(name: str, v: list[float]) -> Matrix | None:
    count = len(v)
    if name == "matrix" and count == 6:
        return np.array([[v[0], v[2], v[4]], [v[1], v[3], v[5]], [0, 0, 1]])
    if name == "translate" and count in {1, 2}:
        return np.array([[1, 0, v[0]], [0, 1, v[1] if count == 2 else 0], [0, 0, 1]])
    if name == "scale" and count in {1, 2}:
        return np.diag([v[0], v[-1], 1])
    if name == "rotate" and count in {1, 3}:
        angle = np.deg2rad(v[0])
        turn = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
        if count == 3:
            center = np.array([[1, 0, v[1]], [0, 1, v[2]], [0, 0, 1]])
            return np.asarray(center @ turn @ np.linalg.inv(center))
        return turn
    if name in {"skewX", "skewY"} and count == 1:
        matrix = np.eye(3)
        matrix[(0, 1) if name == "skewX" else (1, 0)] = np.tan(np.deg2rad(v[0]))
        return matrix
    return None
