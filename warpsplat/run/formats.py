"""File formats of results, by the endings of their names: SVG, gzipped SVG, PNG, PDF, DXF, EPS."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from typing import NamedTuple

from warpsplat.errors import ImageError, UsageError
from warpsplat.files.inputs import STANDARD
from warpsplat.files.marks import mark_dxf, mark_eps, mark_pdf, mark_png
from warpsplat.files.output import SVG_ENDINGS, check_ending, svg_bytes, write_result
from warpsplat.fit.settings import DxfCurves
from warpsplat.svg.dxf import draw_dxf
from warpsplat.svg.eps import draw_eps
from warpsplat.svg.outlines import drawn_on_page
from warpsplat.svg.viewer import draw_pdf, draw_png

PICTURE_ENDINGS = (".png", ".pdf", ".dxf", ".eps")
"""Endings of results other than SVG: a PNG as a viewer shows it; a PDF, DXF or EPS of its paths."""

ENDINGS = (*SVG_ENDINGS, *PICTURE_ENDINGS)
"""Endings of results."""


class Need(NamedTuple):
    """A package that a format needs."""

    package: str
    extra: str


NEEDS = {
    ".pdf": Need("typst", "pdf"),  # reads SVGs with resvg's parser
    ".dxf": Need("ezdxf", "dxf"),
}
"""Packages that formats need, by their endings."""


def missing(path: Path) -> str:
    """Return the package that a file of this name needs and that is not installed; empty: none."""
    need = NEEDS.get(path.suffix.lower())
    return need.package if need and importlib.util.find_spec(need.package) is None else ""


def check_format(path: Path) -> None:
    """Raise ``UsageError`` if what makes a file of this name is not installed."""
    if package := missing(path):
        extra = NEEDS[path.suffix.lower()].extra
        raise UsageError(
            f"{path}: {extra.upper()}s need a package that is not installed: "
            f"pip install {package}, or warpsplat with its extra: '.[{extra}]'"
        )


def check_paths(path: Path, text: str, name: str) -> None:
    """Raise ``ImageError`` if a file of this name holds paths only, and the SVG ``name`` more than these."""
    if path.suffix.lower() in {".dxf", ".eps"}:
        try:
            drawn_on_page(text, 1.0, background=True)
        except ImageError as error:
            raise ImageError(f"{name}: {error}; {path} holds paths only") from error


def is_picture(path: Path) -> bool:
    """Return whether a result of this name is an SVG's picture."""
    return path.suffix.lower() in PICTURE_ENDINGS


def named_bytes(path: Path, text: str, *, key: str = "", zoom: float = 1.0, dxf: DxfCurves = "arcs") -> bytes:
    """Return the bytes of a result's file, in the format of the name.

    ``key``: of the job that made it, for pictures, as an SVG's text contains its own; ``zoom``: of a picture;
    ``dxf``: how a DXF has curves.
    Raises ``UsageError`` as ``check_format``, and ``ImageError`` for an SVG that cannot be drawn.
    """
    check_format(path)
    ending = path.suffix.lower()
    if ending == ".png":
        return mark_png(draw_png(text, zoom=zoom), key)
    if ending == ".pdf":
        return mark_pdf(draw_pdf(text, zoom=zoom), key)
    if ending == ".dxf":
        return mark_dxf(draw_dxf(text, dxf, zoom=zoom), key)
    if ending == ".eps":
        return mark_eps(draw_eps(text, zoom=zoom), key)
    return svg_bytes(path, text)


def write_named(path: Path, text: str, *, zoom: float = 1.0, dxf: DxfCurves = "arcs") -> None:
    """Write ``named_bytes`` atomically, or raise ``OutputError``; ``-`` is the standard output."""
    if path != STANDARD:
        check_ending(path, ENDINGS)
    write_result(path, named_bytes(path, text, zoom=zoom, dxf=dxf))
