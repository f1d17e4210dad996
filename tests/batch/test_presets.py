"""Presets: those that warpsplat brings, and files of users."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import warpsplat
from tests.batch.helpers import load_jobs, write
from tests.cli.helpers import Cli, run
from warpsplat.batch.presets import FOLDER, load_preset, preset_names, with_preset
from warpsplat.errors import UsageError
from warpsplat.fit.settings import make_settings
from warpsplat.scene import Basis, Kind

STYLES = ["brush", "ink", "low-poly", "placeholder", "poster", "stained-glass"]
MACHINES = ["embroidery", "laser-cut", "laser-engrave", "plotter", "stencil", "vinyl"]


def test_those_that_there_are() -> None:
    assert preset_names() == sorted(STYLES + MACHINES)
    for name in preset_names():
        make_settings(**load_preset(name))
        assert (FOLDER / f"{name}.yaml").read_text("utf-8").startswith("# "), "says what it is for"


@pytest.mark.parametrize("name", MACHINES)
def test_those_for_machines_make_outlines_of_a_known_size(name: str, tmp_path: Path) -> None:
    pixels = np.full((40, 60, 3), 255, np.uint8)
    pixels[10:30, 15:45] = (0, 0, 0)
    made = warpsplat.vectorize(pixels, preset=name, quality="draft", device="cpu")
    assert made.subject == make_settings(**load_preset(name)).subject != "photo"
    assert 'mm" height="' in made.svg[:200]
    made.save(tmp_path / "a.eps")


def test_options_beside_a_preset_count_more() -> None:
    settings = make_settings(**with_preset("brush", {"curves": 12, "closed": None, "quality": None}))
    assert settings.curves == 12 and settings.kind == Kind.STROKE and settings.spline_points == 5
    closed = make_settings(**with_preset("brush", {"closed": True}))
    assert closed.kind == Kind.FILL


def test_the_command_line(image: Path, tmp_path: Path, cli: Cli) -> None:
    """A name, and a file with a setting that only files have."""
    quick = ("--iterations", "12", "--device", "cpu", "--curves", "6", "-q")
    assert run("vectorize", image, "-o", tmp_path / "a.svg", "--preset", "low-poly", *quick) == 0
    assert (tmp_path / "a.svg").read_text("utf-8").count("<polygon") == 6
    own = tmp_path / "mine.yaml"
    own.write_text("shape: circle\ncurves: 99\ndensity: {surplus: 1}\n", "utf-8")
    assert run("vectorize", image, "-o", tmp_path / "b.svg", "--preset", own, *quick) == 0
    assert (tmp_path / "b.svg").read_text("utf-8").count("<circle") == 6
    assert run("batch", image, "-o", tmp_path / "e.svg", "--preset", own, "--shape", "triangle", *quick) == 0
    assert (tmp_path / "e.svg").read_text("utf-8").count("<polygon") == 6
    said = cli("vectorize", image, "-o", tmp_path / "c.svg", "--preset", "nothing", *quick, code=2).line
    assert "known are: brush, embroidery" in said
    own.write_text("shape: circle\ncurve: 99\n", "utf-8")
    said = cli("vectorize", image, "-o", tmp_path / "d.svg", "--preset", own, *quick, code=2).line
    assert "mine.yaml:2: unknown key 'curve'" in said


def test_batch_files_know_them(folder: Path) -> None:
    """A batch file's own presets come first."""
    jobs = load_jobs(
        write(
            folder,
            "presets: {ink: {curves: 3}}\njobs:\n"
            "  - {images: in/a.png, preset: ink}\n  - {images: in/b.jpg, preset: low-poly, curves: 7}\n",
        )
    )
    assert [job.settings.curves for job in jobs] == [3, 7]
    assert [job.settings.shape for job in jobs] == ["curve", "triangle"]
    with pytest.raises(UsageError, match="there is no 'oil'; known are: ink, brush, embroidery"):
        load_jobs(write(folder, "presets: {ink: {curves: 3}}\njobs: [{images: in/a.png, preset: oil}]"))


def test_options_over_a_preset_from_python() -> None:
    """As on the command line."""
    pixels = np.random.default_rng(0).integers(0, 255, (24, 32, 3), dtype=np.uint8)
    result = warpsplat.vectorize(pixels, preset="low-poly", curves=5, iterations=2, device="cpu")
    assert len(result.scene) == 5
    assert all(basis == Basis.POLYGON for basis in result.scene.basis)
    for call in (warpsplat.load_preset, lambda name: warpsplat.vectorize(pixels, preset=name)):
        with pytest.raises(UsageError, match="there is no preset 'oil'"):
            call("oil")
    with pytest.raises(UsageError, match="settings are given, and preset as well"):
        warpsplat.vectorize(pixels, preset="ink", settings=warpsplat.make_settings())
    both = warpsplat.vectorize_several(pixels, [3, 5], preset="low-poly", iterations=2, device="cpu")
    assert [len(one.scene) for one in both] == [3, 5]
