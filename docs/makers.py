"""The pictures of docs/makers.md: ``python docs/makers.py``.

A badge as shapes on one another, cut out, and with its parts apart; and a stencil over a ruler.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from optics import BADGE, SIDE
from PIL import Image

import warpsplat
from warpsplat.scene import Canvas, Scene
from warpsplat.scene.geometry import bounds
from warpsplat.svg.viewer import on_white, render_svg

FOLDER = Path(__file__).parent / "images" / "makers"
ZOOM = 4
"""How many times as large the images are shown as they are traced."""
SPREAD = 0.7
"""How far parts are moved apart, over their distances from the middle."""

STENCIL = """<svg xmlns="http://www.w3.org/2000/svg" width="1680" height="640" viewBox="0 0 210 80">
<rect width="210" height="80" fill="#fff"/><g fill-rule="evenodd">
<path d="M45 8a32 32 0 1 0 .1 0zM45 24a16 16 0 1 1 -.1 0z"/>
<path d="M92 8h34c26 0 24 26 12 31 16 5 16 33-10 33H92zM108 20v12h16c8 0 8-12 0-12zM108 44v15h18c9 0 9-15
 0-15z"
/>
<path d="M180 10l28 62h-16l-4-10h-16l-4 10h-16zM180 34l-6 15h12z"/></g></svg>"""


def pixels(svg: str, width: int) -> Image.Image:
    """Return an SVG on white."""
    drawn = render_svg(svg)
    size = (width, round(width * drawn.height / drawn.width))
    return Image.fromarray(np.asarray(on_white(render_svg(svg, size=size)), np.uint8))


def apart(scene: Scene) -> Scene:
    """Return a scene with its shapes moved away from the middle, on a larger canvas."""
    boxes = bounds(scene)
    middle = np.array([scene.canvas.width, scene.canvas.height]) / 2
    moves = SPREAD * ((boxes[:, :2] + boxes[:, 2:]) / 2 - middle) + SPREAD * middle
    points = scene.points + np.repeat(moves, np.diff(scene.first), axis=0).astype(np.float32)
    side = round((1 + SPREAD) * scene.canvas.width)
    return replace(scene, points=points, canvas=Canvas(side, side, None))


def outlined(svg: str) -> str:
    """Return an SVG with its outlines alone."""
    width = float(svg.split('viewBox="0 0 ')[1].split(maxsplit=1)[0]) / 150
    style = f"<style>path,rect,circle,ellipse{{fill:none;stroke:#c03;stroke-width:{width}}}</style>"
    return svg.replace("<path", f"{style}<path", 1)


def stack() -> Image.Image:
    """Return the badge as it is, the outlines of its file, these after cutting, and the parts."""
    image = pixels(BADGE, 4 * SIDE)
    whole = warpsplat.vectorize(image, subject="drawing", device="cpu", minify=True)
    cut = warpsplat.vectorize(
        image, subject="drawing", device="cpu", minify=True, stack="cutout", separate=True
    )
    width = 300
    shown = [pixels(svg, width) for svg in (whole.svg, outlined(whole.svg), outlined(cut.svg))]
    shown.append(pixels(warpsplat.save_svg(apart(warpsplat.load_svg(cut.svg))), width))
    page = Image.new("RGB", (4 * (width + 10) - 10, width), "white")
    for i, each in enumerate(shown):
        page.paste(each, (i * (width + 10), 0))
    return page


def stencil() -> Image.Image:
    """Return a stencil of 105 mm over a ruler."""
    image = pixels(STENCIL, 800)
    options = {"remove_background": "everywhere", "stack": "cutout", "bridges": "2.5mm", "size": "105x40mm"}
    made = warpsplat.vectorize(image, subject="drawing", device="cpu", **options)  # type: ignore[arg-type]
    marks = "".join(f'<path d="M{x} 0v{3 if x % 10 else 6}"/>' for x in range(106))
    ruler = (
        '<svg xmlns="http://www.w3.org/2000/svg" width="1050" height="80" viewBox="0 0 105 8">'
        f'<g stroke="#000" stroke-width=".2">{marks}</g></svg>'
    )
    page = Image.new("RGB", (1050, 480), "white")
    page.paste(pixels(made.svg, 1050), (0, 0))
    page.paste(pixels(ruler, 1050), (0, 400))
    return page


if __name__ == "__main__":
    FOLDER.mkdir(exist_ok=True)
    stack().save(FOLDER / "stack.webp", quality=85)
    stencil().save(FOLDER / "stencil.webp", quality=85)
