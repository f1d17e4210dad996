"""Scene -> SVG text, and back for what is written here.

Paths follow SVG 1.1 section 8.3; coordinates are relative (``c``), each rounded against the rounded position
before it, so that rounding errors do not add up.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from xml.etree import ElementTree

import numpy as np

from warpsplat import __version__
from warpsplat.config import Settings
from warpsplat.errors import ImageError
from warpsplat.kernels import constants
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


def path_data(points: FloatArray, closed: bool, precision: int) -> str:
    """``d`` of one curve, points of shape (point, 2) as in ``Scene``."""
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


def _elements(scene: Scene, precision: int, opacity_scale: float) -> Iterator[str]:
    attribute = "fill" if scene.kind == "closed" else "stroke"
    parts = scene.opacities.shape[1]
    for i in range(len(scene)):
        style = f'{attribute}="{hex_color(scene.colors[i])}"'
        if scene.kind == "open":
            style += f' stroke-width="{number(float(scene.widths[i]), 2)}"'
        steps = (scene.points.shape[1] - 1) // parts
        for j in range(parts):
            points = scene.points[i] if parts == 1 else scene.points[i, j * steps : (j + 1) * steps + 1]
            shown = min(float(scene.opacities[i, j]) * opacity_scale, 1.0)
            opacity = number(shown, OPACITY_DECIMALS)
            extra = "" if shown >= OPAQUE else f' {attribute}-opacity="{opacity}"'
            yield f'<path d="{path_data(points, scene.kind == "closed", precision)}" {style}{extra}/>'


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
    fill = hex_color(scene.background)
    behind = f'<rect width="{scene.width}" height="{scene.height}" fill="{fill}"/>\n' if background else ""
    shapes = "\n".join(_elements(scene, precision, opacity_scale))
    group = f"<g {STROKE_ATTRIBUTES}>" if scene.kind == "open" else "<g>"
    note = f"warpsplat {__version__} {metadata}".strip()
    return (
        f'<svg xmlns="{NAMESPACE}" width="{scene.width}" height="{scene.height}" '
        f'viewBox="0 0 {scene.width} {scene.height}">\n'
        f"<metadata>{note}</metadata>\n"
        f"{behind}{group}\n{shapes}\n</g>\n</svg>\n"
    )


def export(scene: Scene, settings: Settings, metadata: str = "") -> str:
    """The file that ``settings`` ask for."""
    plateau = constants.PLATEAU if settings.renderer == "splat" else 1.0
    return write_svg(scene, precision=settings.precision, metadata=metadata, opacity_scale=plateau)


def resized(text: str, width: int, height: int, scale: float) -> str:
    """A file written here, to be shown on ``width`` x ``height`` px at ``scale`` px a unit, not stretched."""
    view = f'width="{width}" height="{height}" viewBox="0 0 {width / scale:.9g} {height / scale:.9g}"'
    return re.sub(r'width="\d+" height="\d+" viewBox="[^"]*"', view, text, count=1)


def read_metadata(text: str) -> str:
    """The metadata text of a file written here; empty if there is none."""
    found = re.search(r"<metadata>warpsplat (.*?)</metadata>", text[:1000])
    return found.group(1) if found else ""


def parse_color(text: str) -> list[float]:
    """``#rgb`` or ``#rrggbb`` -> sRGB in [0, 1]."""
    digits = text.removeprefix("#")
    if len(digits) == 3:
        digits = "".join(c + c for c in digits)
    return [int(digits[i : i + 2], 16) / 255 for i in (0, 2, 4)]


def _parse_points(d: str, kind: Kind) -> FloatArray:
    found = re.fullmatch(r"M([^c]*)c([^z]*)(z?)", d)
    if not found:
        raise ImageError(f"unsupported path data {d[:40]!r}")
    numbers = [
        np.array(re.findall(r"-?(?:\d+\.?\d*|\.\d+)", part), np.float64).reshape(-1, 2)
        for part in (found[1], found[2])
    ]
    points = [numbers[0][0]]
    for cubic in numbers[1].reshape(-1, 3, 2):
        points.extend(points[-1] + cubic)
    return np.asarray(points[:-1] if kind == "closed" else points, np.float32)


def read_svg(text: str) -> Scene:
    """Read back a file that ``write_svg`` wrote with one opacity a curve.

    Raises:
        ImageError: not such a file.
    """
    try:
        root = ElementTree.fromstring(text)
        width, height = int(root.attrib["width"]), int(root.attrib["height"])
        background = root.find(f"{{{NAMESPACE}}}rect")
        paths = root.findall(f".//{{{NAMESPACE}}}path")
        assert background is not None
        kind: Kind = "open" if paths and "stroke" in paths[0].attrib else "closed"
        attribute = "fill" if kind == "closed" else "stroke"
        opacities = [float(p.get(f"{attribute}-opacity", "1")) for p in paths]
        return Scene(
            kind=kind,
            width=width,
            height=height,
            points=np.stack([_parse_points(p.attrib["d"], kind) for p in paths]),
            colors=np.array([parse_color(p.attrib[attribute]) for p in paths], np.float32),
            opacities=np.array(opacities, np.float32)[:, None],
            widths=np.array([float(p.get("stroke-width", "0")) for p in paths], np.float32),
            background=np.array(parse_color(background.attrib["fill"]), np.float32),
        )
    except (ElementTree.ParseError, KeyError, ValueError, AssertionError) as error:
        raise ImageError(f"not an SVG written by warpsplat: {error}") from error
