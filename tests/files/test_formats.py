"""The formats that are read: those of nothing but pixels."""

from __future__ import annotations

import ast
import io
import os
import subprocess
from pathlib import Path

import pytest
from PIL import EpsImagePlugin, Image, ImageFile

import warpsplat
from tests import ROOT
from tests.cli.helpers import Cli
from tests.files.samples import load_image
from warpsplat.errors import ExitCode, ImageError
from warpsplat.files.image import FORMATS, image_facts
from warpsplat.files.plugins import PLUGINS
from warpsplat.files.sources import load_importance

ENDLESS = b"%!PS-Adobe-3.0 EPSF-3.0\n%%BoundingBox: 0 0 16 16\n%%EndComments\n{} loop\nshowpage\n%%EOF\n"
"""An endless PostScript program."""

PIXELS = {*FORMATS, "MPO", *(plugin.format for plugin in PLUGINS)}
"""An MPO is a JPEG with others appended."""

REFUSED = {
    *("EPS", "PDF", "WMF", "FPX", "MIC", "BUFR", "GRIB", "HDF5", "MPEG"),  # programs, documents, stubs, films
    *("IPTC", "ICNS", "CUR", "DIB", "DCX", "FITS", "FLI", "FTEX", "BLP", "GBR", "IM", "IMT", "MCIDAS"),
    *("MSP", "PALM", "PCD", "PIXAR", "SPIDER", "SUN", "XBM", "XPM", "XVTHUMB"),
}
"""Other formats of Pillow."""


@pytest.fixture
def programs(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Return a list of the programs that Ghostscript would have run; it need not be installed."""
    ran: list[str] = []

    def interpret(*_: object, **__: object) -> object:
        ran.append("gs")
        return Image.new("RGB", (16, 16)).im

    monkeypatch.setattr(EpsImagePlugin, "Ghostscript", interpret)
    return ran


def test_postscript_is_run_by_nothing_that_reads_images(
    tmp_path: Path, programs: list[str], cli: Cli
) -> None:
    path = tmp_path / "x.png"
    path.write_bytes(ENDLESS)
    said = cli("vectorize", path, "-o", tmp_path / "x.svg", code=ExitCode.INPUT).line
    assert "x.png: not an image of a format that is read: AVIF, BMP, " in said
    names = ", ".join(sorted([*FORMATS, *(plugin.format for plugin in PLUGINS)]))
    message = rf"x\.png: not an image of a format that is read: {names}$"
    for read in (
        lambda: load_image(path),
        lambda: load_image(ENDLESS, "x.png"),
        lambda: load_importance(path, 16, 16),
        lambda: warpsplat.load_image(path),
    ):
        with pytest.raises(ImageError, match=message):
            read()
    assert image_facts(ENDLESS) is None
    assert programs == []


def test_every_format_of_pillow_is_accounted_for() -> None:
    """A format that a later Pillow adds is not read, and fails here."""
    Image.init()
    assert not PIXELS & REFUSED
    assert (set(Image.OPEN) | set(Image.SAVE)) - PIXELS == REFUSED & (set(Image.OPEN) | set(Image.SAVE))


@pytest.mark.parametrize("form", FORMATS)
def test_no_format_that_is_read_starts_a_program(form: str, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise AssertionError("starts a program")

    Image.init()
    factory = Image.OPEN[form][0]
    assert not (isinstance(factory, type) and issubclass(factory, ImageFile.StubImageFile))
    if form not in Image.SAVE:  # PSD
        return
    data = io.BytesIO()
    Image.new("RGB", (16, 16), "teal").save(data, form)
    monkeypatch.setattr(subprocess, "Popen", refuse)
    monkeypatch.setattr(os, "system", refuse)
    assert load_image(data.getvalue(), form).shape == (16, 16, 3)


def test_files_of_unknown_origin_are_opened_in_one_place() -> None:
    calls = [
        f"{path.relative_to(ROOT)}: {ast.unparse(node)}"
        for folder in ("warpsplat", "cli", "examples")
        for path in (ROOT / folder).rglob("*.py")
        for node in ast.walk(ast.parse(path.read_text()))
        if isinstance(node, ast.Call) and ast.unparse(node.func) == "Image.open"
    ]
    assert calls == ["warpsplat/files/image.py: Image.open(io.BytesIO(data), formats=formats)"]
