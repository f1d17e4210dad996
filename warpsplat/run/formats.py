"""File formats of results, by the endings of their names: SVG, gzipped SVG, PNG, PDF."""

from __future__ import annotations

import importlib.util
from pathlib import Path

from warpsplat.errors import UsageError
from warpsplat.files.inputs import STANDARD
from warpsplat.files.marks import mark_pdf, mark_png
from warpsplat.files.output import SVG_ENDINGS, check_ending, svg_bytes, write_result
from warpsplat.svg.viewer import draw_pdf, draw_png

PICTURE_ENDINGS = (".png", ".pdf")
"""Endings of results other than SVG: a PNG as a viewer shows it, and a PDF of its paths."""

ENDINGS = (*SVG_ENDINGS, *PICTURE_ENDINGS)
"""Endings of results."""

PDF_PACKAGE = "typst"
"""Package that makes PDFs of SVGs, which it reads with resvg's parser."""


def check_format(path: Path) -> None:
    """Raise ``UsageError`` if what makes a file of this name is not installed."""
    if path.suffix.lower() == ".pdf" and importlib.util.find_spec(PDF_PACKAGE) is None:
        raise UsageError(
            f"{path}: PDFs need a package that is not installed: "
            f"pip install {PDF_PACKAGE}, or warpsplat with its extra: '.[pdf]'"
        )


def is_picture(path: Path) -> bool:
    """Return whether a result of this name is an SVG's picture."""
    return path.suffix.lower() in PICTURE_ENDINGS


def named_bytes(path: Path, text: str, *, key: str = "", zoom: float = 1.0) -> bytes:
    """Return the bytes of a result's file, in the format of the name.

    ``key``: of the job that made it, for pictures, as an SVG's text contains its own; ``zoom``: of a picture.
    Raises ``UsageError`` as ``check_format``, and ``ImageError`` for an SVG that cannot be drawn.
    """
    ending = path.suffix.lower()
    if ending == ".png":
        return mark_png(draw_png(text, zoom=zoom), key)
    if ending == ".pdf":
        check_format(path)
        return mark_pdf(draw_pdf(text, zoom=zoom), key)
    return svg_bytes(path, text)


def write_named(path: Path, text: str, *, zoom: float = 1.0) -> None:
    """Write ``named_bytes`` atomically; ``-`` is the standard output.

    Raises its errors, ``UsageError`` for another ending, and ``OutputError`` if the file cannot be written.
    """
    if path != STANDARD:
        check_ending(path, ENDINGS)
    write_result(path, named_bytes(path, text, zoom=zoom))
