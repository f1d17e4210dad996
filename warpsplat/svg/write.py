"""Scene -> SVG text.

Paths follow SVG 1.1 section 8.3; coordinates are relative (``c``), each rounded against the rounded position
before it, so that rounding errors do not add up.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterator

import numpy as np

from warpsplat import __version__
from warpsplat.scene import FloatArray, Kind, Scene

NAMESPACE = "http://www.w3.org/2000/svg"

OPACITY_DECIMALS = 3
"""An 8-bit colour moves by less than an eighth of a level for half a unit of the third decimal."""

OPAQUE = 1 - 0.5 / 255
"""From here on an opacity is left out: opaque paths are smaller and quicker to draw."""

STROKE_ATTRIBUTES = 'fill="none" stroke-linecap="round" stroke-linejoin="round"'


def number(value: float, decimals: int) -> str:
    """Shortest decimal form: no trailing zeros, no leading zero, no negative zero."""
    text = f"{value:.{decimals}f}"
    if "." in text:
        text = text.rstrip("0").rstrip(".")
    if text in {"-0", ""}:
        return "0"
    return re.sub(r"^(-?)0\.", r"\1.", text)


def join_numbers(values: list[str]) -> str:
    """Numbers in a row with the fewest separators: a sign, or a point after a point, separates itself."""
    out: list[str] = []
    for i, text in enumerate(values):
        tight = i == 0 or text[0] == "-" or (text[0] == "." and "." in values[i - 1])
        out.append(text if tight else " " + text)
    return "".join(out)


def path_data(points: FloatArray, kind: Kind, precision: int) -> str:
    """``d`` of one shape, points of shape (point, 2) as in ``Scene``."""
    closed = kind == Kind.FILL
    unit = 10**precision
    grid = np.round(points.astype(np.float64) * unit).astype(np.int64)
    if closed:
        grid = np.concatenate([grid, grid[:1]])
    start = join_numbers([number(x / unit, precision) for x in grid[0]])
    relative: list[str] = []
    for i in range(1, len(grid), 3):
        origin = grid[i - 1]
        steps = grid[i : i + 3] - origin
        # A cubic without extent draws nothing in a fill; in a stroke it may be the dot that is all there is.
        if steps.any() or not closed:
            relative += [number(x / unit, precision) for x in steps.ravel()]
    if not relative:
        return f"M{start}z"
    return f"M{start}c{join_numbers(relative)}{'z' if closed else ''}"


def hex_color(color: FloatArray) -> str:
    """sRGB in [0, 1] -> ``#rrggbb``, or ``#rgb`` where that is the same."""
    text = "".join(f"{int(v):02x}" for v in np.clip(np.round(color.astype(np.float64) * 255), 0, 255))
    if text[0] == text[1] and text[2] == text[3] and text[4] == text[5]:
        text = text[0] + text[2] + text[4]
    return f"#{text}"


PAINTED = {Kind.FILL: "fill", Kind.STROKE: "stroke"}
"""The paint attribute of each kind."""


def _element(scene: Scene, shape: int, precision: int, opacity_scale: float) -> str:
    """The path of one shape."""
    kind = Kind(int(scene.kind[shape]))
    attribute = PAINTED[kind]
    style = f'{attribute}="{hex_color(scene.colors[shape])}"'
    if kind == Kind.STROKE:
        style += f' stroke-width="{number(float(scene.widths[shape]), 2)}"'
    shown = min(float(scene.opacities[shape]) * opacity_scale, 1.0)
    if shown < OPAQUE:
        style += f' {attribute}-opacity="{number(shown, OPACITY_DECIMALS)}"'
    return f'<path d="{path_data(scene.points_of(shape), kind, precision)}" {style}/>'


def _groups(scene: Scene, precision: int, opacity_scale: float) -> Iterator[str]:
    """Neighbours of one kind share a group, and what it says of them."""
    for kind, shapes in itertools.groupby(range(len(scene)), lambda i: Kind(int(scene.kind[i]))):
        yield f"<g {STROKE_ATTRIBUTES}>" if kind == Kind.STROKE else "<g>"
        yield from (_element(scene, i, precision, opacity_scale) for i in shapes)
        yield "</g>"


def write_svg(
    scene: Scene,
    *,
    precision: int = 1,
    metadata: str = "",
    opacity_scale: float = 1.0,
    background: bool = True,
) -> str:
    """The scene as an SVG document: a background and one path a shape, in painter's order.

    Args:
        scene: what to write; canvas units become user units.
        precision: decimals of coordinates.
        metadata: text for the ``metadata`` element, besides the program's name and version.
        opacity_scale: opacity of a solid path over that of the scene's shape. A splat's plateau is a little
            below 1 (``constants.PLATEAU``): a solid path needs that much less opacity to look alike.
        background: whether to write it; without, the picture is transparent where no shape is.
    """
    canvas = scene.canvas
    fill = hex_color(canvas.background)
    behind = f'<rect width="{canvas.width}" height="{canvas.height}" fill="{fill}"/>\n' if background else ""
    shapes = "\n".join(_groups(scene, precision, opacity_scale))
    note = f"warpsplat {__version__} {metadata}".strip()
    return (
        f'<svg xmlns="{NAMESPACE}" width="{canvas.width}" height="{canvas.height}" '
        f'viewBox="0 0 {canvas.width} {canvas.height}">\n'
        f"<metadata>{note}</metadata>\n"
        f"{behind}{shapes}\n</svg>\n"
    )


def resized(text: str, width: int, height: int, scale: float) -> str:
    """A file written here, to be shown on ``width`` x ``height`` px at ``scale`` px a unit, not stretched."""
    view = f'width="{width}" height="{height}" viewBox="0 0 {width / scale:.9g} {height / scale:.9g}"'
    return re.sub(r'width="\d+" height="\d+" viewBox="[^"]*"', view, text, count=1)


def read_metadata(text: str) -> str:
    """The metadata text of a file written here; empty if there is none."""
    found = re.search(r"<metadata>warpsplat (.*?)</metadata>", text[:1000])
    return found.group(1) if found else ""
