"""Scene -> SVG text.

Paths follow SVG 1.1 section 8.3; coordinates are relative (``c``), each rounded against the rounded position
before it, so that rounding errors do not add up.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from warpsplat import __version__
from warpsplat.scene import Basis, FloatArray, Kind, Scene

NAMESPACE = "http://www.w3.org/2000/svg"

OPACITY_DECIMALS = 2
"""An 8-bit colour moves by less than an eighth of a level for half a unit of the third decimal."""

WIDTH_DECIMALS = 1
"""Of a stroke's width, which has no separators to save."""

OPAQUE = 1 - 0.5 / 255
"""From here on an opacity is left out: opaque paths are smaller and quicker to draw."""

GRIDS = (0.125, 0.25, 0.5, *map(float, (1, 2, 3, 4, 5, 6, 8, 10, 12, 16, 20, 25, 32, 50, 100)))
"""Units of the view box a pixel of the picture: sizes of the view box have few decimals with each."""

STROKE_ATTRIBUTES = 'fill="none" stroke-linecap="round" stroke-linejoin="round"'


def number(value: float, decimals: int) -> str:
    """Shortest decimal form: no trailing zeros, no leading zero, no negative zero."""
    text = f"{value:.{decimals}f}"
    if "." in text:
        text = text.rstrip("0").rstrip(".")
    if text in {"-0", ""}:
        return "0"
    return re.sub(r"^(-?)0\.", r"\1.", text)


def rounded(scene: Scene, per_pixel: float) -> Scene:
    """What a file with ``per_pixel`` units a pixel holds of ``scene``."""
    spline = scene.basis[np.repeat(np.arange(len(scene)), scene.point_counts())] == Basis.SPLINE
    unit = np.where(spline, 2 / per_pixel, 1 / per_pixel)[:, None]
    shown = np.round(scene.opacities.astype(np.float64), OPACITY_DECIMALS)
    return replace(
        scene,
        points=(np.round(scene.points / unit) * unit).astype(np.float32),
        colors=(np.round(scene.colors * 255.0) / 255).astype(np.float32),
        opacities=np.where(scene.opacities < OPAQUE, shown, 1).astype(np.float32),
        widths=(np.round(scene.widths * per_pixel, WIDTH_DECIMALS) / per_pixel).astype(np.float32),
    )


def integers(values: npt.NDArray[np.int64]) -> str:
    """Whole numbers in a row with the fewest separators: a sign separates itself."""
    return " ".join(map(str, values.ravel().tolist())).replace(" -", "-")


def path_data(points: FloatArray, kind: Kind, basis: Basis, per_pixel: float) -> str:
    """``d`` of one shape, points of shape (point, 2) as in ``Scene``, in whole numbers of the view box."""
    closed = kind == Kind.FILL
    if basis == Basis.SPLINE:
        return spline_data(points, closed, per_pixel)
    grid = np.round(points.astype(np.float64) * per_pixel).astype(np.int64)
    if closed:
        grid = np.concatenate([grid, grid[:1]])
    count = (len(grid) - 1) // 3
    steps = grid[1:].reshape(count, 3, 2) - grid[:-1:3, None]
    if closed:
        # A cubic without extent draws nothing in a fill; in a stroke it may be the dot that is all there is.
        steps = steps[steps.any(axis=(1, 2))]
    text = f"M{integers(grid[0])}"
    return f"{text}c{integers(steps)}" if len(steps) else f"{text}z"


def spline_data(points: FloatArray, closed: bool, per_pixel: float) -> str:
    """``d`` of a spline: one quadratic, and smooth ones, whose control points follow (SVG 1.1, 8.3.7).

    The points lie on even numbers, so that the quadratics meet on whole ones. A ring is written from the point
    from which it takes the fewest characters.
    """
    half = np.round(points.astype(np.float64) * (per_pixel / 2)).astype(np.int64)
    if closed:
        half = np.roll(half, -_cheapest_start(half), axis=0)
        joints = half + np.roll(half, 1, axis=0)
        joints = np.concatenate([joints, joints[:1]])
        control = 2 * half[0]
    else:
        joints = np.concatenate([2 * half[:1], half[1:-2] + half[2:-1], 2 * half[-1:]])
        control = 2 * half[1]
    steps = np.diff(joints, axis=0)
    text = f"M{integers(joints[0])}q{integers(np.stack([control - joints[0], steps[0]]))}"
    return f"{text}t{integers(steps[1:])}" if len(steps) > 1 else text


def _digits(values: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
    """Digits of both coordinates together, shape (point, 2) -> (point,)."""
    return (np.searchsorted(POWERS, np.abs(values), side="right") + 1).sum(axis=1)


POWERS = 10 ** np.arange(1, 16)


def _cheapest_start(half: npt.NDArray[np.int64]) -> int:
    """The point of a ring before which to start: where the start, and the control point that is written
    besides, have the fewest digits. The steps are the same from everywhere.
    """
    before = np.roll(half, 1, axis=0)
    return int(np.argmin(_digits(half + before) + _digits(half - before)))


def hex_color(color: FloatArray) -> str:
    """sRGB in [0, 1] -> ``#rrggbb``, or ``#rgb`` where that is the same."""
    text = "".join(f"{int(v):02x}" for v in np.clip(np.round(color.astype(np.float64) * 255), 0, 255))
    if text[0] == text[1] and text[2] == text[3] and text[4] == text[5]:
        text = text[0] + text[2] + text[4]
    return f"#{text}"


PAINTED = {Kind.FILL: "fill", Kind.STROKE: "stroke"}
"""The paint attribute of each kind."""


def _element(scene: Scene, shape: int, per_pixel: float, opacity_scale: float) -> str:
    """The path of one shape."""
    kind = Kind(int(scene.kind[shape]))
    attribute = PAINTED[kind]
    style = f'{attribute}="{hex_color(scene.colors[shape])}"'
    if kind == Kind.STROKE:
        style += f' stroke-width="{number(float(scene.widths[shape] * per_pixel), WIDTH_DECIMALS)}"'
    shown = min(float(scene.opacities[shape]) * opacity_scale, 1.0)
    if shown < OPAQUE:
        style += f' {attribute}-opacity="{number(shown, OPACITY_DECIMALS)}"'
    data = path_data(scene.points_of(shape), kind, Basis(int(scene.basis[shape])), per_pixel)
    return f'<path d="{data}" {style}/>'


def path_sizes(scene: Scene, per_pixel: float) -> npt.NDArray[np.int64]:
    """Bytes of each shape in a file with ``per_pixel`` units a pixel, shape (shape,)."""
    return np.array([len(_element(scene, i, per_pixel, 1.0)) for i in range(len(scene))], np.int64)


def _groups(scene: Scene, per_pixel: float, opacity_scale: float) -> Iterator[str]:
    """Neighbours of one kind share a group, and what it says of them."""
    for kind, shapes in itertools.groupby(range(len(scene)), lambda i: Kind(int(scene.kind[i]))):
        yield f"<g {STROKE_ATTRIBUTES}>" if kind == Kind.STROKE else "<g>"
        yield from (_element(scene, i, per_pixel, opacity_scale) for i in shapes)
        yield "</g>"


def write_svg(
    scene: Scene,
    *,
    per_pixel: float = GRIDS[-1],
    metadata: str = "",
    opacity_scale: float = 1.0,
    background: bool = True,
) -> str:
    """The scene as an SVG document: a background and one path a shape, in painter's order.

    Args:
        scene: what to write; canvas units become user units.
        per_pixel: units of the view box a pixel; coordinates are whole numbers of units, points of splines
            even ones.
        metadata: text for the ``metadata`` element, besides the program's name and version.
        opacity_scale: opacity of a solid path over that of the scene's shape. A splat's plateau is a little
            below 1 (``constants.PLATEAU``): a solid path needs that much less opacity to look alike.
        background: whether to write it; without, the picture is transparent where no shape is.
    """
    canvas = scene.canvas
    fill = hex_color(canvas.background)
    width, height = (number(x * per_pixel, 3) for x in (canvas.width, canvas.height))
    behind = f'<rect width="{width}" height="{height}" fill="{fill}"/>\n' if background else ""
    shapes = "".join(_groups(scene, per_pixel, opacity_scale))
    note = f"warpsplat {__version__} {metadata}".strip()
    return (
        f'<svg xmlns="{NAMESPACE}" width="{canvas.width}" height="{canvas.height}" '
        f'viewBox="0 0 {width} {height}">\n'
        f"<metadata>{note}</metadata>\n"
        f"{behind}{shapes}\n</svg>\n"
    )


OUR_HEAD = re.compile(
    rf'<svg xmlns="{re.escape(NAMESPACE)}" width="(\d+)" height="(\d+)" viewBox="0 0 ([\d.]+) ([\d.]+)">\n'
    "<metadata>warpsplat "
)
"""How a file written here begins: its size in pixels, and that in units of its view box."""


def resized(text: str, width: int, height: int, scale: float, top: int = 0) -> str:
    """A file written here, ``scale`` px large for each pixel of its own, cut to the ``width`` x ``height`` px
    from the left and from ``top`` on.
    """
    found = OUR_HEAD.match(text)
    assert found
    unit = float(found[3]) / float(found[1]) / scale
    view = f"0 {top * unit:.9g} {width * unit:.9g} {height * unit:.9g}"
    head = (
        f'<svg xmlns="{NAMESPACE}" width="{width}" height="{height}" viewBox="{view}">\n<metadata>warpsplat '
    )
    return head + text[found.end() :]


def read_metadata(text: str) -> str:
    """The metadata text of a file written here; empty if there is none."""
    found = re.search(r"<metadata>warpsplat (.*?)</metadata>", text[:1000])
    return found.group(1) if found else ""
