"""Scene -> SVG text."""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterator, Mapping
from dataclasses import replace
from xml.sax.saxutils import escape

import numpy as np
import numpy.typing as npt

from warpsplat.portable.elementary import power_of_ten
from warpsplat.scene import NO_DASHES, Basis, Cap, Join, Kind, Paint, Picture, Rule, Scene
from warpsplat.scene.geometry import bounds
from warpsplat.scene.scene import level_ends
from warpsplat.svg.data import PathData, held_points
from warpsplat.svg.names import LEVEL_ID, Names, color_names
from warpsplat.svg.nest import Path, nested, painted
from warpsplat.svg.numbers import hex_colors, number
from warpsplat.svg.paints import SHARE_DECIMALS, gradients
from warpsplat.svg.parts import in_parts
from warpsplat.svg.valid import check_finite

NAMESPACE = "http://www.w3.org/2000/svg"

OPACITY_DECIMALS = 2
"""An 8-bit colour moves by less than an eighth of a level for half a unit of the third decimal."""

WIDTH_STEP = 0.25
"""Coarsest step of a stroke's width [px]: a unit of the view box where that is as fine, else a tenth."""

OPAQUE = 1 - 0.5 * power_of_ten(-OPACITY_DECIMALS)
"""From here on an opacity rounds to 1 and is left out: opaque paths are smaller and quicker to draw."""

GRIDS = (0.125, 0.25, 0.5, *map(float, (1, 2, 3, 4, 5, 6, 8, 10, 12, 16, 20, 25, 32, 50, 100)))
"""Units of the view box a pixel of the picture: sizes of the view box have few decimals with each."""

DASH_DECIMALS = 2
"""Of dashes, in units of the view box."""

MITER_LIMIT = 4.0
"""What holds where nothing is said."""

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
        points=(held_points(scene, points * per_unit) / per_unit).astype(np.float32),
        colors=(np.round(colors * 255) / 255).astype(np.float32),
        opacities=shown.astype(np.float32),
        stop_offsets=np.round(scene.stop_offsets, SHARE_DECIMALS),
        stop_colors=(np.round(scene.stop_colors * 255) / 255).astype(np.float32),
        stop_opacities=np.round(scene.stop_opacities, SHARE_DECIMALS),
        widths=(np.round(widths * per_pixel, width_decimals(per_pixel)) / per_pixel).astype(np.float32),
    )


BLACK = "#000"
"""Of fills, it holds where nothing is said."""

PAINTED = {Kind.FILL: "fill", Kind.STROKE: "stroke"}
"""The paint attribute of each kind."""


CAPS = {Cap.BUTT: "butt", Cap.ROUND: "round", Cap.SQUARE: "square"}
JOINS = {Join.MITER: "miter", Join.ROUND: "round", Join.BEVEL: "bevel"}


def _line(scene: Scene, shape: int, per_pixel: float, *, in_group: bool) -> str:
    """How a stroke is drawn; ``in_group``: besides what the group of strokes says."""
    width = number(float(scene.widths[shape]) * per_pixel, width_decimals(per_pixel))
    style = f' stroke-width="{width}"'
    cap, join, dash = Cap(scene.cap[shape]), Join(scene.join[shape]), int(scene.dash[shape])
    shared_cap, shared_join = (Cap.ROUND, Join.ROUND) if in_group else (Cap.BUTT, Join.MITER)
    if cap != shared_cap:
        style += f' stroke-linecap="{CAPS[cap]}"'
    if join != shared_join:
        style += f' stroke-linejoin="{JOINS[join]}"'
    if join == Join.MITER and scene.miter_limits[shape] != MITER_LIMIT:
        style += f' stroke-miterlimit="{number(float(scene.miter_limits[shape]), SHARE_DECIMALS)}"'
    if dash != NO_DASHES:
        offset, *pattern = (number(value * per_pixel, DASH_DECIMALS) for value in scene.dashes[dash])
        style += f' stroke-dasharray="{" ".join(pattern)}"'
        style += f' stroke-dashoffset="{offset}"' if offset != "0" else ""
    return style


def _path(
    scene: Scene,
    shape: int,
    data: str,
    color: str,
    opacity: str,
    per_pixel: float,
    rest: str,
    *,
    in_group: bool,
) -> Path:
    """The path of one shape; ``rest``: further attributes, of a path that is its twin's as well."""
    kind = Kind(int(scene.kind[shape]))
    paint = f' {PAINTED[kind]}="{color}"'
    if kind == Kind.STROKE:
        return Path(data, (opacity, paint, _line(scene, shape, per_pixel, in_group=in_group)), rest)
    rule = ' fill-rule="evenodd"' if scene.rule[shape] == Rule.EVENODD else ""
    return Path(data, (opacity, "" if color == BLACK else paint, ""), rule + rest)


def _twin(scene: Scene, shape: int, colors: list[str], per_pixel: float) -> str:
    """What the path of a shape says of its twin, the next one."""
    kind = Kind(int(scene.kind[shape + 1]))
    style = f' {PAINTED[kind]}="{colors[shape + 1]}"'
    if kind == Kind.STROKE:
        return style + _line(scene, shape + 1, per_pixel, in_group=False)
    return style + (' fill-rule="evenodd"' if scene.rule[shape + 1] == Rule.EVENODD else "") + STROKE_FIRST


STROKE_FIRST = ' paint-order="stroke"'


def _colors(scene: Scene, ramps: Mapping[int, str]) -> list[str]:
    """The paint of each shape; ``ramps``: identifiers of gradients."""
    colors = hex_colors(scene.colors)
    for shape, name in ramps.items():
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
    colors, opacities = _colors(scene, gradients(scene, per_pixel)[1]), _opacities(scene, 1.0)
    data = PathData(scene, per_pixel)
    paths = (
        _path(scene, i, data.of(i), colors[i], opacities[i], per_pixel, "", in_group=True)
        for i in range(len(scene))
    )
    return np.array([len(str(path)) for path in paths], np.int64)


def _picture(picture: Picture, scene: Scene, per_pixel: float) -> str:
    """The markup of a picture, in the file's units."""
    across, down = (
        per_pixel * side / own
        for side, own in zip((scene.canvas.width, scene.canvas.height), picture.size, strict=True)
    )
    return f'<g transform="scale({across:.9g} {down:.9g})">{picture.markup}</g>'


def _groups(
    scene: Scene, ramps: Mapping[int, str], per_pixel: float, opacity_scale: float, ids: bool
) -> Iterator[str]:
    """Layers are groups with their names; those without, where there are several, say how many shapes they
    complete. In them strokes that are neighbours share a group, and neighbours that say the same of
    themselves where that is shorter. Twins are one path, pictures what they are. ``ids``: paths have names,
    and neighbours of one paint share a group with one, unless that is what layers are.
    """
    colors, opacities = _colors(scene, ramps), _opacities(scene, opacity_scale)
    data = PathData(scene, per_pixel)
    has_twin = np.append(scene.twin[1:], 0).tolist()
    strokes = (scene.kind == Kind.STROKE).tolist()
    rest = [_twin(scene, i, colors, per_pixel) if twin else "" for i, twin in enumerate(has_twin)]
    called, path_names, group_names = color_names(scene) if ids else [], Names(), Names()
    if ids:
        rest = [f' id="{path_names.next(name)}"{more}' for name, more in zip(called, rest, strict=True)]
    both = [o + opacities[i + 1] if has_twin[i] else o for i, o in enumerate(opacities)]
    pictures = (scene.paint == Paint.PICTURE).tolist()
    ends = level_ends(scene)
    layer = np.searchsorted(ends, np.arange(len(scene)), "right").tolist()
    names = [f"{LEVEL_ID}{end}" for end in (*ends, len(scene))]
    if scene.layer_names:
        names = [scene.layer_names[scene.layer[end - 1]] for end in (*ends, len(scene))]
    last = None
    for (level, is_picture, in_group), run in itertools.groupby(
        np.flatnonzero(scene.twin == 0).tolist(),
        lambda i: (layer[i], pictures[i], strokes[i] and not has_twin[i]),
    ):
        if (ends or scene.layer_names) and level != last:
            yield ("" if last is None else "</g>") + f'<g id="{names[level]}">'
            last = level
        shapes = list(run)
        if is_picture:
            yield from (_picture(scene.pictures[scene.picture[i]], scene, per_pixel) for i in shapes)
            continue
        paths = [
            _path(scene, i, data.of(i), colors[i], both[i], per_pixel, rest[i], in_group=in_group)
            for i in shapes
        ]
        paths = _joined(scene, shapes, paths)
        group = (f"<g {STROKE_ATTRIBUTES}>", "</g>") if in_group else ("", "")
        by_color = ids and not scene.layer_names
        inner = painted(paths, [called[i] for i in shapes], group_names) if by_color else nested(paths)
        yield from (group[0], *inner, group[1])
    if last is not None:
        yield "</g>"


APART = 1.0
"""Shapes nearer to each other than this [px] share pixels."""


def _joined(scene: Scene, shapes: list[int], paths: list[Path]) -> list[Path]:
    """Neighbours among fitted fills that say the same and lie apart as one path, which shows the same.

    Those of drawings stay: there a path is a region.
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
) -> str:
    """The scene as an SVG document: a background and one path a shape, in painter's order; but for shapes of
    very many nodes (``in_parts``).

    Args:
        scene: what to write; canvas units become user units.
        per_pixel: units of the view box a pixel; coordinates are whole numbers of units, points of splines
            even ones.
        metadata: text behind the program's name in the comment that marks the file.
        opacity_scale: opacity of a solid path over that of the scene's shape. A splat's plateau is a little
            below 1 (``constants.PLATEAU``): a solid path needs that much less opacity to look alike.
        background: whether to write it, if the canvas has one; without, the picture is transparent where no
            shape is.
        title: of the picture; empty: none.
        ids: whether paths have identifiers, by their colours, and neighbours of one colour a group with one.

    Raises:
        UsageError: a number of the scene is not finite.
    """
    check_finite(scene)
    scene = in_parts(scene)
    canvas = scene.canvas
    width, height = (number(x * per_pixel, 3) for x in (canvas.width, canvas.height))
    behind = ""
    if background and canvas.background is not None:
        fill = hex_colors(canvas.background[None])[0]
        paint = "" if fill == BLACK else f' fill="{fill}"'
        behind = f'<rect width="{width}" height="{height}"{paint}/>'
    elements, ramps = gradients(scene, per_pixel)
    defs = f"<defs>{''.join(elements)}</defs>" if elements else ""
    shapes = "".join(_groups(scene, ramps, per_pixel, opacity_scale, ids))
    if canvas.crisp and len(scene):
        shapes = f'<g shape-rendering="crispEdges">{shapes}</g>'
    return (
        f'<svg xmlns="{NAMESPACE}" width="{canvas.width}" height="{canvas.height}" '
        f'viewBox="0 0 {width} {height}">{MARK}{" " if metadata else ""}{metadata}-->\n'
        f"{titled(title)}{defs}{behind}{shapes}</svg>\n"
    )


MARK = "<!--warpsplat"
"""How the comment begins by which a file is known to be written here."""

UNPRINTABLE = re.compile(r"[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
"""What XML cannot hold (XML 1.0, 2.2)."""


def titled(title: str) -> str:
    """A ``title`` element, or nothing."""
    return f"<title>{escape(UNPRINTABLE.sub('', title))}</title>" if title else ""


HEAD = re.compile(
    rf'<svg xmlns="{re.escape(NAMESPACE)}" width="(\d+)" height="(\d+)" viewBox="0 0 ([\d.]+) ([\d.]+)">'
)
OUR_HEAD = re.compile(HEAD.pattern + MARK)
"""How a file written here begins: its size in pixels, and that in units of its view box."""


def resized(text: str, width: int, height: int, scale: float, top: int = 0) -> str:
    """A file written here, ``scale`` px large for each pixel of its own, cut to the ``width`` x ``height`` px
    from the left and from ``top`` on.
    """
    text = _plain(text)
    found = HEAD.match(text)
    assert found
    unit = float(found[3]) / float(found[1]) / scale
    view = f"0 {top * unit:.9g} {width * unit:.9g} {height * unit:.9g}"
    head = f'<svg xmlns="{NAMESPACE}" width="{width}" height="{height}" viewBox="{view}">'
    return head + text[found.end() :]


def read_metadata(text: str) -> str:
    """The metadata text of a file written here; empty if there is none."""
    found = re.search(rf"{MARK} (.*?)-->", text[:1000])
    return found.group(1) if found else ""


def minified(text: str) -> str:
    """A file written here without the mark and line breaks, which show nothing."""
    head, found, rest = _plain(text).partition(MARK)
    return head + rest.partition("-->\n")[2].rstrip("\n") if found else text


SHORT = 1500
"""A file of fewer characters has no comment: the mark is the order of its attributes, which costs nothing
(``files.output`` knows both)."""

SHORT_HEAD = re.compile(
    rf'<svg viewBox="0 0 ([\d.]+) ([\d.]+)" xmlns="{re.escape(NAMESPACE)}" height="(\d+)" width="(\d+)">'
)
"""How a short file begins."""


def shortened(text: str) -> str:
    """A file written here, where it is short without the comment and line breaks; one whose comment says more
    than the mark stays as it is.
    """
    head = OUR_HEAD.match(text)
    if not head or not text.startswith("-->\n", head.end()) or len(text) >= SHORT:
        return text
    width, height, *box = head.groups()
    rest = text[head.end() + len("-->\n") :].rstrip("\n")
    return f'<svg viewBox="0 0 {" ".join(box)}" xmlns="{NAMESPACE}" height="{height}" width="{width}">{rest}'


def _plain(text: str) -> str:
    """A short file with the comment again; any other as it is."""
    head = SHORT_HEAD.match(text)
    if not head:
        return text
    *box, height, width = head.groups()
    return (
        f'<svg xmlns="{NAMESPACE}" width="{width}" height="{height}" viewBox="0 0 {" ".join(box)}">'
        f"{MARK}-->\n{text[head.end() :]}\n"
    )
