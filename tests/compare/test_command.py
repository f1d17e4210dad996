"""``compare``, the command."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from PIL import Image

from tests.cli.helpers import Cli, one_line, run
from tests.compare.tracers import bands, stub
from warpsplat.compare.tracer import TRACERS, TracerOptions

QUICK = ["--against", "vtracer", "--curves", "8,4", "--iterations", "12", "--device", "cpu"]
REPORTS = {"comparison.md", "comparison.json"}


def use(monkeypatch: pytest.MonkeyPatch, trace: Callable[[bytes, TracerOptions], str] = bands) -> None:
    monkeypatch.setitem(sys.modules, "vtracer", None)
    monkeypatch.setitem(TRACERS, "vtracer", lambda: stub(trace))


def test_a_comparison_and_its_files(
    image: Path, tmp_path: Path, cli: Cli, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Figures are those of eval; existing files are only replaced with --overwrite."""
    use(monkeypatch)
    folder = tmp_path / "new" / "folder"
    results = cli("compare", image, *QUICK, "-o", folder, "--json").values["results"]
    names = [f"{r['program'].lower()}-{r['setting']}" for r in results]
    assert results[0]["seconds"] > 0 and results[0]["cpu_seconds"] > 0
    assert names == ["warpsplat-4", "warpsplat-8", "bands-one", "bands-four"]
    files = {path.name: path.read_bytes() for path in folder.iterdir()}
    assert set(files) == REPORTS | {f"photo.{name}.svg" for name in names}
    for name, result in zip(names, results, strict=True):
        seen = cli("eval", image, folder / f"photo.{name}.svg", "--json").values
        assert all(result[k] == seen[k] for k in ("psnr", "ssim", "paths", "nodes", "bytes", "gzip_bytes"))
    assert json.loads(files["comparison.json"])["results"] == results

    assert "--overwrite replaces it" in cli("compare", image, *QUICK, "-o", folder, code=2).line
    assert files == {path.name: path.read_bytes() for path in folder.iterdir()}
    said = cli("compare", image, *QUICK, "-o", folder, "--overwrite", "--seed", "1").out
    assert said == (folder / "comparison.md").read_text()
    assert "seed 1" in (folder / "comparison.md").read_text()


def test_a_comparison_with_vtracer(image: Path, cli: Cli) -> None:
    captured = cli("compare", image, *QUICK)
    rows = [[cell.strip() for cell in line.split("|")] for line in captured.out.splitlines()]
    assert [row[2] for row in rows if row[1:2] == ["warpsplat"]] == ["4", "8"]
    assert "default" in [row[2] for row in rows if row[1:2] == ["VTracer"]]
    assert captured.err == ""


def test_several_images_and_one_failure(
    image: Path, tmp_path: Path, cli: Cli, monkeypatch: pytest.MonkeyPatch
) -> None:
    def trace(png: bytes, options: TracerOptions) -> str:
        if options["bands"] == 4:
            raise ValueError("no more than three")
        return bands(png, options)

    use(monkeypatch, trace)
    other = tmp_path / "other.png"
    Image.new("RGB", (30, 20), "teal").save(other)
    text = cli("compare", image, other, *QUICK, "-o", tmp_path / "out").out
    assert text.count("Bands, four: failed: ValueError: no more than three") == 2
    assert [line for line in text.splitlines() if line[:2] == "##"] == [
        *("## photo.png", "## other.png", "## Mean of 2 images", "## Settings")
    ]
    assert "the number of fills; 12 steps, seed 0" in text
    assert "Bands 1.2" in text and "  * four: bands 4" in text.splitlines()
    assert not list((tmp_path / "out").glob("*four*"))


def test_an_interruption_publishes_the_rows_so_far(
    image: Path, tmp_path: Path, cli: Cli, monkeypatch: pytest.MonkeyPatch
) -> None:
    def trace(png: bytes, options: TracerOptions) -> str:
        if options["bands"] == 4:
            raise KeyboardInterrupt
        return bands(png, options)

    use(monkeypatch, trace)
    captured = cli("compare", image, *QUICK, "-o", tmp_path / "out", code=130)
    assert one_line(captured.err) == "warpsplat: interrupted" and "| Bands " in captured.out
    results = json.loads((tmp_path / "out" / "comparison.json").read_text())["results"]
    assert [result["setting"] for result in results] == ["4", "8", "one"]
    monkeypatch.setattr("warpsplat.cli.signals.Interrupt.__call__", lambda self: True)
    captured = cli("compare", image, *QUICK, "-o", tmp_path / "none", code=130)
    assert one_line(captured.err) == "warpsplat: interrupted" and captured.out == ""
    assert not list((tmp_path / "none").iterdir()), "a run that was cut short is no result"


def test_vtracer_may_be_missing(image: Path, cli: Cli, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "vtracer", None)
    said = cli("compare", image, *QUICK, code=2).line
    assert "needs vtracer, which is not installed: pip install 'vtracer" in said


def test_drawings_are_traced_as_vectorize_does(tmp_path: Path) -> None:
    pixels = Image.new("RGB", (48, 40), "white")
    pixels.paste("navy", (8, 8, 30, 30))
    pixels.paste("red", (20, 16, 44, 36))
    pixels.save(tmp_path / "flat.png")
    assert run("compare", tmp_path / "flat.png", *QUICK, "-o", tmp_path / "out", "-q") == 0
    assert (
        run("vectorize", tmp_path / "flat.png", "-o", tmp_path / "a.svg", *QUICK[2:3], "8", *QUICK[4:]) == 0
    )
    assert (tmp_path / "out" / "flat.warpsplat-8.svg").read_bytes() == (tmp_path / "a.svg").read_bytes()


WRONG = [
    (["photo.png", *QUICK, "--curves", "8,x"], 2, "8,x"),
    (["photo.png", *QUICK, "--curves", "8,,9"], 2, "8,,9"),
    (["photo.png", *QUICK, "--curves", "0"], 2, "curves must be"),
    (["photo.png", *QUICK, "--iterations", "0"], 2, "iterations"),
    (["photo.png", "--against", "pen"], 2, "pen"),
    (["photo.png"], 2, "--against"),
    (QUICK, 2, "IMAGES"),
    (["photo.png", "./photo.jpg", *QUICK], 2, "another image has the name photo"),
    (["photo.png", "none.png", *QUICK], 3, "none.png: no such file"),
    (["photo.png", "text.png", *QUICK, "-o", "out"], 3, "text.png: not an image"),
    (["photo.png", *QUICK, "-o", "text.png"], 2, "text.png"),
    (["photo.png", *QUICK, "-o", "text.png/in"], 2, "text.png/in: cannot be made"),
]


@pytest.mark.parametrize(("arguments", "code", "words"), WRONG)
def test_wrong_requests_are_one_line_before_any_work(
    image: Path, cli: Cli, monkeypatch: pytest.MonkeyPatch, arguments: list[str], code: int, words: str
) -> None:
    use(monkeypatch)
    monkeypatch.chdir(image.parent)
    monkeypatch.setattr("warpsplat.fit.loop.fit", None)
    Path("text.png").write_text("no image")
    Image.new("RGB", (9, 9)).save("photo.jpg")
    before = set(Path().iterdir())
    captured = cli("compare", *arguments, code=code)
    assert words in one_line(captured.err)
    assert captured.out == "" and set(Path().iterdir()) == before
