"""``vectorize`` as a user meets it: exit codes, messages, files."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import warpsplat
from tests.cli.helpers import QUICK, Cli, one_line, python, run
from tests.drawing.trace.drawings import LOGO, draw, ground
from warpsplat.errors import ImageError
from warpsplat.metrics import psnr
from warpsplat.svg.numbers import data_uri
from warpsplat.svg.viewer import on_white, render_svg
from warpsplat.svg.write import minified


@pytest.mark.parametrize("kind", ["--closed", "--open"])
def test_vectorize(image: Path, tmp_path: Path, cli: Cli, kind: str) -> None:
    output = tmp_path / "out.svg"
    values = cli("vectorize", image, "-o", output, kind, "--json", *QUICK).values
    assert values["paths"] == 8
    assert values["bytes"] == output.stat().st_size
    shown = on_white(render_svg(output.read_text()))
    assert values["psnr"] == pytest.approx(psnr(shown, on_white(Image.open(image))), abs=0.01)


def test_summary_and_default_output(
    image: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert run("vectorize", image, *QUICK) == 0
    assert (tmp_path / "photo.svg").exists()
    captured = capfd.readouterr()
    assert re.fullmatch(
        r"photo\.svg: \d+\.\d\d dB, SSIM 0\.\d{3}(, SSIMULACRA2 -?[\d.]+)?, 8 paths, .* s\n", captured.out
    )
    assert captured.err == "", "no progress bar where stderr is no terminal"


def test_errors_during_a_run_name_the_image(tmp_path: Path, cli: Cli) -> None:
    path = tmp_path / "white.png"
    Image.fromarray(np.full((40, 40, 3), 255, np.uint8)).save(path)
    said = cli(
        "vectorize", path, "--subject", "line", "-o", tmp_path / "a.svg", "--device", "cpu", code=3
    ).line
    assert f"{path}: no lines found" in said
    with pytest.raises(ImageError, match=r"^mine: no lines found"):
        warpsplat.vectorize(path.read_bytes(), subject="line", name="mine", device="cpu")


def test_a_link_stays_a_link(image: Path, tmp_path: Path) -> None:
    real, link = tmp_path / "real.svg", tmp_path / "link.svg"
    link.symlink_to(real)
    assert run("vectorize", image, "-o", link, "-q", *QUICK) == 0
    assert link.is_symlink()
    assert real.read_text().startswith("<svg")


@pytest.mark.slow
@pytest.mark.usual_seed
def test_standard_input_and_output(image: Path) -> None:
    direct = image.parent / "a.svg"
    assert run("vectorize", image, "-o", direct, "-q", *QUICK) == 0
    words = ("-m", "warpsplat", "vectorize", "-", "-o", "-", "--json", *QUICK)
    piped = python(*words, given=image.read_bytes(), folder=str(image.parent))
    assert piped.returncode == 0
    assert piped.stdout == direct.read_bytes()
    assert json.loads(piped.stderr)["bytes"] == len(piped.stdout)
    assert not (image.parent / "-").exists()


def test_importance(image: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    output, path = tmp_path / "a.svg", tmp_path / "mask.png"

    def made(mask: Image.Image) -> str:
        mask.save(path)
        assert run("vectorize", image, "-o", output, "-q", *QUICK, "--importance", path) == 0
        return output.read_text()

    assert run("vectorize", image, "-o", output, "-q", *QUICK) == 0
    plain, half = output.read_text(), Image.new("L", (30, 20), "white")
    assert plain == made(half) == made(Image.new("L", (30, 20), "black")), "one grey weighs nothing more"
    half.paste("black", (0, 0, 15, 20))
    assert made(half) != plain
    half.resize((20, 30)).save(path)
    assert run("vectorize", image, "-o", output, "-q", *QUICK, "--importance", path) == 3
    message = "mask.png: 20x30 pixels; a mask must have the proportions of its 60x40 image"
    assert message in one_line(capfd.readouterr().err)


def test_title_and_minify(image: Path, tmp_path: Path) -> None:
    output = tmp_path / "a.svg"
    given = ("-o", output, "-q", *QUICK, "--title", "Tom & Jerry")
    assert run("vectorize", image, *given) == 0
    text = output.read_text()
    assert "<title>Tom &amp; Jerry</title>" in text
    assert run("vectorize", image, *given, "--minify") == 0
    assert output.read_text() == minified(text)
    assert run("vectorize", image, *given, "--minify") == 2, "nothing says that it is ours"
    assert run("vectorize", image, *given, "--minify", "--overwrite") == 0


def test_data_uri(image: Path, tmp_path: Path, cli: Cli) -> None:
    output = tmp_path / "a.svg"
    shown = cli("vectorize", image, "-o", output, *QUICK, "--data-uri")
    assert shown.out.strip() == data_uri(output.read_text())
    assert "dB" in shown.err


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--loss", "edges"], "loss edges has no effect on a drawing"),
        (["--shape", "circle"], "shape circle asks for fitted shapes"),
    ],
)
def test_the_effect_of_an_option_on_a_drawing_is_reported(
    tmp_path: Path, cli: Cli, options: list[str], said: str
) -> None:
    path = tmp_path / "logo.png"
    Image.fromarray(np.round(255 * draw(ground("#fff") + LOGO)[..., :3]).astype(np.uint8)).save(path)
    lines = cli(
        "vectorize", path, "-o", tmp_path / "a.svg", *options, "--quality", "draft", "--curves", "8"
    ).err.splitlines()
    assert [said in line for line in lines].count(True) == 1
