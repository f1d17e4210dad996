"""SVG -> scene, with what no shape can hold as pictures between the shapes."""

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
from warpsplat.svg.kept import Kept, Part
from warpsplat.svg.paints import unused
from warpsplat.svg.read import scene_of
from warpsplat.svg.shapes import Shape
from warpsplat.svg.structure import read_parts
from warpsplat.svg.viewer import premultiplied, render_svg

MAX_PICTURES = 1000
"""Most pictures of a scene: each is drawn by itself, which takes a tenth of a second."""

MARGIN = 4
"""By how much a picture's rectangle is larger than what is seen of it [px]: its edges move nothing."""

SEEN = 0.5 / 255
"""Opacity from which on something is seen."""


@dataclass(frozen=True)
class KeptScene:
    """An SVG, read."""

    scene: Scene
    has_background: bool
    """Whether the SVG itself has one."""
    kept: str
    """What is kept, for people; empty: nothing."""
    document: Document | None = None
    """That it was read from."""
    elements: tuple[int | None, ...] = ()
    """Which element of the document draws each shape, counted from 0, the root; None: no single one."""
    background_element: int | None = None
    """Which one is the background."""


def load_kept(text: str, width: int, height: int, name: str, *, background_apart: bool = True) -> KeptScene:
    """Read an SVG as ``read.load_scene`` does, but for what that refuses: this becomes pictures.

    Raises:
        ImageError: not an SVG, nothing in it that shapes can hold, or something that cannot be kept either.
    """
    try:
        parts, document = read_parts(text, width, height)
        kept = [part for part in parts if isinstance(part, Kept)]
        shapes = _with_pictures(parts, kept, text, document, (width, height)) if kept else parts
        scene, has_background = scene_of(
            [part for part in shapes if isinstance(part, Shape)],
            width,
            height,
            background_apart=background_apart,
        )
        if (scene.paint == Paint.PICTURE).all():
            causes = f": {_words(kept)}" if kept else ""
            raise ImageError(f"has no path that can be refined{causes}")
    except ImageError as error:
        raise ImageError(f"{name}: {error}") from error
    numbers = {element: number for number, element in enumerate(document.root.iter())}
    drawn = [None if s.element is None else numbers[s.element] for s in shapes if isinstance(s, Shape)]
    return KeptScene(
        scene,
        has_background,
        _words(kept, scene.pictures) if kept else "",
        document,
        tuple(drawn[has_background:]),
        drawn[0] if has_background else None,
    )


def _words(kept: Sequence[Kept], pictures: Sequence[Picture] = ()) -> str:
    """Which elements are kept and why, in one line."""
    counts = Counter(
        tag if said == tag else f"{tag} ({said})"
        for one in kept
        for tag in [f"<{name_of(one.element)}>"]
        for said in [one.cause.removesuffix(", not supported").removeprefix("uses ")]
    )
    texts = [f"{count} {what}" if count > 1 else what for what, count in counts.items()]
    more = f" and {len(texts) - MOST_WORDS} more kinds" if len(texts) > MOST_WORDS else ""
    hidden = sum(not one.pixels.any() for one in pictures)
    unseen = f"; {hidden} of {len(pictures)} such places show nothing here" if hidden else ""
    return ", ".join(texts[:MOST_WORDS]) + more + unseen


MOST_WORDS = 6
"""Kinds of elements that a line names."""


def _with_pictures(
    parts: Sequence[Part], kept: Sequence[Kept], text: str, document: Document, extent: tuple[int, int]
) -> list[Shape]:
    """The parts with pictures in place of what is kept; neighbours share one.

    Raises:
        ImageError: something that cannot be kept.
    """
    root = document.style_of(document.root)
    if root["transform"] != "none":
        raise ImageError("has a transform on its root, which cannot be kept")
    size = svg_size(document.root.attrib)
    assert size  # as reading its shapes has found
    excerpts = Excerpts(text, document)
    scope = f"{unused('kept', text)}0"
    definitions = excerpts.of(excerpts.needed([one.element for one in kept]), size)
    shared = excerpts.style(scope) + (f"<defs>{definitions}</defs>" if definitions else "")
    shapes: list[Shape] = []
    is_first = True
    if sum(1 for is_kept, _ in groupby(parts, lambda part: isinstance(part, Kept)) if is_kept) > MAX_PICTURES:
        raise ImageError(f"has what no path can show in more than {MAX_PICTURES} places between paths")
    for is_kept, run in groupby(parts, lambda part: isinstance(part, Kept)):
        if not is_kept:
            shapes += [part for part in run if isinstance(part, Shape)]
            continue
        alike = [part for part in run if isinstance(part, Kept)]
        excerpt = excerpts.of([one.element for one in alike], size)
        with_shared, alone = (f'<g class="{scope}">{before}{excerpt}</g>' for before in (shared, ""))
        pixels = _drawn(with_shared, size, extent, blends=any(one.blends for one in alike))
        shapes.append(_shape(with_shared if is_first else alone, size, pixels))
        is_first = False
    return shapes


def _drawn(markup: str, size: tuple[float, float], extent: tuple[int, int], *, blends: bool) -> FloatArray:
    """What markup shows, premultiplied with opacity; where it ``blends``, as far as paint and opacity can
    say what it makes of black and of white, shape (height, width, 4).
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


def _shape(markup: str, size: tuple[float, float], pixels: FloatArray) -> Shape:
    """The rectangle in which markup shows something."""
    seen = pixels.max(axis=2) > SEEN
    rows, columns = np.flatnonzero(seen.any(axis=1)), np.flatnonzero(seen.any(axis=0))
    top, bottom = (rows[0], rows[-1] + 1) if len(rows) else (0, 1)
    left, right = (columns[0], columns[-1] + 1) if len(columns) else (0, 1)
    picture = Picture(markup, size, (int(top), int(left)), pixels[top:bottom, left:right].copy())
    low, high = np.array([left, top]) - MARGIN, np.array([right, bottom]) + MARGIN
    corners = np.array([low, (high[0], low[1]), high, (low[0], high[1])], np.float64)
    return Shape([polygon(corners)], picture, 1.0, None, Rule.NONZERO)
