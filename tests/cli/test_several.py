"""Several numbers of shapes on the command line, and how many are suggested."""

from __future__ import annotations

import json
import os
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

import warpsplat
from tests.cli.helpers import Cli, run
from warpsplat.cli.main import main
from warpsplat.fit.settings import PRESETS
from warpsplat.run.suggest import Expected, Suggestion, choose

FEW = ["--iterations", "12", "--device", "cpu", "--threads", "1"]


def test_a_file_for_each_number(
    image: Path, tmp_path: Path, cli: Cli, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Short runs do not continue from each other: the files are those of single runs."""
    monkeypatch.chdir(tmp_path)
    lines = cli("vectorize", image, "--curves", "9,3", "--report", "both.html", *FEW).out.splitlines()
    assert lines[0].split() == ["shapes", "dB", "SSIM", "kB", "gzip", "kB", "seconds"]
    assert [line.split()[:2] for line in lines[1:]] == [["photo-9.svg", "9"], ["photo-3.svg", "3"]]
    page = Path("both.html").read_text()
    assert page.count('class="card version') == 2 and "--curves 9,3" in re.sub("<[^>]*>", "", page)
    assert run("vectorize", image, "--curves", "3", "-o", "alone.svg", "-q", *FEW) == 0
    assert Path("alone.svg").read_bytes() == Path("photo-3.svg").read_bytes()


@pytest.mark.parametrize(
    ("output", "names"),
    [
        ("out.svg", {"out-2.svg", "out-5.svg"}),
        ("f{o/x", {"f{o/x/photo-2.svg", "f{o/x/photo-5.svg"}),
        ("new/{stem}/{curves}.png", {"new/photo/2.png", "new/photo/5.png"}),
        ("{stem}_{curves}_{seed}.svgz", {"photo_2_0.svgz", "photo_5_0.svgz"}),
    ],
)
def test_names(
    image: Path, tmp_path: Path, cli: Cli, monkeypatch: pytest.MonkeyPatch, output: str, names: set[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    quick = ["--iterations", "1", "--device", "cpu"]
    values = cli("vectorize", image, "--curves", "2,5", "-o", output, "--json", *quick).values
    assert [one["shapes"] for one in values] == [2, 5]
    assert {one["output"] for one in values} == names and all(map(os.path.isfile, names))


def test_results_made_before_a_stop_are_complete(image: Path, tmp_path: Path) -> None:
    """The second run is stopped: its file is there as it was then, the third is none."""
    outputs = [tmp_path / f"{number}.svg" for number in (3, 6, 9)]
    done: list[warpsplat.Result] = []
    stopping: dict[str, Any] = {"callback": lambda now: len(done) == 1, "ready": done.append}
    results = warpsplat.vectorize_several(
        image, [3, 6, 9], iterations=12, outputs=outputs, device="cpu", **stopping
    )
    assert [result.stopped for result in results] == [False, True]
    assert [output.exists() for output in outputs] == [True, True, False]
    assert outputs[0].read_text() == results[0].svg


def test_files_are_named_after_their_numbers_where_it_is_interrupted(
    image: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Files of few shapes are made first, in whichever order the numbers are given."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("warpsplat.cli.run.Interrupt.__call__", lambda self: os.path.exists("photo-3.svg"))
    run("vectorize", image, "--curves", "9,3,6", *FEW)
    _, row, last = capfd.readouterr().out.splitlines()
    assert row.split()[:2] == ["photo-3.svg", "3"]
    assert last == "interrupted: no file for --curves 9, 6"
    assert {path.name for path in tmp_path.glob("*.svg")} == {"photo-3.svg"}


def test_the_library_names_the_function_for_several(image: Path) -> None:
    with pytest.raises(warpsplat.UsageError, match=r"vectorize_several\(image, \[3, 9\]\)"):
        warpsplat.vectorize(image, [3, 9])
    with pytest.raises(warpsplat.UsageError, match="2 numbers of shapes and 1 outputs"):
        warpsplat.vectorize_several(image, [3, 9], outputs=["a.svg"])


def two_squares() -> np.ndarray:
    levels = np.full((48, 48, 3), 250, np.uint8)
    levels[8:30, 8:30], levels[20:40, 20:44] = (200, 130, 130), (120, 180, 160)
    return levels


def test_a_drawing_has_no_more_shapes_than_regions() -> None:
    few, many, most = warpsplat.vectorize_several(two_squares(), [1, 9, 99], subject="drawing", device="cpu")
    assert many.svg == most.svg and len(few.scene) < len(many.scene) <= 9


@pytest.mark.parametrize("noise", [1, 90])
def test_fits_to_a_drawing_start_from_scratch(noise: int) -> None:
    """Continuing from one another would cost quality; fits to what looks like a photograph do continue."""
    levels = two_squares()
    levels -= np.random.default_rng(0).integers(0, noise, levels.shape, np.uint8)
    settings = warpsplat.make_settings(subject="photo", iterations=30, density={"interval": 2})
    few, many = warpsplat.vectorize_several(levels, [3, 6], settings=settings, device="cpu", threads=1)
    assert few.iterations == 30
    assert (many.iterations == 30) == (noise == 1)


@pytest.fixture
def quickly(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(PRESETS["draft"], "iterations", 40)
    monkeypatch.setattr("warpsplat.run.suggest.FEWEST_SHAPES", 16)


@pytest.mark.usefixtures("quickly")
def test_a_suggestion(image: Path, cli: Cli) -> None:
    before = os.listdir(image.parent)
    values = cli("vectorize", image, "--suggest", "--open", "--json", "--device", "cpu").values
    drafts = values["expected"]
    assert [one["shapes"] for one in drafts] == [16 * 2**i for i in range(len(drafts))]
    assert [one["bytes"] for one in drafts] == sorted(one["bytes"] for one in drafts)
    assert drafts[0]["psnr"] < drafts[-1]["psnr"]
    assert (values["curves"], values["why"]) == choose([Expected(**one) for one in drafts])
    assert values["command"] == f"warpsplat vectorize {image} --curves {values['curves']} --open -o photo.svg"
    assert os.listdir(image.parent) == before


@pytest.mark.usefixtures("quickly")
def test_a_suggestion_stops_when_asked(image: Path) -> None:
    assert warpsplat.suggest(image, device="cpu", stop=lambda: True) is None


def series(*figures: tuple[int, float, int]) -> tuple[Expected, ...]:
    return tuple(Expected(*one) for one in figures)


def test_a_suggestion_in_words(
    image: Path, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    drafts = series((64, 25.0, 7_000), (128, 26.0, 14_000), (256, 26.5, 28_000))
    made = Suggestion(128, "photo", choose(drafts)[1], drafts, 1.0)
    monkeypatch.setattr("warpsplat.run.suggest.suggest", lambda *a, **k: made)
    with pytest.raises(SystemExit):
        main(["vectorize", str(image), "--suggest"])
    lines = capfd.readouterr().out.splitlines()
    assert lines[0] == f"{image}: 128 shapes"
    assert lines[2].endswith("+1.0 dB for 7 kB more") and lines[3].startswith("  ->   128   26.0    14.0")
    assert lines[-1].strip() == f"warpsplat vectorize {image} --curves 128 -o photo.svg"


@pytest.mark.parametrize(
    ("drafts", "curves", "words"),
    [
        (((64, 25.0, 7_000), (128, 25.3, 14_000)), 64, "Twice as many buy 0.3 dB for 7 kB more"),
        (((64, 25.0, 7_000), (128, 25.4, 14_000)), 128, "Up to 128 shapes, twice as many always"),
        (((64, 25.0, 7_000), (128, 26.0, 14_000), (256, 26.6, 28_000)), 128, "0.6 dB for 14 kB more"),
        (((64, 25.0, 7_000), (128, 24.0, 14_000)), 64, "less than 0.5 dB, about the least that can be seen"),
        (((64, float("inf"), 900), (128, float("inf"), 900)), 64, ""),
        (((7, 20.0, 900),), 7, "no room for more than 7 shapes"),
    ],
)
def test_more_shapes_than_are_worth_it_are_not_suggested(
    drafts: tuple[tuple[int, float, int], ...], curves: int, words: str
) -> None:
    chosen, why = choose(series(*drafts))
    assert chosen == curves and words in why


def test_no_number_is_suggested_for_a_drawing(tmp_path: Path, cli: Cli) -> None:
    path = tmp_path / "cells.png"
    Image.fromarray(np.kron(np.eye(8, dtype=np.uint8) * 255, np.ones((4, 4), np.uint8))).save(path)
    said = cli("vectorize", path, "--suggest").out
    assert "A piece of pixel art (2 colours in cells of 4x4 px), which is traced" in said
    assert "the picture says how many shapes there are. --subject photo fits a number of shapes" in said


def test_an_interrupted_suggestion_says_so(image: Path, cli: Cli, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("warpsplat.run.suggest.suggest", lambda *a, **k: None)
    said = cli("vectorize", image, "--suggest", "--json", code=130)
    assert json.loads(said.out) == {"error": "interrupted", "exit_code": 130}
    assert "warpsplat: interrupted" in said.err
