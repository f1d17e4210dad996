"""``render``: any SVG to PNG."""

from __future__ import annotations

import io
import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from tests.cli.helpers import QUICK, Cli, run
from tests.fuzz.corpus import own_svg
from tests.svg.foreign import HEAD, PATH, SMALL
from warpsplat.metrics import psnr


def test_render(image: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    svg, png = tmp_path / "a.svg", tmp_path / "a.png"
    assert run("vectorize", image, "-o", svg, "-q", *QUICK) == 0
    assert run("render", svg, "-o", png, "--scale", "2.5", "-q") == 0
    with Image.open(png) as picture:
        assert picture.size == (150, 100)
    assert capfd.readouterr() == ("", "")


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


RECT = '<rect width="30" height="20" fill="red"/>'


@pytest.mark.parametrize(
    ("size", "body", "pixels"),
    [
        ('width="1in" height="48px"', PATH, (96, 48)),
        ('width="1" height="60000"', PATH, (1, 60000)),
        ('width="30" height="20"', RECT, (30, 20)),
        ('width="30" height="20"', "", (30, 20)),
    ],
)
def test_any_svg(tmp_path: Path, size: str, body: str, pixels: tuple[int, int]) -> None:
    svg, png = tmp_path / "a.svg", tmp_path / "a.png"
    svg.write_text(f"{HEAD}{size}>{body}</svg>")
    for how in ((), ("--renderer", "exact", "--device", "cpu"))[: 1 if body == PATH else 2]:
        assert run("render", svg, "-o", png, *how) == 0
        with Image.open(png) as picture:
            assert picture.size == pixels
            if body != PATH:
                colour = (255, 0, 0, 255) if body else (0, 0, 0, 0)
                assert picture.convert("RGBA").getpixel((15, 10)) == colour


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


def test_a_name_of_its_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, cli: Cli) -> None:
    """Without -o a PNG here, and one line about it, which -q leaves out."""
    monkeypatch.chdir(tmp_path)
    Path("in").mkdir()
    Path("in/a.svg").write_bytes(own_svg("fill"))
    assert cli("render", "in/a.svg").out == f"a.png: {Path('a.png').stat().st_size / 1000:.1f} kB\n"
    assert cli("render", "in/a.svg", "-q").out == ""
