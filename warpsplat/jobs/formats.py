"""Results as what their names say: SVG, gzipped SVG, PNG, PDF."""

from __future__ import annotations

import importlib.util
from pathlib import Path

from warpsplat.errors import UsageError
from warpsplat.files.output import PDF_MARK, SVG_ENDINGS, mark_png, write_result, write_svg_text
from warpsplat.svg.viewer import draw_pdf, draw_png

PICTURE_ENDINGS = (".png", ".pdf")
"""Of names of an SVG's pictures: pixels as a viewer shows it, and the same shapes for printers."""

ENDINGS = (*SVG_ENDINGS, *PICTURE_ENDINGS)
"""Of names of results."""

PDF_PACKAGE = "typst"
"""Makes PDFs of SVGs, which it reads with resvg's parser."""


def check_format(path: Path) -> None:
    """Whether what makes a file of this name is installed.

    Raises:
        UsageError: it is not; the message says how it is.
    """
    if path.suffix.lower() == ".pdf" and importlib.util.find_spec(PDF_PACKAGE) is None:
        raise UsageError(
            f"{path}: PDFs need a package that is not installed: "
            f"pip install {PDF_PACKAGE}, or warpsplat with its extra: '.[pdf]'"
        )


def write_named(path: Path, text: str, *, zoom: float = 1.0) -> None:
    """Write an SVG, or its picture, as the name of ``path`` says; ``-``, the standard output, takes an SVG.

    Args:
        path: the file, replaced in one step.
        text: the SVG.
        zoom: magnification of a picture.

    Raises:
        UsageError: see ``check_format``.
        ImageError: an SVG that cannot be drawn.
        OutputError: it could not be written.
    """
    ending = path.suffix.lower()
    if ending == ".png":
        write_result(path, mark_png(draw_png(text, zoom=zoom)))
    elif ending == ".pdf":
        check_format(path)
        write_result(path, draw_pdf(text, zoom=zoom) + PDF_MARK)
    else:
        write_svg_text(path, text)
