"""Read SVGs as scenes, write scenes as SVGs, and score SVGs."""

from __future__ import annotations

import math
import os
from dataclasses import replace

from warpsplat.errors import ImageError, naming
from warpsplat.files.remote import path_of
from warpsplat.files.sources import (
    FILE_PATHS,
    BytesLike,
    FilePath,
    ImageSource,
    Readable,
    image_of,
    source_bytes,
    source_name,
)
from warpsplat.fit.export import export
from warpsplat.fit.rounding import finest
from warpsplat.fit.settings import make_settings
from warpsplat.metrics import Score, score_svg
from warpsplat.run.formats import write_named
from warpsplat.scene import Scene
from warpsplat.scene.scene import check_scene
from warpsplat.svg.inspect import inspect_svg, svg_size, svg_text
from warpsplat.svg.read import load_kept
from warpsplat.svg.write import minified

SvgSource = FilePath | BytesLike | Readable
"""An SVG: its text (a string with a ``<`` in it), its file's path or URL, its bytes, or a file open for
reading; gzipped or not."""


def load_svg(svg: SvgSource, *, keep: bool = False) -> Scene:
    """Read the paths of any SVG as a scene, at the SVG's own size.

    Args:
        svg: as for ``refine``.
        keep: hold text, images, filters ... as pictures, which are drawn and written as they are.

    Raises:
        ImageError: not an SVG, one without a size or without paths, or one with something that a scene
            cannot hold.
    """
    name = svg_name_of(svg)
    text = text_of(svg, name)
    width, height = (max(1, math.floor(side + 0.5)) for side in size_of(text, name))
    read = load_kept(text, width, height, name, keep=keep)
    scene = read.scene
    return scene if read.has_background else replace(scene, canvas=replace(scene.canvas, background=None))


def save_svg(
    scene: Scene,
    path: str | os.PathLike[str] | None = None,
    *,
    precision: int | None = None,
    title: str = "",
    ids: bool = False,
    minify: bool = False,
) -> str:
    """Return the SVG of a scene, and write it to ``path`` atomically if that is given.

    Args:
        scene: what to write.
        path: its ending decides the format, see ``Result.save``; an existing file is replaced.
        precision: decimals of a pixel in coordinates; default: two.
        title: as for ``vectorize``.
        ids: as for ``vectorize``.
        minify: as for ``vectorize``.

    Raises:
        UsageError: a value out of range.
        OutputError: ``path`` cannot be written.
        TypeError: not a scene.
    """
    check_scene(scene)
    settings = make_settings(precision=precision, title=title, ids=ids)
    text = export(scene, settings, finest(settings))
    text = minified(text) if minify else text
    if path is not None:
        write_named(path_of(path), text)
    return text


def score(svg: SvgSource | Scene, image: ImageSource) -> Score:
    """Measure how well an SVG shows an image, as a viewer draws it at the image's size, and count its parts.

    Of a scene it is the SVG that ``save_svg`` writes.
    If the image has opacity, it is measured on black and on white, and the lower figures count.

    Raises:
        ImageError: either cannot be read, or their proportions differ.
    """
    svg = save_svg(svg) if isinstance(svg, Scene) else svg
    name = svg_name_of(svg)
    target, text = image_of(image), text_of(svg, name)
    with naming(name):
        return score_svg(text, target)


def svg_name_of(svg: object) -> str:
    """Return the name of an SVG in messages."""
    is_text = isinstance(svg, str) and ("<" in svg or not svg.strip())
    return "the SVG" if is_text else source_name(svg, "the SVG")


def text_of(svg: SvgSource, name: str) -> str:
    """Return the text of an SVG; raise ``ImageError``, which names it, if it cannot be read."""
    if isinstance(svg, str) and "<" in svg:
        return svg
    if isinstance(svg, (str, bytes)) and not svg.strip():
        raise ImageError(f"{name}: is empty: give an SVG's text, its bytes, or the path of its file")
    if not isinstance(svg, (*FILE_PATHS, BytesLike, Readable)):
        raise TypeError(f"an SVG is its text, a path, bytes or a file, not {type(svg).__name__}")
    return svg_text(source_bytes(svg, "an SVG"), name)


def size_of(text: str, name: str) -> tuple[float, float]:
    """Return width and height of an SVG [px]; raise ``ImageError``, which names it, without them."""
    with naming(name):
        size = svg_size(inspect_svg(text).root)
        if size is None:
            raise ImageError("has neither a size nor a viewBox")
    return size
