"""``render``: any SVG to PNG."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from tests.cli.helpers import QUICK, one_line, run
from warpsplat.metrics import psnr


def test_render(image: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    svg, png = tmp_path / "a.svg", tmp_path / "a.png"
    assert run("vectorize", image, "-o", svg, "-q", *QUICK) == 0
    assert run("render", svg, "-o", png, "--scale", "2.5") == 0
    with Image.open(png) as picture:
        assert picture.size == (150, 100)
    assert capsys.readouterr() == ("", "")


def test_render_errors(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    good = tmp_path / "good.svg"
    good.write_text('<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 4 2"/>')
    (tmp_path / "binary.svg").write_bytes(bytes(range(256)))
    (tmp_path / "text.svg").write_text("hello")
    for name in ("binary.svg", "text.svg", "missing.svg", "."):
        assert run("render", tmp_path / name, "-o", tmp_path / "a.png") == 3
        assert name.strip(".") in one_line(capsys.readouterr().err)
    for scale in ("0", "-1", "nan", "1e9"):
        assert run("render", good, "-o", tmp_path / "a.png", "--scale", scale) == 2
        assert "scale" in one_line(capsys.readouterr().err)
    assert not (tmp_path / "a.png").exists()


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


def test_physical_units(tmp_path: Path) -> None:
    svg = tmp_path / "a.svg"
    svg.write_text('<svg xmlns="http://www.w3.org/2000/svg" width="1in" height="48px"/>')
    assert run("render", svg, "-o", tmp_path / "a.png") == 0
    with Image.open(tmp_path / "a.png") as picture:
        assert picture.size == (96, 48)


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


@pytest.mark.parametrize(
    ("renderer", "body", "words"),
    [
        ("exact", "<text>a</text>", "<text>"),
        ("splat", '<path d="M1 1h9v9zM3 3v4h4z"/>', "several contours"),
        ("splat", '<path d="M1 1h9v9" fill="none" stroke="red"/>', "caps"),
    ],
)
def test_what_they_cannot_show_is_named(
    renderer: str, body: str, words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    svg = tmp_path / "a.svg"
    svg.write_text(f'<svg xmlns="http://www.w3.org/2000/svg" width="30" height="20">{body}</svg>')
    assert run("render", svg, "-o", tmp_path / "a.png", "--renderer", renderer, "--device", "cpu") == 3
    message = one_line(capsys.readouterr().err)
    assert words in message
    assert "a.svg" in message


@pytest.mark.parametrize("body", ["", '<rect width="30" height="20" fill="red"/>'])
def test_nothing_but_paper(body: str, tmp_path: Path) -> None:
    svg, png = tmp_path / "a.svg", tmp_path / "a.png"
    svg.write_text(f'<svg xmlns="http://www.w3.org/2000/svg" width="30" height="20">{body}</svg>')
    assert run("render", svg, "-o", png, "--renderer", "exact", "--device", "cpu") == 0
    with Image.open(png) as picture:
        expected = (255, 0, 0, 255) if body else (0, 0, 0, 0)
        assert picture.convert("RGBA").getpixel((15, 10)) == expected


def test_an_svg_of_very_many_pixels(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Whose fault it is, the SVG's or the scale's, says the exit code."""
    svg, png = tmp_path / "a.svg", tmp_path / "a.png"
    svg.write_text('<svg xmlns="http://www.w3.org/2000/svg" width="1e9" height="1e-9" viewBox="0 0 4 2"/>')
    assert run("render", svg, "-o", png) == 3
    assert "a.svg: has more than 200 million pixels" in one_line(capsys.readouterr().err)
    assert run("render", svg, "-o", png, "--scale", "2") == 2
    assert "scale 2.0 makes" in one_line(capsys.readouterr().err)
