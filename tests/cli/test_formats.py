"""The ending of a result's name gives its format."""

from __future__ import annotations

import gzip
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
from PIL import Image

from tests.cli.helpers import QUICK, Cli, one_line, run
from warpsplat.errors import UsageError
from warpsplat.files.output import may_replace
from warpsplat.metrics import psnr
from warpsplat.run.formats import write_named
from warpsplat.run.vectorize import vectorize
from warpsplat.svg.viewer import on_white, render_svg

SVG = """<svg xmlns="http://www.w3.org/2000/svg" width="64" height="48">
<clipPath id="c"><circle cx="20" cy="20" r="15"/></clipPath>
<linearGradient id="g"><stop stop-color="#f80"/>
<stop offset="1" stop-color="#08f" stop-opacity=".3"/></linearGradient>
<radialGradient id="h"><stop stop-color="#fff"/><stop offset="1" stop-color="#402"/></radialGradient>
<path d="M2 2H40V40H2z" fill="url(#g)"/>
<g clip-path="url(#c)"><path d="M5 5H40V40H5z" fill="#063" fill-opacity=".5"/></g>
<path d="M30 6H60V36H30zM38 12H52V30H38z" fill-rule="evenodd" fill="url(#h)"/>
<path d="M4 44Q30 20 60 42" fill="none" stroke="#609" stroke-width="4" stroke-linecap="round"
 stroke-opacity=".7"/>
<path d="M34 4h24" stroke="#000" stroke-width="3" stroke-dasharray="5 3"/>
</svg>"""
"""Gradients, opacities, a clip, a hole, caps and dashes."""


def shown(path: Path, scale: float) -> npt.NDArray[np.float64]:
    """Return a PDF's page as its viewer shows it, with ``scale`` pixels a point."""
    pdfium = pytest.importorskip("pypdfium2")
    document = pdfium.PdfDocument(path)
    assert len(document) == 1
    return on_white(document[0].render(scale=scale).to_pil())


def test_a_pdf_shows_what_the_svg_shows(tmp_path: Path) -> None:
    pytest.importorskip("typst")
    path = tmp_path / "a.pdf"
    write_named(path, SVG)
    data = path.read_bytes()
    assert data.startswith(b"%PDF-")
    assert b"/Subtype/Image" not in data, "pixels"
    # Four pixels for each of the SVG's, of which a point has 4/3.
    expected = on_white(render_svg(SVG, zoom=4))
    found = shown(path, 4 * 96 / 72)
    assert found.shape == expected.shape
    assert psnr(found, expected) > 35
    write_named(path, SVG)
    assert path.read_bytes() == data
    assert may_replace(path)
    (tmp_path / "a.svg").write_text(SVG)
    assert run("render", tmp_path / "a.svg", "-o", path, "--scale", 2) == 0
    assert shown(path, 2 * 96 / 72).shape == expected.shape


def test_vectorize_and_refine_write_what_the_name_says(
    image: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    paths = {ending: tmp_path / f"a{ending}" for ending in (".svg", ".svgz", ".PNG")}
    for path in paths.values():
        assert run("vectorize", image, "-o", path, *QUICK) == 0
    assert "kB gzipped) as an SVG, " in capfd.readouterr().out.splitlines()[-1]
    text = paths[".svg"].read_text()
    assert gzip.decompress(paths[".svgz"].read_bytes()).decode() == text
    with Image.open(paths[".PNG"]) as png:
        assert png.format == "PNG"
        assert png.tobytes() == render_svg(text).convert(png.mode).tobytes()
    refined = tmp_path / "refined.png"
    for _ in range(2):  # what is there is ours and may be replaced
        assert run("refine", paths[".svg"], image, "-o", refined, "--iterations", 3, "--device", "cpu") == 0
    with Image.open(refined) as png:
        assert (png.format, png.size) == ("PNG", (60, 40))


def test_a_missing_package_is_named_before_any_work(
    image: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    for extra, package in (("pdf", "typst"), ("dxf", "ezdxf")):
        path = image.parent / f"a.{extra}"
        assert run("vectorize", image, "-o", path, *QUICK) == 2
        message = f"pip install {package}, or warpsplat with its extra: '.[{extra}]'"
        assert message in one_line(capfd.readouterr().err)
        with pytest.raises(UsageError, match=f"pip install {package}"):
            write_named(path, SVG)
        assert not path.exists()


PATHS = SVG.replace('clip-path="url(#c)"', "")
"""The same without a clip, of which no outlines are made."""


@pytest.mark.parametrize(("ending", "begins"), [("dxf", b"  0\nSECTION\n"), ("eps", b"%!PS-Adobe-3.0 EPSF")])
def test_files_for_machines_are_written_and_known(
    ending: str, begins: bytes, image: Path, tmp_path: Path
) -> None:
    if ending == "dxf":
        pytest.importorskip("ezdxf")
    svg, path = tmp_path / "a.svg", tmp_path / f"a.{ending}"
    svg.write_text(PATHS)
    for arguments in (("render", svg, "--scale", 2), ("vectorize", image, *QUICK)):
        assert run(*arguments, "-o", path, "--dxf", "lines") == 0
        assert path.read_bytes().startswith(begins)
        assert may_replace(path)
    path.write_bytes(path.read_bytes().replace(b"warpsplat", b"somebody"))
    assert not may_replace(path)


def test_how_curves_are_written(image: Path, tmp_path: Path) -> None:
    pytest.importorskip("ezdxf")
    result = vectorize(image, curves=3, iterations=3, device="cpu", dxf="r12", output=tmp_path / "a.dxf")
    result.save(tmp_path / "b.dxf", dxf="r12")
    result.save(tmp_path / "c.dxf")
    made = [(tmp_path / f"{name}.dxf").read_bytes() for name in "abc"]
    assert made[0] == made[1] != made[2]
    assert b"AC1009" in made[0] and b"AC1018" in made[2]


def test_kept_text_is_refused_in_an_eps_before_any_work(image: Path, tmp_path: Path, cli: Cli) -> None:
    svg = tmp_path / "a.svg"
    svg.write_text(PATHS.replace("</svg>", "<text>a</text></svg>"))
    said = cli("refine", svg, image, "--keep", "-o", tmp_path / "b.eps", "--iterations", 3, code=3).line
    assert "<text>" in said
