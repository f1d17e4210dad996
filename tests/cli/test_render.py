"""``render``: any SVG to PNG."""

from __future__ import annotations

import io
import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from tests.cli.helpers import QUICK, run
from tests.svg.foreign import HEAD, PATH, SMALL
from warpsplat.metrics import psnr


def test_render(image: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    svg, png = tmp_path / "a.svg", tmp_path / "a.png"
    assert run("vectorize", image, "-o", svg, "-q", *QUICK) == 0
    assert run("render", svg, "-o", png, "--scale", "2.5") == 0
    with Image.open(png) as picture:
        assert picture.size == (150, 100)
    assert capsys.readouterr() == ("", "")


def test_render_takes_any_svg(tmp_path: Path) -> None:
    foreign = tmp_path / "a.svg"
    foreign.write_text(
        '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 10 5">'
        '<circle cx="5" cy="2" r="2" fill="red"/></svg>'
    )
    assert run("render", foreign, "-o", tmp_path / "a.png", "--scale", "4") == 0
    picture = Image.open(io.BytesIO((tmp_path / "a.png").read_bytes())).convert("RGBA")
    assert picture.size == (40, 20)
    assert picture.getpixel((20, 8)) == (255, 0, 0, 255)


SHAPES = (
    '<svg xmlns="http://www.w3.org/2000/svg" width="30" height="20.4">'
    '<circle cx="10" cy="10" r="8" fill="red" fill-opacity=".5"/>'
    '<path d="M18 4q9 0 6 12" fill="none" stroke="blue" stroke-width="3" stroke-linecap="round" '
    'stroke-linejoin="round"/></svg>'
)


@pytest.mark.parametrize(("renderer", "least"), [("exact", 34), ("splat", 24)])
def test_our_own_renderers(renderer: str, least: float, tmp_path: Path) -> None:
    (tmp_path / "a.svg").write_text(SHAPES)
    pictures = []
    for name in (renderer, "viewer"):
        png = tmp_path / f"{name}.png"
        arguments = ["--device", "cpu"] if name == renderer else []
        assert (
            run("render", tmp_path / "a.svg", "-o", png, "--scale", "2.5", "--renderer", name, *arguments)
            == 0
        )
        with Image.open(png) as picture:
            assert picture.mode == "RGBA"
            pictures.append(picture.copy())
    assert pictures[0].size == pictures[1].size == (75, 50)
    for paper in ("white", "black"):
        shown = [Image.new("RGBA", p.size, paper) for p in pictures]
        for below, above in zip(shown, pictures, strict=True):
            below.alpha_composite(above)
        assert psnr(*(np.asarray(p.convert("RGB")).astype(np.float64) for p in shown)) > least


@pytest.mark.parametrize("body", ["", '<rect width="30" height="20" fill="red"/>'])
def test_nothing_but_paper(body: str, tmp_path: Path) -> None:
    svg, png = tmp_path / "a.svg", tmp_path / "a.png"
    svg.write_text(f'<svg xmlns="http://www.w3.org/2000/svg" width="30" height="20">{body}</svg>')
    assert run("render", svg, "-o", png, "--renderer", "exact", "--device", "cpu") == 0
    with Image.open(png) as picture:
        expected = (255, 0, 0, 255) if body else (0, 0, 0, 0)
        assert picture.convert("RGBA").getpixel((15, 10)) == expected


@pytest.mark.parametrize(
    ("size", "pixels"), [('width="1in" height="48px"', (96, 48)), ('width="1" height="60000"', (1, 60000))]
)
def test_sizes(tmp_path: Path, size: str, pixels: tuple[int, int]) -> None:
    svg = tmp_path / "a.svg"
    svg.write_text(f"{HEAD}{size}>{PATH}</svg>")
    assert run("render", svg, "-o", tmp_path / "a.png") == 0
    with Image.open(tmp_path / "a.png") as picture:
        assert picture.size == pixels


def test_standard_streams(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsysbinary: pytest.CaptureFixture[bytes]
) -> None:
    class Stdin:
        buffer = io.BytesIO(f"{SMALL}{PATH}</svg>".encode())

    image = tmp_path / "a.png"
    Image.new("RGB", (40, 30)).save(image)
    monkeypatch.setattr("sys.stdin", Stdin)
    assert run("render", "-", "-o", "-") == 0
    assert Image.open(io.BytesIO(capsysbinary.readouterr().out)).size == (40, 30)
    Stdin.buffer.seek(0)
    assert run("eval", image, "-", "--json") == 0
    assert json.loads(capsysbinary.readouterr().out)["paths"] == 1
    Stdin.buffer = io.BytesIO(b"hello")
    assert run("render", "-", "-o", "-") == 3
    assert b"standard input" in capsysbinary.readouterr().err
    assert run("eval", "-", "-") == 2
