"""Images and SVGs behind URLs: fsspec's file system in memory stands for a store."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import pytest

import warpsplat
from tests.cli.helpers import QUICK, Cli, run
from tests.files.memory_store import png, store  # noqa: F401
from tests.fuzz.corpus import own_svg

URL = "https://example.org/a.png"

COMMANDS = [
    (URL,),
    ("vectorize", URL),
    ("vectorize", "a.png", "--importance", URL),
    ("refine", "a.svg", URL, "-o", "b.svg"),
    ("refine", URL, "a.png", "-o", "b.svg"),
    ("eval", URL, "a.svg"),
    ("eval", "a.png", URL),
    ("render", URL, "-o", "b.png"),
    ("compare", URL, "--against", "vtracer"),
    ("batch", URL),
]


@pytest.fixture
def without_package(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setitem(sys.modules, "upath", None)
    monkeypatch.chdir(tmp_path)
    Path("a.png").write_bytes(png(0))
    Path("a.svg").write_bytes(own_svg("fill"))


MESSAGE = f"{URL}: URLs need: pip install 'warpsplat[remote]'"


@pytest.mark.usefixtures("without_package")
@pytest.mark.parametrize("words", COMMANDS, ids=" ".join)
def test_commands_name_the_extra(words: tuple[str, ...], cli: Cli) -> None:
    assert MESSAGE in cli(*words, code=2).err.splitlines()[-1]


def test_commands_read_urls(store: Any, cli: Cli) -> None:  # noqa: F811
    store.pipe_file("/bucket/in/drawing.svg", own_svg("fill"))
    image, svg = "memory://bucket/in/a.png", "memory://bucket/in/drawing.svg"
    assert cli("vectorize", image, *QUICK, "--importance", image, "--json").values["image"] == image
    assert Path("a.svg").exists(), "in the current folder"
    assert run("refine", svg, image, "-o", "b.svg", "--iterations", 2, "--device", "cpu") == 0
    assert run("eval", image, svg, "--report", "eval.html") == 0
    assert run("render", svg, "-o", "b.png") == 0
    assert all(Path(name).exists() for name in ("b.svg", "eval.html", "b.png"))
    assert warpsplat.load_image(image).shape == (24, 32, 3)


@pytest.mark.usefixtures("store")
@pytest.mark.parametrize("option", ["-o", "--checkpoint", "--report", "--animate"])
def test_single_results_stay_here(option: str, cli: Cli) -> None:
    said = cli("vectorize", "memory://bucket/in/a.png", option, "s3://bucket/a.svg", code=2).line
    assert "s3://bucket/a.svg: only warpsplat batch writes to URLs" in said


def test_a_result_is_saved_to_a_url(store: Any) -> None:  # noqa: F811
    scene = warpsplat.load_svg(own_svg("fill"))
    warpsplat.save_svg(scene, "memory://bucket/out/a.svg")
    assert store.cat_file("/bucket/out/a.svg").startswith(b"<svg")
