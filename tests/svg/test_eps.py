"""Fills and strokes as EPS."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from tests.cli.test_formats import SVG
from tests.svg.foreign import HEAD
from warpsplat.metrics import psnr
from warpsplat.svg.eps import draw_eps
from warpsplat.svg.viewer import on_white, render_svg


def lines_of(shapes: str) -> list[str]:
    """Return the lines that draw shapes on a page of 72 points."""
    lines = draw_eps(f'{HEAD}width="96" height="96">{shapes}</svg>').decode().splitlines()
    assert lines[0] == "%!PS-Adobe-3.0 EPSF-3.0"
    assert "%%BoundingBox: 0 0 72 72" in lines
    first = lines.index("0 0 72 72 rectclip") + 1
    assert lines[-2:] == ["grestore", "%%EOF"]
    return lines[first:-2]


def test_points_upwards() -> None:
    made = lines_of('<path d="M0 0H32V64z" fill="#f80" fill-rule="evenodd"/>')
    assert made == ["1 .533 0 k", "0 72 m", "24 72 l", "24 24 l", "0 72 l", "h", "eofill"]


def test_opacity_is_that_on_white() -> None:
    made = lines_of('<rect width="9" height="9" fill="#000" fill-opacity=".25"/>')
    assert made[0] == ".75 .75 .75 k" and made[-1] == "fill"
    assert lines_of('<rect width="9" height="9" fill-opacity="0"/>') == []


def test_strokes() -> None:
    made = lines_of(
        '<path d="M0 96C0 64 32 32 96 0" fill="none" stroke="red" stroke-width="4" stroke-linecap="square" '
        'stroke-linejoin="bevel" stroke-dasharray="8 4" stroke-dashoffset="2"/>'
    )
    pen = "1 0 0 k 3 setlinewidth 2 setlinecap 2 setlinejoin 4 setmiterlimit [6 3] 1.5 setdash"
    assert made == [pen, "0 0 m", "0 24 24 48 72 72 c", "stroke"]


@pytest.mark.skipif(not shutil.which("gs"), reason="needs Ghostscript")
def test_ghostscript_shows_what_the_svg_shows(tmp_path: Path) -> None:
    """Without gradients and opacity, which EPS has not."""
    text = SVG.replace('clip-path="url(#c)"', "").replace("url(#g)", "#f80").replace("url(#h)", "#402")
    for opacity in ('stroke-opacity=".7"', 'fill-opacity=".5"'):
        text = text.replace(opacity, "")
    (tmp_path / "a.eps").write_bytes(draw_eps(text))
    options = ["-q", "-dSAFER", "-dBATCH", "-dNOPAUSE", "-dEPSCrop", "-dGraphicsAlphaBits=4", "-r384"]
    made = ["-sDEVICE=png16m", f"-sOutputFile={tmp_path / 'a.png'}", str(tmp_path / "a.eps")]
    subprocess.run(["gs", *options, *made], check=True, timeout=60)
    found = np.asarray(Image.open(tmp_path / "a.png").convert("RGB"), np.float64)
    expected = on_white(render_svg(text, zoom=4))
    assert found.shape == expected.shape
    assert psnr(found, expected) > 28
