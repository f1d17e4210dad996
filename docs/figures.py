"""The figures of "How it works", drawn from the renderer's own arrays: ``python docs/figures.py [FOLDER]``.

A small scene goes through the stages once, forward and back; each figure reads the buffers of one stage.
"""

from __future__ import annotations

import base64
import io
import sys
from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np
import numpy.typing as npt
from PIL import Image

import warpsplat
from warpsplat.kernels import constants
from warpsplat.rendering.backend import Backend, Viewport
from warpsplat.rendering.device import start_warp
from warpsplat.rendering.models import EXACT
from warpsplat.rendering.outline import Outline
from warpsplat.rendering.parameters import Parameters
from warpsplat.rendering.renderer import Renderer

Array = npt.NDArray[np.float32]

FOLDER = Path(__file__).parent / "images" / "how"
TILE = constants.TILE
ZOOM = 10
"""Units of a figure to a pixel of the scene."""

SVG = """<svg xmlns="http://www.w3.org/2000/svg" width="64" height="48">
<rect width="64" height="48" fill="#dfeaf2"/>
<path fill="#f2b84b" d="M51 5c5 0 9 4 9 9s-4 9-9 9-9-4-9-9 4-9 9-9z"/>
<path fill="#3f7d6e" fill-opacity=".9"
 d="M-4 50c4-18 12-30 22-29 10 1 14 12 22 13 10 1 16-8 28 2l2 14z"/>
<path fill="#b3405a" fill-opacity=".65"
 d="M13 9c12-8 27-5 31 6 3 10-6 20-18 22-10 1-17-4-18-12-1-7 0-12 5-16z"/>
<path fill="none" stroke="#22304a" stroke-width="2.5" stroke-linecap="round" stroke-linejoin="round"
 d="M6 42c8-8 14 2 22-4 8-5 16 4 26-6"/>
</svg>"""
"""A sun, a hill, a translucent blob and a stroke; shape 2 is the blob."""
BLOB = 2
STATES = {constants.UNCOVERED: "#ffffff", constants.PARTIAL: "#f6d9a8", constants.FULL: "#c9dcf2"}
INK, RED, BLUE = "#22304a", "#c2334d", "#2f6fb3"


class Stages:
    """The scene, rendered once, and what its stages left in their buffers."""

    def __init__(self) -> None:
        start_warp()
        self.scene = warpsplat.load_svg(SVG)
        self.backend = Backend.on("cpu")
        canvas = self.scene.canvas
        self.viewport = Viewport(canvas.width, canvas.height)
        self.renderer = Renderer(Parameters(self.scene, self.backend), self.viewport, model=EXACT)
        self.renderer.forward_complete()
        self.image = self.renderer.read_image()
        bins = self.renderer.bins.buffers
        self.slot_shape, self.slot_tile, self.slot_state = (
            array.numpy().copy() for array in (bins.slot_shape, bins.slot_tile, bins.slot_state)
        )
        self.coverage = np.abs(self.renderer.coverage.buffers.coverage.numpy())  # before the adjoint's turn

    def vertices(self, shape: int) -> Array:
        """Polyline of a shape [px], shape (vertex, 2)."""
        assert isinstance(self.renderer.geometry, Outline)
        b = self.renderer.geometry.buffers
        first, last = b.vertex_range.numpy()[shape].tolist()
        return np.asarray(b.vertex.numpy()[first:last])

    def slot(self, shape: int, tile: int) -> int:
        """The slot of a shape in a tile."""
        return int(np.flatnonzero((self.slot_shape == shape) & (self.slot_tile == tile))[0])

    def first_shapes(self, count: int) -> Array:
        """The scene without those in front of the first ``count`` shapes."""
        return warpsplat.render(self.scene.take(np.arange(count)), device="cpu")[..., :3]


def main(folder: Path) -> None:
    """Write all figures."""
    folder.mkdir(parents=True, exist_ok=True)
    stages = Stages()
    figures: dict[str, Callable[[Stages], str]] = {
        "outline": outline,
        "tiles": tiles,
        "coverage": coverage,
        "compositing": compositing,
        "adjoint": adjoint,
    }
    for name, figure in figures.items():
        (folder / f"{name}.svg").write_text(figure(stages), "utf-8")


def outline(stages: Stages) -> str:
    """Control points, curve and the vertices that it is flattened to."""
    points = ZOOM * stages.scene.points_of(BLOB)
    vertices = ZOOM * stages.vertices(BLOB)
    handles = [
        f'<path d="{polyline(points[[i, (i + step) % len(points)]])}"/>'
        for i in range(0, len(points), 3)
        for step in (1, -1)
    ]
    body = [
        polygon(vertices, fill=RED, opacity=0.12),
        f'<g stroke="{BLUE}" stroke-width="1.5" stroke-dasharray="5 4">{"".join(handles)}</g>',
        polygon(vertices, stroke=RED, width=2),
        dots(vertices, 3.4, RED),
        dots(points, 5, BLUE),
        dots(points[::3], 2.6, "#fff"),
    ]
    low, high = points.min(axis=0) - 14, points.max(axis=0) + 14
    return figure((low[0], low[1], *(high - low)), body)


def tiles(stages: Stages) -> str:
    """The slots of one shape by their states, and how many slots each tile has."""
    v = stages.viewport
    body = []
    for tile in range(v.tile_count):
        x, y = TILE * ZOOM * (tile % v.tiles_x), TILE * ZOOM * (tile // v.tiles_x)
        own = (stages.slot_tile == tile) & (stages.slot_shape >= 0)
        mine = stages.slot_state[own & (stages.slot_shape == BLOB)]
        fill = STATES[int(mine[0]) & (constants.COVERED | constants.UNCOVERED)] if len(mine) else "#f3f3f3"
        body.append(rectangle(x, y, TILE * ZOOM, fill, f' stroke="{INK}" stroke-width="1"'))
        body.append(text(x + 12, y + 32, str(int(own.sum())), 24))
    for shape in range(len(stages.scene)):
        closed = shape < len(stages.scene) - 1
        color, width = (RED, 4) if shape == BLOB else ("#8a93a3", 2)
        body.append(polygon(ZOOM * stages.vertices(shape), stroke=color, width=width, closed=closed))
    return figure((0, 0, ZOOM * v.width, ZOOM * v.height), body)


def coverage(stages: Stages) -> str:
    """The numbers of one slot that its outline crosses: a share of each pixel."""
    tile, size = 2, 36
    x0, y0 = TILE * (tile % stages.viewport.tiles_x), TILE * (tile // stages.viewport.tiles_x)
    values = stages.coverage[stages.slot(BLOB, tile)]  # by columns
    body = []
    for column, row in np.ndindex(TILE, TILE):
        value = float(values[column, row])
        mixed = " ".join(str(round(255 + value * (c - 255))) for c in (217, 131, 148)).replace(" ", ",")
        line = ' stroke="#c9c9cf" stroke-width=".7"'
        body.append(rectangle(size * column, size * row, size, f"rgb({mixed})", line))
        if 0.005 < value < 0.995:
            body.append(text(size * (column + 0.5), size * (row + 0.64), f"{100 * value:.0f}", 15, "middle"))
    body.append(
        polygon(size * (stages.vertices(BLOB) - np.array([x0, y0], np.float32)), stroke=RED, width=2.5)
    )
    return figure((0, 0, TILE * size, TILE * size), body)


def compositing(stages: Stages) -> str:
    """The picture after each shape, from the background on."""
    v, gap = stages.viewport, 6
    count = len(stages.scene) + 1
    body = [picture(stages.first_shapes(i), (v.width + gap) * i, 0) for i in range(count)]
    return figure((0, 0, (v.width + gap) * count - gap, v.height), body)


def adjoint(stages: Stages) -> str:
    """The difference from a picture with the blob elsewhere, and where the gradient pulls its points."""
    wanted = stages.scene.points.copy()
    first, last = stages.scene.first[BLOB : BLOB + 2]
    wanted[first:last] = wanted[first:last] @ np.array([[0.95, 0.12], [-0.1, 1.05]], np.float32) + [8, -5]
    gradient, difference = gradients(stages, wanted)
    points, pull = ZOOM * stages.scene.points[first:last], -gradient[first:last]
    ends = points + 95 * pull / np.abs(pull).max()
    arrows = "".join(f'<path d="{polyline([a, b])}"/>' for a, b in zip(points, ends, strict=True))
    v = stages.viewport
    body = [
        ARROW,
        picture(signed(difference), 0, 0, ZOOM),
        polygon(ZOOM * stages.vertices(BLOB), stroke=INK, width=2.5),
        polygon(ZOOM * moved(stages, wanted), stroke=INK, width=2, dash="8 6"),
        f'<g stroke="{INK}" stroke-width="4" marker-end="url(#head)">{arrows}</g>',
        dots(points, 5, INK),
    ]
    return figure((0, -68, ZOOM * v.width, ZOOM * v.height), body)


def gradients(stages: Stages, wanted: Array) -> tuple[Array, Array]:
    """Of half the squared error against the scene with the ``wanted`` points: that of the points, shape
    (point, 2), which is held against central differences; and the difference of the images.
    """
    renderer, scene = stages.renderer, stages.scene
    target = shown(stages, wanted)
    renderer.forward()
    difference = renderer.read_image() - target
    renderer.write_image_grad(difference)
    renderer.backward()
    found = renderer.parameters.gradients()["points"]
    step, row = 0.05, int(scene.first[BLOB])
    for axis in (0, 1):
        losses = []
        for sign in (1, -1):
            near = scene.points.copy()
            near[row, axis] += sign * step
            losses.append(0.5 * np.square(shown(stages, near) - target, dtype=np.float64).sum())
        central = (losses[0] - losses[1]) / (2 * step)
        assert abs(central - found[row, axis]) < 0.02 * np.abs(found).max(), "the adjoint is the derivative"
    return found, difference


def shown(stages: Stages, points: Array) -> Array:
    """The picture of the scene with other points."""
    return warpsplat.render(replace(stages.scene, points=points.astype(np.float32)), device="cpu")[..., :3]


def moved(stages: Stages, points: Array) -> Array:
    """The polyline of the blob with other points [px]."""
    there = Stages.__new__(Stages)
    scene = replace(stages.scene, points=points.astype(np.float32))
    there.renderer = Renderer(Parameters(scene, stages.backend), stages.viewport, model=EXACT)
    there.renderer.forward_complete()
    return there.vertices(BLOB)


def signed(difference: Array) -> Array:
    """Red where the picture is too bright, blue where it is too dark, white where it is right."""
    mean = np.clip(3 * difference.mean(axis=2, keepdims=True), -1, 1)
    low, high = np.array([[0.25, 0.5, 0.8]], np.float32), np.array([[0.85, 0.35, 0.35]], np.float32)
    return np.asarray(1 - np.abs(mean) * (1 - np.where(mean > 0, high, low)), np.float32)


ARROW = (
    '<defs><marker id="head" viewBox="0 0 10 10" refX="8" refY="5" markerWidth="4.5" markerHeight="4.5" '
    f'orient="auto"><path d="M0 0 10 5 0 10z" fill="{INK}"/></marker></defs>'
)


def figure(box: tuple[float, float, float, float], body: Iterable[str]) -> str:
    """An SVG of these elements on white, which dark pages need; what lies beyond the box is not seen."""
    size = f'width="{box[2]:.6g}" height="{box[3]:.6g}"'
    view = " ".join(f"{x:.6g}" for x in box)
    head = f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="{view}" {size} font-family="sans-serif">'
    paper = f'<rect x="{box[0]:.6g}" y="{box[1]:.6g}" {size} fill="#fff"/>'
    return "\n".join([head, paper, *body, "</svg>\n"])


def polyline(points: Iterable[Iterable[float]]) -> str:
    """Path data through the points."""
    return "M" + " ".join(f"{x:.1f},{y:.1f}" for x, y in points)


def polygon(
    points: Array,
    *,
    fill: str = "none",
    stroke: str = "none",
    width: float = 0,
    opacity: float = 1,
    dash: str = "",
    closed: bool = True,
) -> str:
    """A path through the points."""
    end = "z" if closed else ""
    dashes = f' stroke-dasharray="{dash}"' if dash else ""
    return (
        f'<path d="{polyline(points)}{end}" fill="{fill}" stroke="{stroke}" stroke-width="{width}" '
        f'opacity="{opacity}"{dashes}/>'
    )


def dots(points: Array, radius: float, color: str) -> str:
    """A disc at each point."""
    discs = "".join(f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{radius}"/>' for x, y in points)
    return f'<g fill="{color}">{discs}</g>'


def rectangle(x: float, y: float, size: float, fill: str, more: str = "") -> str:
    """A square."""
    return f'<rect x="{x:g}" y="{y:g}" width="{size}" height="{size}" fill="{fill}"{more}/>'


def text(x: float, y: float, words: str, size: float, anchor: str = "start") -> str:
    """A line of text."""
    return f'<text x="{x:g}" y="{y:g}" font-size="{size}" text-anchor="{anchor}" fill="{INK}">{words}</text>'


def picture(image: Array, x: float, y: float, zoom: float = 1) -> str:
    """Pixels, as squares."""
    data = io.BytesIO()
    Image.fromarray(np.round(255 * np.clip(image, 0, 1)).astype(np.uint8)).save(data, "PNG", optimize=True)
    encoded = base64.b64encode(data.getvalue()).decode()
    height, width = image.shape[:2]
    return (
        f'<image x="{x:g}" y="{y:g}" width="{zoom * width:g}" height="{zoom * height:g}" '
        f'style="image-rendering:pixelated" href="data:image/png;base64,{encoded}"/>'
    )


if __name__ == "__main__":
    main(Path(sys.argv[1]) if sys.argv[1:] else FOLDER)
