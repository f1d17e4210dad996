"""Scene -> SVG text.

Paths follow SVG 1.1 section 8.3; coordinates are relative (``c``), each rounded against the rounded position
before it, so that rounding errors do not add up.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterable, Iterator
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from warpsplat import __version__
from warpsplat.scene import Basis, FloatArray, Kind, Scene
from warpsplat.svg.numbers import hex_colors, number
from warpsplat.svg.paints import SHARE_DECIMALS, gradients

NAMESPACE = "http://www.w3.org/2000/svg"

OPACITY_DECIMALS = 2
"""An 8-bit colour moves by less than an eighth of a level for half a unit of the third decimal."""

WIDTH_STEP = 0.25
"""Coarsest step of a stroke's width [px]: a unit of the view box where that is as fine, else a tenth."""

OPAQUE = 1 - 0.5 * 10.0**-OPACITY_DECIMALS
"""From here on an opacity rounds to 1 and is left out: opaque paths are smaller and quicker to draw."""

GRIDS = (0.125, 0.25, 0.5, *map(float, (1, 2, 3, 4, 5, 6, 8, 10, 12, 16, 20, 25, 32, 50, 100)))
"""Units of the view box a pixel of the picture: sizes of the view box have few decimals with each."""

STROKE_ATTRIBUTES = 'fill="none" stroke-linecap="round" stroke-linejoin="round"'


def width_decimals(per_pixel: float) -> int:
    """Decimals of a stroke's width."""
    return 0 if per_pixel * WIDTH_STEP >= 1 else 1


def rounded(scene: Scene, per_pixel: float) -> Scene:
    """What a file with ``per_pixel`` units a pixel holds of ``scene``."""
    spline = np.repeat(scene.basis, scene.point_counts()) == Basis.SPLINE
    per_unit = np.where(spline, per_pixel / 2, per_pixel)[:, None]
    points, colors, opacities, widths = (
        values.astype(np.float64) for values in (scene.points, scene.colors, scene.opacities, scene.widths)
    )
    shown = np.where(opacities < OPAQUE, np.round(opacities, OPACITY_DECIMALS), 1)
    return replace(
        scene,
        points=(np.round(points * per_unit) / per_unit).astype(np.float32),
        colors=(np.round(colors * 255) / 255).astype(np.float32),
        opacities=shown.astype(np.float32),
        stop_offsets=np.round(scene.stop_offsets, SHARE_DECIMALS),
        stop_colors=(np.round(scene.stop_colors * 255) / 255).astype(np.float32),
        stop_opacities=np.round(scene.stop_opacities, SHARE_DECIMALS),
        widths=(np.round(widths * per_pixel, width_decimals(per_pixel)) / per_pixel).astype(np.float32),
    )


Pair = tuple[int, int]


def integers(pairs: Iterable[Pair]) -> str:
    """Whole numbers in a row with the fewest separators: a sign separates itself."""
    return " ".join([f"{x} {y}" for x, y in pairs]).replace(" -", "-")


def minus(a: Pair, b: Pair) -> Pair:
    """The way from ``b`` to ``a``."""
    return a[0] - b[0], a[1] - b[1]


def path_data(points: FloatArray, kind: Kind, basis: Basis, per_pixel: float) -> str:
    """``d`` of one shape, points of shape (point, 2) as in ``Scene``, in whole numbers of the view box."""
    closed = kind == Kind.FILL
    # Points of a spline lie on even numbers, so that its quadratics meet on whole ones.
    unit = per_pixel / 2 if basis == Basis.SPLINE else per_pixel
    grid = [(x, y) for x, y in np.round(points.astype(np.float64) * unit).astype(np.int64).tolist()]
    return spline_data(grid, closed) if basis == Basis.SPLINE else cubic_data(grid, closed)


def cubic_data(grid: list[Pair], closed: bool) -> str:
    """``d`` of a chain of cubics."""
    chain = [*grid, grid[0]] if closed else grid
    steps: list[Pair] = []
    for i in range(0, len(chain) - 1, 3):
        cubic = [minus(point, chain[i]) for point in chain[i + 1 : i + 4]]
        # A cubic without extent draws nothing in a fill; in a stroke it may be the dot that is all there is.
        if not closed or any(x or y for x, y in cubic):
            steps += cubic
    text = f"M{integers(chain[:1])}"
    return f"{text}c{integers(steps)}" if steps else f"{text}z"


def spline_data(half: list[Pair], closed: bool) -> str:
    """``d`` of a spline: one quadratic, and smooth ones, whose control points follow (SVG 1.1, 8.3.7).

    ``half``: its points in half of the numbers that are written. A ring is written from where that takes the
    fewest characters.
    """
    if closed:
        start = _cheapest_start(half)
        ring = half[start:] + half[:start]
        ring = [ring[-1], *ring, ring[0]]
    else:
        ring = half
    joints = [(a + c, b + d) for (a, b), (c, d) in itertools.pairwise(ring)]
    if not closed:
        joints = [(2 * half[0][0], 2 * half[0][1]), *joints[1:-1], (2 * half[-1][0], 2 * half[-1][1])]
    control = (2 * ring[1][0], 2 * ring[1][1])
    steps = [minus(after, before) for before, after in itertools.pairwise(joints)]
    text = f"M{integers(joints[:1])}q{integers([minus(control, joints[0]), steps[0]])}"
    return f"{text}t{integers(steps[1:])}" if len(steps) > 1 else text


def _cheapest_start(half: list[Pair]) -> int:
    """The point of a ring before which to start: the start, and the control point that is written besides,
    are shortest there. The steps are the same from everywhere, but the second needs no separator.
    """
    near = zip([half[-1], *half[:-1]], half, [*half[2:], *half[:2]], strict=True)
    lengths = [
        len(f"{a + c} {b + d} {c - a} {d - b}") - (b + d < 0) - (d - b < 0) - (e >= c)
        for (a, b), (c, d), (e, _) in near
    ]
    return lengths.index(min(lengths))


PAINTED = {Kind.FILL: "fill", Kind.STROKE: "stroke"}
"""The paint attribute of each kind."""


def _path(scene: Scene, shape: int, color: str, per_pixel: float, opacity: str) -> str:
    """The path of one shape; ``opacity``: its attribute, or nothing."""
    kind = Kind(int(scene.kind[shape]))
    style = f'{PAINTED[kind]}="{color}"'
    if kind == Kind.STROKE:
        width = number(float(scene.widths[shape]) * per_pixel, width_decimals(per_pixel))
        style += f' stroke-width="{width}"'
    data = path_data(scene.points_of(shape), kind, Basis(int(scene.basis[shape])), per_pixel)
    return f'<path d="{data}" {style}{opacity}/>'


def _colors(scene: Scene, per_pixel: float) -> list[str]:
    """The paint of each shape."""
    colors = hex_colors(scene.colors)
    for shape, name in gradients(scene, per_pixel)[1].items():
        colors[shape] = f"url(#{name})"
    return colors


def _opacities(scene: Scene, opacity_scale: float) -> list[str]:
    """The attribute of each shape's opacity; empty for opaque ones."""
    shown = np.minimum(scene.opacities.astype(np.float64) * opacity_scale, 1.0).tolist()
    return [
        f' {PAINTED[Kind(kind)]}-opacity="{number(value, OPACITY_DECIMALS)}"' if value < OPAQUE else ""
        for kind, value in zip(scene.kind.tolist(), shown, strict=True)
    ]


def path_sizes(scene: Scene, per_pixel: float) -> npt.NDArray[np.int64]:
    """Bytes of each shape in a file with ``per_pixel`` units a pixel, by itself, shape (shape,)."""
    colors, opacities = _colors(scene, per_pixel), _opacities(scene, 1.0)
    paths = (_path(scene, i, colors[i], per_pixel, opacities[i]) for i in range(len(scene)))
    return np.array([len(path) for path in paths], np.int64)


def _groups(scene: Scene, per_pixel: float, opacity_scale: float) -> Iterator[str]:
    """Neighbours of one kind share a group, and what it says of them; neighbours of one opacity a group in it
    where that is shorter.
    """
    colors, opacities = _colors(scene, per_pixel), _opacities(scene, opacity_scale)
    for kind, shapes in itertools.groupby(range(len(scene)), lambda i: Kind(int(scene.kind[i]))):
        yield f"<g {STROKE_ATTRIBUTES}>" if kind == Kind.STROKE else "<g>"
        for opacity, run in itertools.groupby(shapes, lambda i: opacities[i]):
            alike = list(run)
            group = f"<g{opacity}>", "</g>"
            shared = len(alike) * len(opacity) > len("".join(group))
            paths = (_path(scene, i, colors[i], per_pixel, "" if shared else opacity) for i in alike)
            yield from (group[0], *paths, group[1]) if shared else paths
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
        background: whether to write it, if the canvas has one; without, the picture is transparent where no
            shape is.
    """
    canvas = scene.canvas
    width, height = (number(x * per_pixel, 3) for x in (canvas.width, canvas.height))
    behind = ""
    if background and canvas.background is not None:
        fill = hex_colors(canvas.background[None])[0]
        behind = f'<rect width="{width}" height="{height}" fill="{fill}"/>\n'
    elements, _ = gradients(scene, per_pixel)
    defs = f"<defs>{''.join(elements)}</defs>\n" if elements else ""
    shapes = "".join(_groups(scene, per_pixel, opacity_scale))
    note = f"warpsplat {__version__} {metadata}".strip()
    return (
        f'<svg xmlns="{NAMESPACE}" width="{canvas.width}" height="{canvas.height}" '
        f'viewBox="0 0 {width} {height}">\n'
        f"<metadata>{note}</metadata>\n"
        f"{defs}{behind}{shapes}\n</svg>\n"
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
