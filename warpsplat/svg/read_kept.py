"""SVG -> scene, with elements that no shape can hold as pictures between the shapes."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby

import numpy as np

from warpsplat.errors import ImageError
from warpsplat.scene import FloatArray, Paint, Picture, Rule, Scene
from warpsplat.svg.clip import polygon
from warpsplat.svg.document import Document, name_of
from warpsplat.svg.excerpts import Excerpts
from warpsplat.svg.inspect import NAMESPACE, svg_size
from warpsplat.svg.kept import Kept, Part, shapes_of
from warpsplat.svg.paints import unused
from warpsplat.svg.read import scene_of
from warpsplat.svg.shapes import Shape
from warpsplat.svg.structure import read_parts
from warpsplat.svg.viewer import premultiplied, render_svg

MAX_PICTURES = 1000
"""Most pictures of a scene: each is drawn by itself, which takes a tenth of a second."""

MARGIN = 4
"""Margin of a picture's rectangle around its visible pixels [px]: the picture does not reach its edges."""

SEEN = 0.5 / 255
"""Least opacity that is visible."""

MAX_CAUSES = 6
"""Kinds of elements that a line names."""


@dataclass(frozen=True)
class KeptScene:
    """A scene read from an SVG, with kept elements."""

    scene: Scene
    has_background: bool
    """Whether the SVG itself has one."""
    kept: str
    """The kept elements in words; empty: there are none."""
    document: Document | None = None
    """The document that the scene was read from."""
    elements: tuple[int | None, ...] = ()
    """Index of the element that draws each shape, the root being 0; None: no single one does."""
    background_element: int | None = None
    """Index of the element that is the background."""


def load_kept(text: str, width: int, height: int, name: str, *, background_apart: bool = True) -> KeptScene:
    """Read an SVG as ``read.load_scene`` does, but make pictures of elements that it refuses.

    Raises:
        ImageError: Not an SVG, no part that shapes can hold, or something that cannot be kept either.
    """
    try:
        parts, document = read_parts(text, width, height, keep=True)
        kept = [part for part in parts if isinstance(part, Kept)]
        shapes = _with_pictures(parts, kept, text, document, (width, height)) if kept else shapes_of(parts)
        scene, has_background = scene_of(shapes, width, height, background_apart)
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


def _in_words(kept: Sequence[Kept], pictures: Sequence[Picture] = ()) -> str:
    """Return which elements are kept and why, in one line."""
    counts: Counter[str] = Counter()
    for one in kept:
        tag = f"<{name_of(one.element)}>"
        cause = one.cause.removesuffix(", not supported").removeprefix("uses ")
        counts[tag if cause == tag else f"{tag} ({cause})"] += 1
    texts = [f"{count} {name}" if count > 1 else name for name, count in counts.items()]
    more = f" and {len(texts) - MAX_CAUSES} more kinds" if len(texts) > MAX_CAUSES else ""
    hidden = sum(not one.pixels.any() for one in pictures)
    unseen = f"; {hidden} of {len(pictures)} such places show nothing here" if hidden else ""
    return ", ".join(texts[:MAX_CAUSES]) + more + unseen


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
    size = svg_size(document.root.attrib)
    assert size  # reading the shapes has checked it
    excerpts = Excerpts(text, document)
    scope = f"{unused('kept', text)}0"
    definitions = excerpts.of(excerpts.needed([one.element for one in kept]), size)
    shared = excerpts.style(scope) + (f"<defs>{definitions}</defs>" if definitions else "")
    runs = [list(run) for _, run in groupby(parts, lambda part: isinstance(part, Kept))]
    if sum(isinstance(run[0], Kept) for run in runs) > MAX_PICTURES:
        raise ImageError(
            f"contains elements other than paths in more than {MAX_PICTURES} places between paths"
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
    picture = Picture(markup, size, (int(top), int(left)), pixels[top:bottom, left:right].copy())
    low, high = np.array([left, top]) - MARGIN, np.array([right, bottom]) + MARGIN
    corners = np.array([low, (high[0], low[1]), high, (low[0], high[1])], np.float64)
    return Shape([polygon(corners)], picture, 1.0, None, Rule.NONZERO)
