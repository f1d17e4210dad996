"""Scene -> SVG text."""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterator
from dataclasses import replace
from html import escape

import numpy as np
import numpy.typing as npt

from warpsplat.errors import UsageError
from warpsplat.portable.elementary import power_of_ten
from warpsplat.scene import (
    ATTRIBUTES,
    NO_DASHES,
    Basis,
    Cap,
    FloatArray,
    Join,
    KeptPicture,
    Kind,
    Paint,
    Rule,
    Scene,
)
from warpsplat.scene.geometry import bounds
from warpsplat.scene.scene import level_ends
from warpsplat.svg.data import held_points, path_data, units
from warpsplat.svg.forms import form_elements
from warpsplat.svg.groups import LEVEL_ID, Names, PathElement, color_names, nested, painted
from warpsplat.svg.inspect import NAMESPACE
from warpsplat.svg.numbers import hex_colors, number
from warpsplat.svg.paints import SHARE_DECIMALS, gradients
from warpsplat.svg.parts import in_parts
from warpsplat.svg.primitives import primitives
from warpsplat.svg.symbols import with_symbols

OPACITY_DECIMALS = 2
"""Half a unit of the third decimal changes an 8-bit colour by less than an eighth of a level."""

OPAQUE = 1 - 0.5 * power_of_ten(-OPACITY_DECIMALS)
"""Opacities from here on round to 1 and are left out: opaque paths are smaller and faster to draw."""

GRIDS = (0.125, 0.25, 0.5, *map(float, (1, 2, 3, 4, 5, 6, 8, 10, 12, 16, 20, 25, 32, 50, 100)))
"""Units of the view box to a pixel of the picture, chosen so that the box's sides have few decimals."""

STROKE_ATTRIBUTES = 'fill="none" stroke-linecap="round" stroke-linejoin="round"'


def width_decimals(per_pixel: float) -> int:
    """Return the number of decimals of a stroke's width."""
    # Coarsest step of a stroke's width [px]: a unit of the view box where that is as fine, else a tenth.
    width_step = 0.25
    return 0 if per_pixel * width_step >= 1 else 1


def rounded(scene: Scene, per_pixel: float) -> Scene:
    """Return ``scene`` rounded as a file with ``per_pixel`` units to a pixel has it."""
    per_unit = units(scene, per_pixel)
    points, colors, opacities, widths = (
        values.astype(np.float64) for values in (scene.points, scene.colors, scene.opacities, scene.widths)
    )
    shown = np.where(opacities < OPAQUE, np.round(opacities, OPACITY_DECIMALS), 1)
    return replace(
        scene,
        points=(held_points(scene, points * per_unit) / per_unit).astype(np.float32),
        colors=(np.round(colors * 255) / 255).astype(np.float32),
        opacities=shown.astype(np.float32),
        stop_offsets=np.round(scene.stop_offsets, SHARE_DECIMALS),
        stop_colors=(np.round(scene.stop_colors * 255) / 255).astype(np.float32),
        stop_opacities=np.round(scene.stop_opacities, SHARE_DECIMALS),
        widths=(np.round(widths * per_pixel, width_decimals(per_pixel)) / per_pixel).astype(np.float32),
    )


PAINTED = {Kind.FILL: "fill", Kind.STROKE: "stroke"}
"""The paint attribute of each kind."""

BLACK_FILL = ' fill="#000"'
"""SVG's default for fills."""


class _Paths:
    """The path elements of a scene's shapes."""

    def __init__(
        self,
        scene: Scene,
        per_pixel: float,
        ramps: dict[int, str],
        opacity_scale: float,
        symbols: dict[int, str] | None = None,
    ) -> None:
        """Write the path data.

        ``ramps``: identifiers of gradients by shape; ``symbols``: elements without style, by shape, instead
        of paths; else as for ``write_svg``.
        """
        self._scene, self._per_pixel = scene, per_pixel
        self._data = list(path_data(scene.drawn(), per_pixel))
        self._elements = _basic_shapes(scene, per_pixel) | form_elements(scene, per_pixel) | (symbols or {})
        self.has_twin: list[bool] = scene.has_twin().tolist()
        """Whether the next shape has the same path."""
        colors = hex_colors(scene.colors)
        for shape, name in ramps.items():
            colors[shape] = f"url(#{name})"
        paints = [PAINTED[Kind(kind)] for kind in scene.kind.tolist()]
        self._colors = [f' {paint}="{color}"' for paint, color in zip(paints, colors, strict=True)]
        shown = np.minimum(scene.opacities.astype(np.float64) * opacity_scale, 1.0).tolist()
        self._opacities = [
            f' {paint}-opacity="{number(value, OPACITY_DECIMALS)}"' if value < OPAQUE else ""
            for paint, value in zip(paints, shown, strict=True)
        ]

    def of(self, shape: int, *, in_group: bool, name: str = "", alone: bool = False) -> PathElement:
        """Return the path of a shape, and of its twin unless it is ``alone``.

        ``in_group``: the path is in a group of strokes. ``name``: the identifier's attribute.
        """
        opacity, paint, own = self._opacities[shape], self._colors[shape], name
        if self.has_twin[shape] and not alone:
            twin = shape + 1
            opacity += self._opacities[twin]
            own += self._colors[twin] + self._style(twin, in_group=False)
            own += "" if self._scene.kind[twin] == Kind.STROKE else ' paint-order="stroke"'
        style = self._style(shape, in_group=in_group)
        if self._scene.kind[shape] == Kind.STROKE:
            return PathElement(self._data[shape], (opacity, paint, style), own, self._elements.get(shape, ""))
        shared = (opacity, "" if paint == BLACK_FILL else paint, "")
        return PathElement(self._data[shape], shared, style + own, self._elements.get(shape, ""))

    def _style(self, shape: int, *, in_group: bool) -> str:
        """Return the attributes besides paint; those of the group of strokes are left out if ``in_group``."""
        if self._scene.kind[shape] == Kind.FILL:
            return ' fill-rule="evenodd"' if self._scene.rule[shape] == Rule.EVENODD else ""
        scene, per_pixel = self._scene, self._per_pixel
        style = f' stroke-width="{number(float(scene.widths[shape]) * per_pixel, width_decimals(per_pixel))}"'
        cap, join, dash = Cap(scene.cap[shape]), Join(scene.join[shape]), int(scene.dash[shape])
        shared_cap, shared_join = (Cap.ROUND, Join.ROUND) if in_group else (Cap.BUTT, Join.MITER)
        if cap != shared_cap:
            style += f' stroke-linecap="{cap.name.lower()}"'
        if join != shared_join:
            style += f' stroke-linejoin="{join.name.lower()}"'
        miter_limit = 4.0  # SVG's default
        if join == Join.MITER and scene.miter_limits[shape] != miter_limit:
            style += f' stroke-miterlimit="{number(float(scene.miter_limits[shape]), SHARE_DECIMALS)}"'
        dash_decimals = 2
        if dash != NO_DASHES:
            offset, *pattern = (number(value * per_pixel, dash_decimals) for value in scene.dashes[dash])
            style += f' stroke-dasharray="{" ".join(pattern)}"'
            style += f' stroke-dashoffset="{offset}"' if offset != "0" else ""
        return style


def _basic_shapes(scene: Scene, per_pixel: float) -> dict[int, str]:
    """Return the circles, ellipses and rectangles among the shapes, as elements without style.

    Pixel art stays of one kind, and a rectangle that covers the canvas is no background.
    """
    if scene.canvas.crisp:
        return {}
    size = np.array([scene.canvas.width, scene.canvas.height]) * per_pixel
    alone = (np.diff(scene.first_contours()) == 1) & scene.are_alone()
    owner, found = scene.contour_shapes().tolist(), {}
    exact = scene.points.astype(np.float64) * units(scene, per_pixel)
    for contour, made in primitives(scene, exact, whole=True):
        if alone[owner[contour]] and (made.low > np.zeros(2)).any() | (made.high < size).any():
            found[owner[contour]] = made.element()
    return found


def path_sizes(scene: Scene, per_pixel: float) -> npt.NDArray[np.int64]:
    """Return the bytes of each shape alone in a file with ``per_pixel`` units to a pixel, shape (shape,)."""
    paths = _Paths(scene, per_pixel, gradients(scene, per_pixel)[1], 1.0)
    sizes = [len(str(paths.of(shape, in_group=True, alone=True))) for shape in range(len(scene))]
    return np.array(sizes, np.int64)


def _picture(picture: KeptPicture, scene: Scene, per_pixel: float) -> str:
    """Return the markup of a picture, in the file's units."""
    across = per_pixel * scene.canvas.width / picture.size[0]
    down = per_pixel * scene.canvas.height / picture.size[1]
    return f'<g transform="scale({across:.9g} {down:.9g})">{picture.markup}</g>'


def _groups(scene: Scene, paths: _Paths, per_pixel: float, ids: bool) -> Iterator[str]:
    """Yield the shapes in groups.

    Layers are groups; those without a name are named by the number of shapes up to their end. Inside,
    adjacent strokes share a group, and so do neighbours with the same attributes where that is shorter. Twins
    are one path, and pictures their markup. ``ids``: paths have names, and so have groups of neighbours of
    one paint, unless layers have names of their own.
    """
    called, path_names, group_names = color_names(scene) if ids else [], Names(), Names()
    attributes = [f' id="{path_names.next(name)}"' for name in called] if ids else [""] * len(scene)
    strokes = (scene.kind == Kind.STROKE).tolist()
    pictures = (scene.paint == Paint.PICTURE).tolist()
    ends = level_ends(scene)
    layer = np.searchsorted(ends, np.arange(len(scene)), "right").tolist()
    names = [f"{LEVEL_ID}{end}" for end in (*ends, len(scene))]
    if scene.layer_names:
        names = [scene.layer_names[scene.layer[end - 1]] for end in (*ends, len(scene))]
    last = None
    for (level, is_picture, in_group), run in itertools.groupby(
        np.flatnonzero(scene.twin == 0).tolist(),
        lambda i: (layer[i], pictures[i], strokes[i] and not paths.has_twin[i]),
    ):
        if (ends or scene.layer_names) and level != last:
            yield ("" if last is None else "</g>") + f'<g id="{names[level]}">'
            last = level
        shapes = list(run)
        if is_picture:
            yield from (_picture(scene.pictures[scene.picture[i]], scene, per_pixel) for i in shapes)
            continue
        elements = [paths.of(i, in_group=in_group, name=attributes[i]) for i in shapes]
        elements = _joined(scene, shapes, elements)
        named = ids and not scene.layer_names
        inner = painted(elements, [called[i] for i in shapes], group_names) if named else nested(elements)
        yield from (f"<g {STROKE_ATTRIBUTES}>", *inner, "</g>") if in_group else inner
    if last is not None:
        yield "</g>"


APART = 1.0
"""Shapes closer to each other than this [px] share pixels."""


def _joined(scene: Scene, shapes: list[int], paths: list[PathElement]) -> list[PathElement]:
    """Join adjacent fitted fills into one path if their attributes are equal and they do not touch.

    Those of drawings, where a path is a region, stay.
    """
    alike = [a.shared == b.shared and not (a.own or b.own) for a, b in itertools.pairwise(paths)]
    if not any(alike):
        return paths
    chosen = (scene.kind[shapes] == Kind.FILL) & (scene.basis[shapes] == Basis.SPLINE)
    boxes = bounds(scene)[shapes]
    low, high = boxes[:, :2] - APART / 2, boxes[:, 2:] + APART / 2
    found, first = [paths[0]], 0
    for i, is_alike in enumerate(alike, 1):
        before = slice(first, i)
        apart = ((low[before] >= high[i]) | (low[i] >= high[before])).any(axis=1)
        if is_alike and chosen[before].all() and chosen[i] and apart.all():
            found[-1] = replace(found[-1], data=found[-1].data + paths[i].data)
        else:
            found.append(paths[i])
            first = i
    return found


def write_svg(
    scene: Scene,
    *,
    per_pixel: float = GRIDS[-1],
    metadata: str = "",
    opacity_scale: float = 1.0,
    background: bool = True,
    title: str = "",
    ids: bool = False,
    symbols: bool = False,
) -> str:
    """Return the scene as an SVG: a background and, in painter's order, one path for each shape.

    Shapes with very many nodes become several paths (``in_parts``).

    Args:
        scene: What to write.
        per_pixel: Units of the view box to a pixel. Coordinates are whole units, those of splines even ones.
        metadata: Text behind the program's name in the comment that marks the file.
        opacity_scale: Factor on opacities: a splat's plateau is a little below 1
            (``paper.constants.PLATEAU``).
        background: Whether to write the canvas's background.
        title: Title of the picture; empty: none.
        ids: Whether paths, and groups of neighbours of one colour, have identifiers after their colours.
        symbols: Whether equal outlines are written once.

    Raises:
        UsageError: A number of the scene is not finite.
    """
    _check_finite(scene)
    scene = in_parts(scene)
    canvas = scene.canvas
    width, height = (number(x * per_pixel, 3) for x in (canvas.width, canvas.height))
    behind = _behind(width, height, canvas.background) if background and canvas.background is not None else ""
    scene, outlines, uses = with_symbols(scene, per_pixel) if symbols else (scene, "", {})
    elements, ramps = gradients(scene, per_pixel)
    defs = f"<defs>{''.join(elements)}{outlines}</defs>" if elements or outlines else ""
    paths = _Paths(scene, per_pixel, ramps, opacity_scale, uses)
    shapes = "".join(_groups(scene, paths, per_pixel, ids))
    if canvas.crisp and len(scene):
        shapes = f'<g shape-rendering="crispEdges">{shapes}</g>'
    head = head_of(canvas.width, canvas.height, f"0 0 {width} {height}")
    mark = f"{MARK}{' ' if metadata else ''}{metadata}-->"
    return f"{head}{mark}\n{titled(title)}{defs}{behind}{shapes}</svg>\n"


def _behind(width: str, height: str, color: FloatArray) -> str:
    """Return a background of a colour, sRGB in [0, 1], shape (3,)."""
    paint = f' fill="{hex_colors(color[None])[0]}"'.replace(BLACK_FILL, "")
    return f'<rect width="{width}" height="{height}"{paint}/>'


def on_background(text: str, color: FloatArray) -> str:
    """Return a file without a background, written here, on one: sRGB in [0, 1], shape (3,)."""
    text = _plain(text)
    found = own_head(text)
    return text[: found.end()] + _behind(found[3], found[4], color) + text[found.end() :]


def _check_finite(scene: Scene) -> None:
    """Raise ``UsageError`` for a number that is not finite; the message names its shape and attribute."""
    background = scene.canvas.background
    if background is not None and not np.isfinite(background).all():
        raise UsageError("the background has a number that is not finite")
    shapes = np.arange(len(scene))
    counts = {"point": scene.point_counts(), "stop": np.diff(scene.stop_first)}
    for attribute in ATTRIBUTES:
        values = getattr(scene, attribute.name)
        if not np.isfinite(values).all():
            row = np.flatnonzero(~np.isfinite(values).reshape(len(values), -1).all(axis=1))[0]
            shape = np.repeat(shapes, counts.get(attribute.per, 1))[row]
            raise UsageError(f"shape {shape}: {attribute.name} with a number that is not finite")


MARK = "<!--warpsplat"
"""The beginning of the comment that marks a file as written here."""

UNPRINTABLE = re.compile(r"[\x00-\x08\x0b\x0c\x0e-\x1f\ud800-\udfff\ufffe\uffff]")
"""Characters that XML cannot hold (XML 1.0, 2.2)."""


def titled(title: str) -> str:
    """Return a ``title`` element, or nothing for an empty title."""
    return f"<title>{escape(UNPRINTABLE.sub('', title), quote=False)}</title>" if title else ""


def head_of(width: object, height: object, view: str) -> str:
    """Return the start tag of a file: a size, and the view box."""
    return f'<svg xmlns="{NAMESPACE}" width="{width}" height="{height}" viewBox="{view}">'


HEAD = re.compile(head_of(r"(\d+)", r"(\d+)", r"0 0 ([\d.]+) ([\d.]+)"))
OUR_HEAD = re.compile(HEAD.pattern + MARK)
"""The beginning of a file written here: its size in pixels, and in units of its view box."""


def own_head(text: str) -> re.Match[str]:
    """Return the match of ``HEAD`` in a file written here."""
    found = HEAD.match(text)
    assert found
    return found


def resized(text: str, width: int, height: int, scale: float, top: int = 0) -> str:
    """Return a file written here magnified by ``scale``, cropped to this size [px] from row ``top``."""
    text = _plain(text)
    found = own_head(text)
    unit = float(found[3]) / float(found[1]) / scale
    view = f"0 {top * unit:.9g} {width * unit:.9g} {height * unit:.9g}"
    return head_of(width, height, view) + text[found.end() :]


def read_metadata(text: str) -> str:
    """Return the metadata text of a file written here; empty: there is none."""
    found = re.search(rf"{MARK} (.*?)-->", text[:1000])
    return found.group(1) if found else ""


def minified(text: str) -> str:
    """Return a file written here without its mark and line breaks."""
    head, found, rest = _plain(text).partition(MARK)
    return head + rest.partition("-->\n")[2].rstrip("\n") if found else text


SHORT = 1500
"""Files of fewer characters have no comment: the order of attributes marks them (see ``files.marks``)."""

SHORT_HEAD = re.compile(
    rf'<svg viewBox="(0 0 [\d.]+ [\d.]+)" xmlns="{NAMESPACE}" height="(\d+)" width="(\d+)">'
)
"""The beginning of a short file."""


def shortened(text: str) -> str:
    """Return a short file written here without its comment and line breaks; others, and metadata, stay."""
    head = OUR_HEAD.match(text)
    if not head or not text.startswith("-->\n", head.end()) or len(text) >= SHORT:
        return text
    width, height, *box = head.groups()
    rest = text[head.end() + len("-->\n") :].rstrip("\n")
    return f'<svg viewBox="0 0 {" ".join(box)}" xmlns="{NAMESPACE}" height="{height}" width="{width}">{rest}'


def _plain(text: str) -> str:
    """Return a short file with its comment again; any other as it is."""
    head = SHORT_HEAD.match(text)
    return f"{head_of(head[3], head[2], head[1])}{MARK}-->\n{text[head.end() :]}\n" if head else text
