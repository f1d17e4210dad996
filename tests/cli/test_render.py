"""``render``: any SVG to PNG."""

from __future__ import annotations

import io
from pathlib import Path

import pytest
from PIL import Image

from tests.cli.helpers import QUICK, one_line, run


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
