"""Any SVG of paths -> scene.

A quadratic followed by smooth ones only is a spline, closed where it closes smoothly; any other path becomes
cubics. A path that is filled and stroked becomes two shapes that share their points.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import chain, groupby, pairwise
from typing import Any

import numpy as np

from warpsplat.errors import ImageError
from warpsplat.scene import (
    NO_DASHES,
    NO_PICTURE,
    Basis,
    Canvas,
    Cap,
    FloatArray,
    Join,
    KeptPicture,
    Kind,
    Paint,
    Rule,
    Scene,
    Spread,
)
from warpsplat.scene.scene import IntArray, starts_of
from warpsplat.svg.clip import polygon
from warpsplat.svg.document import Document, name_of
from warpsplat.svg.excerpts import Excerpts
from warpsplat.svg.forms import read_form
from warpsplat.svg.gradients import FlatColor, Gradient
from warpsplat.svg.inspect import NAMESPACE, known_size
from warpsplat.svg.paints import unused
from warpsplat.svg.paths import Points, Subpath
from warpsplat.svg.shapes import Shape, opacity_of
from warpsplat.svg.structure import Kept, Part, read_parts, shapes_of
from warpsplat.svg.viewer import premultiplied, render_svg

_Outline = tuple[Basis, list[Points], list[bool]]
"""The points of a shape's contours in a scene's form, and which contours are closed."""


def _ring(subpath: Subpath) -> Points:
    """Return a closed ring of cubics, without the repeated end."""
    points = subpath.points
    if not np.allclose(points[-1], points[0], rtol=0, atol=1e-6):
        points = subpath.ring()
    return points[:-1]


def _outlines(shapes: list[Shape], forms: bool) -> Iterator[_Outline]:
    """Yield the points of shapes, the same for twins. Contours that are only filled are closed."""
    twins = [shape.is_twin for shape in shapes] + [False]
    for shape, *is_twin in zip(shapes, twins[:-1], twins[1:], strict=True):
        is_stroked = shape.line is not None or any(is_twin)
        closed = [subpath.is_closed or not is_stroked for subpath in shape.subpaths]
        pairs = list(zip(shape.subpaths, closed, strict=True))
        form = None
        if forms and len(pairs) == 1 and not any((shape.is_twin, *is_twin)):
            form = read_form(shape.tag, _points(*pairs[0]), closed[0])
        if form:
            yield form[0], [form[1]], closed
            continue
        splines = [subpath.spline_ring() if ring else subpath.spline_chain() for subpath, ring in pairs]
        contours = [spline for spline in splines if spline is not None]
        if len(contours) == len(splines):
            yield Basis.SPLINE, contours, closed
        else:
            yield Basis.CUBIC, [_points(*pair) for pair in pairs], closed


def _points(subpath: Subpath, closed: bool) -> Points:
    """Return the points of a contour of cubics."""
    return _ring(subpath) if closed else subpath.points


def is_background(shape: Shape, area: Points) -> bool:
    """Return whether a shape is an opaque upright rectangle that covers a canvas.

    ``area``: the least and largest coordinates of the canvas [px], shape (2, 2).
    """
    if not (shape.is_rect and isinstance(shape.paint, FlatColor) and opacity_of(shape) == 1):
        return False
    corners = shape.subpaths[0].points[::3]
    upright = (np.isclose(np.diff(corners, axis=0), 0, atol=1e-6).sum(axis=1) >= 1).all()
    low, high = corners.min(axis=0), corners.max(axis=0)
    return bool(upright and (low <= area[0] + 0.5).all() and (high >= area[1] - 0.5).all())


def scene_of(
    shapes: list[Shape], width: int, height: int, background_apart: bool = True, forms: bool = False
) -> tuple[Scene, bool]:
    """Return shapes as a scene, and whether the first of them is its background; as ``load_kept``."""
    background = np.ones(3)
    has_background = (
        background_apart
        and len(shapes) > 1
        and is_background(shapes[0], np.array([[0, 0], [width, height]], np.float64))
        and not shapes[1].is_twin
    )
    if has_background:
        background = np.array(shapes[0].paint.color)  # type: ignore[union-attr]  # is_background has checked
        shapes = shapes[1:]
    bases, rings, closed = zip(*_outlines(shapes, forms), strict=True) if shapes else ((), (), ())
    contours = list(chain.from_iterable(rings))
    counts = np.array([sum(map(len, own)) for own in rings], np.int32)
    styles = {dashes: i for i, dashes in enumerate(sorted({s.line.dashes for s in shapes if s.line} - {()}))}
    lines = [shape.line for shape in shapes]
    scene = Scene(
        Canvas(width, height, background.astype(np.float32)),
        np.array([Kind.FILL if one is None else Kind.STROKE for one in lines], np.int32),
        starts_of(counts),
        np.array(bases, np.int32),
        starts=starts_of(np.array([len(points) for points in contours], np.int32)),
        closed=np.array(list(chain.from_iterable(closed)), np.int32),
        points=np.concatenate([*contours, np.empty((0, 2))]).astype(np.float32),
        opacities=np.array([opacity_of(shape) for shape in shapes], np.float32),
        rule=np.array([shape.rule for shape in shapes], np.int32),
        twin=np.array([shape.is_twin for shape in shapes], np.int32),
        widths=np.array([one.width if one else 0.0 for one in lines], np.float32),
        cap=np.array([one.cap if one else Cap.ROUND for one in lines], np.int32),
        join=np.array([one.join if one else Join.ROUND for one in lines], np.int32),
        miter_limits=np.array([one.miter_limit if one else 4.0 for one in lines], np.float32),
        dash=np.array([styles[s.dashes] if s and s.dashes else NO_DASHES for s in lines], np.int32),
        dashes=tuple(styles),
        layer=_layers([shape.level for shape in shapes]),
        **_paints(shapes),
    )
    return scene, has_background


def _layers(names: list[str]) -> IntArray:
    """Return the number of each shape's level if all are in one, in order; else 0."""
    changes = [a != b for a, b in pairwise(names)]
    if not all(names) or sum(changes) + 1 != len(set(names)):
        return np.zeros(len(names), np.int32)
    return np.concatenate([[0], np.cumsum(changes)]).astype(np.int32)


def _paints(shapes: list[Shape]) -> dict[str, Any]:
    """Return the fields of a scene that are about colours, gradients and pictures."""
    paints = [shape.paint for shape in shapes]
    ramps = [paint if isinstance(paint, Gradient) else None for paint in paints]
    # Most stops of all shapes together; each shape has its own copy of a shared gradient.
    max_stops = 1_000_000
    if sum(len(ramp.stops) for ramp in ramps if ramp) > max_stops:
        raise ImageError(f"its gradients add up to more than {max_stops} stops")
    stops = list(chain.from_iterable(ramp.stops for ramp in ramps if ramp))
    kinds = [Paint.FLAT if r is None else Paint.RADIAL if r.is_radial else Paint.LINEAR for r in ramps]
    is_picture = np.array([isinstance(paint, KeptPicture) for paint in paints], np.bool_)
    flat = [paint.color if isinstance(paint, FlatColor) else (0.0, 0.0, 0.0) for paint in paints]
    return {
        "colors": np.array(flat, np.float32).reshape(-1, 3),
        "paint": np.where(is_picture, Paint.PICTURE, np.array(kinds, np.int32)).astype(np.int32),
        "spread": np.array([Spread[r.spread.upper()] if r else Spread.PAD for r in ramps], np.int32),
        "frames": np.array(
            [r.frame[:2, (2, 0, 1)].T if r else np.zeros((3, 2)) for r in ramps], np.float32
        ).reshape(-1, 6),
        "focus": np.array([r.focus if r else (0.0, 0.0, 0.0) for r in ramps], np.float32).reshape(-1, 3),
        "stop_first": starts_of(np.array([len(r.stops) if r else 0 for r in ramps], np.int32)),
        "stop_offsets": np.array([offset for r in ramps if r for offset in r.offsets], np.float32),
        "stop_colors": np.array([stop.color for stop in stops], np.float32).reshape(-1, 3),
        "stop_opacities": np.array([stop.opacity for stop in stops], np.float32),
        "picture": np.where(is_picture, np.cumsum(is_picture) - 1, NO_PICTURE).astype(np.int32),
        "pictures": tuple(paint for paint in paints if isinstance(paint, KeptPicture)),
    }


MARGIN = 4
"""Margin of a picture's rectangle around its visible pixels [px]: the picture does not reach its edges."""

SEEN = 0.5 / 255
"""Least opacity that is visible."""


@dataclass(frozen=True)
class KeptScene:
    """A scene read from an SVG, with kept elements."""

    scene: Scene
    has_background: bool
    """Whether the SVG itself has one."""
    kept: str
    """The kept elements in words; empty: there are none."""
    document: Document
    """The document that the scene was read from."""
    elements: tuple[int | None, ...]
    """Index of the element that draws each shape, the root being 0; None: no single one does."""
    background_element: int | None
    """Index of the element that is the background."""


def load_kept(
    text: str,
    width: int,
    height: int,
    name: str,
    *,
    background_apart: bool = True,
    keep: bool = True,
    forms: bool = False,
) -> KeptScene:
    """Read an SVG's shapes as a scene of ``width`` x ``height`` canvas units, white if it has no background.

    ``background_apart``: whether a background becomes the canvas's, rather than a shape. ``keep``: whether
    elements that no shape can hold become pictures, rather than errors. ``forms``: whether circles, polygons
    ... are forms (``warpsplat.forms``), rather than curves.

    Raises:
        ImageError: Not an SVG, nothing drawn, or something that the scene cannot hold.
    """
    try:
        parts, document = read_parts(text, width, height, keep=keep)
        kept = [part for part in parts if isinstance(part, Kept)]
        shapes = _with_pictures(parts, kept, text, document, (width, height)) if kept else shapes_of(parts)
        if not shapes and not keep:
            raise ImageError("draws no filled or stroked path")
        scene, has_background = scene_of(shapes, width, height, background_apart, forms)
        if (scene.paint == Paint.PICTURE).all():
            causes = f": {_in_words(kept)}" if kept else ""
            raise ImageError(f"contains no path to refine{causes}")
    except ImageError as error:
        raise ImageError(f"{name}: {error}") from error
    numbers = {element: number for number, element in enumerate(document.root.iter())}
    drawn = [None if shape.element is None else numbers[shape.element] for shape in shapes]
    return KeptScene(
        scene,
        has_background,
        _in_words(kept, scene.pictures) if kept else "",
        document,
        tuple(drawn[has_background:]),
        drawn[0] if has_background else None,
    )


def _in_words(kept: Sequence[Kept], pictures: Sequence[KeptPicture] = ()) -> str:
    """Return which elements are kept and why, in one line."""
    counts: Counter[str] = Counter()
    for one in kept:
        tag = f"<{name_of(one.element)}>"
        cause = one.cause.removesuffix(", not supported").removeprefix("uses ")
        counts[tag if cause == tag else f"{tag} ({cause})"] += 1
    texts = [f"{count} {name}" if count > 1 else name for name, count in counts.items()]
    max_causes = 6  # kinds of elements that a line names
    more = f" and {len(texts) - max_causes} more kinds" if len(texts) > max_causes else ""
    hidden = sum(not one.pixels.any() for one in pictures)
    unseen = f"; {hidden} of {len(pictures)} such places show nothing here" if hidden else ""
    return ", ".join(texts[:max_causes]) + more + unseen


def _with_pictures(
    parts: Sequence[Part], kept: Sequence[Kept], text: str, document: Document, extent: tuple[int, int]
) -> list[Shape]:
    """Return the parts with pictures in place of kept elements; neighbours share one.

    Raises:
        ImageError: An element cannot be kept.
    """
    root = document.style_of(document.root)
    if root["transform"] != "none":
        raise ImageError("has a transform on its root, which cannot be kept")
    size = known_size(document.root.attrib)
    excerpts = Excerpts(text, document)
    scope = f"{unused('kept', text)}0"
    definitions = excerpts.of(excerpts.needed([one.element for one in kept]), size)
    shared = excerpts.style(scope) + (f"<defs>{definitions}</defs>" if definitions else "")
    runs = [list(run) for _, run in groupby(parts, lambda part: isinstance(part, Kept))]
    max_pictures = 1000  # most pictures of a scene: each is drawn by itself, which takes a tenth of a second
    if sum(isinstance(run[0], Kept) for run in runs) > max_pictures:
        raise ImageError(
            f"contains elements other than paths in more than {max_pictures} places between paths"
        )
    shapes: list[Shape] = []
    is_first = True
    for run in runs:
        shapes += shapes_of(run)
        alike = [part for part in run if isinstance(part, Kept)]
        if not alike:
            continue
        excerpt = excerpts.of([one.element for one in alike], size)
        with_shared, alone = (f'<g class="{scope}">{before}{excerpt}</g>' for before in (shared, ""))
        pixels = _drawn(with_shared, size, extent, blends=any(one.blends for one in alike))
        shapes.append(_picture_shape(with_shared if is_first else alone, size, pixels))
        is_first = False
    return shapes


def _drawn(markup: str, size: tuple[float, float], extent: tuple[int, int], *, blends: bool) -> FloatArray:
    """Render markup: premultiplied sRGB and opacity, shape (height, width, 4).

    If it ``blends``, colour and opacity are computed from its renders on black and on white.
    """
    head = f'<svg xmlns="{NAMESPACE}" width="{extent[0]}" height="{extent[1]}" preserveAspectRatio="none"'
    head += f' viewBox="0 0 {size[0]:.9g} {size[1]:.9g}">'

    def on(paper: str) -> FloatArray:
        behind = f'<rect width="100%" height="100%" fill="{paper}"/>' if paper else ""
        image = premultiplied(render_svg(f"{head}{behind}{markup}</svg>"))
        return np.asarray(image / 255, np.float32)

    if not blends:
        return on("")
    black, white = on("#000"), on("#fff")
    opacity = 1 - (white - black)[..., :3].mean(axis=2, keepdims=True)
    return np.concatenate([black[..., :3], np.clip(opacity, 0, 1)], axis=2)


def _picture_shape(markup: str, size: tuple[float, float], pixels: FloatArray) -> Shape:
    """Return the rectangle in which markup is visible."""
    seen = pixels.max(axis=2) > SEEN
    rows, columns = np.flatnonzero(seen.any(axis=1)), np.flatnonzero(seen.any(axis=0))
    top, bottom = (rows[0], rows[-1] + 1) if len(rows) else (0, 1)
    left, right = (columns[0], columns[-1] + 1) if len(columns) else (0, 1)
    picture = KeptPicture(markup, size, (int(top), int(left)), pixels[top:bottom, left:right].copy())
    low, high = np.array([left, top]) - MARGIN, np.array([right, bottom]) + MARGIN
    corners = np.array([low, (high[0], low[1]), high, (low[0], high[1])], np.float64)
    return Shape([polygon(corners)], picture, 1.0, None, Rule.NONZERO)
