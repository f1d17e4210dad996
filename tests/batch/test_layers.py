"""Defaults, presets, jobs, matrices and the command line: which is stronger, and what results are called."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import warpsplat
from tests.batch.helpers import load_jobs, write
from tests.cli.helpers import Cli, run
from warpsplat.batch.layers import assigned, command_layer
from warpsplat.batch.plan import BatchJob, home_of, in_shard, plan_jobs
from warpsplat.batch.presets import FOLDER, load_preset, preset_names, with_preset
from warpsplat.errors import UsageError
from warpsplat.fit.settings import make_settings
from warpsplat.scene import Basis, Kind


def names(jobs: list[BatchJob], folder: Path) -> list[str]:
    return [job.output.relative_to(folder).as_posix() for job in jobs]


LAYERS = """
defaults: {curves: 1, seed: 1, iterations: 1, precision: 1, open: true, rates: {points: 0.1, colors: 0.1}}
presets:
  fine: {curves: 2, seed: 2, iterations: 2, rates: {points: 0.2}}
jobs:
  - images: in/a.png
    preset: fine
    curves: 3
    seed: 3
  - images: in/b.png
"""


def test_the_command_line_is_stronger_than_the_job_than_the_preset_than_the_defaults(folder: Path) -> None:
    command = command_layer({"curves": 4, "closed": True, "seed": None}, ["rates.colors=0.4"])
    first, second = (job.settings for job in load_jobs(write(folder, LAYERS), command))
    assert (first.curves, first.seed, first.iterations, first.precision) == (4, 3, 2, 1)
    assert (second.curves, second.seed, second.iterations, second.precision) == (4, 1, 1, 1)
    assert first.kind == second.kind == Kind.FILL
    assert [(s.rates["points"], s.rates["colors"]) for s in (first, second)] == [(0.2, 0.4), (0.1, 0.4)]


def test_a_matrix_is_a_product(folder: Path) -> None:
    text = """
jobs:
  - images: in/[ab].png
    seed: 5
    matrix: {curves: [2, 3], quality: [draft, high]}
    output: out/{quality}/{stem}-{curves}-{seed}.svg
"""
    jobs = load_jobs(write(folder, text))
    assert len(jobs) == 8
    assert names(jobs, folder)[:3] == ["out/draft/a-2-5.svg", "out/draft/b-2-5.svg", "out/high/a-2-5.svg"]
    assert {(j.settings.curves, j.settings.iterations) for j in jobs} == {
        (2, 200),
        (2, 4000),
        (3, 200),
        (3, 4000),
    }
    assert home_of(jobs, ["jobs.yaml"]) == folder / "out"
    jobs = load_jobs(folder / "jobs.yaml", command_layer({"curves": 9}, ()))
    assert len(jobs) == 4, "what the command line says is no axis"
    assert {job.settings.curves for job in jobs} == {9}


def test_a_job_is_stronger_than_a_matrix_of_the_defaults(folder: Path) -> None:
    text = """
defaults: {matrix: {curves: [2, 3]}, output: "{stem}-{curves}.svgz"}
jobs: [{images: in/a.png}, {images: in/b.png, curves: 7}]
"""
    assert names(load_jobs(write(folder, text)), folder) == ["a-2.svgz", "a-3.svgz", "b-7.svgz"]


@pytest.mark.parametrize(
    ("output", "made"),
    [
        ("out", "out/deep/c.svg"),
        ("x.svg", "x.svg"),
        ("{folder}/{name}.svg", "deep/c.png.svg"),
        ("{preset}-{kind}-{renderer}.svg", "p-closed-exact.svg"),
        ("{title}-{{x}}.SVG", "a_b-{x}.SVG"),
        ("{spline-points}-{level-weight}.svg", "12-0.3.svg"),
    ],
)
def test_names_of_results(folder: Path, output: str, made: str) -> None:
    text = f"presets: {{p: {{title: a/b}}}}\njobs: [{{images: in/**/c.png, preset: p, output: '{output}'}}]"
    assert names(load_jobs(write(folder, text)), folder) == [made]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("curves", "must be KEY=VALUE"),
        ("curvs=3", "unknown key 'curvs'"),
        ("rates=3", "unknown key 'rates'"),
        ("rates.pints=3", "unknown key 'rates.pints'"),
        ("curves.x=3", "unknown key 'curves.x'"),
        ("dry-run=true", "unknown key 'dry-run'"),
        ("curves=0", "--set curves=0: "),
        ("curves=[", "is not plain YAML"),
        ("curves=", "has no value"),
        ("rates.points=x", "rates"),
        ("curves=!!python/object:os.system x", "is not plain YAML"),
    ],
)
def test_invalid_set_options_are_refused(text: str, words: str) -> None:
    with pytest.raises(UsageError) as caught:
        command_layer({}, [text])
    assert words in str(caught.value)
    assert text in str(caught.value)


def test_values_of_set_options() -> None:
    assert assigned("curves=12") == ("curves", 12)
    assert assigned("output=007") == ("output", "007")
    assert assigned("density.interval=9") == ("density", {"interval": 9})
    layer = command_layer({}, ["rates.points=1", "rates.colors=2"])
    assert layer["rates"].value == {"points": 1, "colors": 2}
    for flags, sets in (({"curves": 3}, ["curves=4"]), ({}, ["rates.points=1", "rates.points=2"])):
        with pytest.raises(UsageError, match="given twice"):
            command_layer(flags, sets)


def test_inputs_of_the_command_line(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write(folder, "jobs: [{images: in/deep/c.png, output: out}]")
    monkeypatch.chdir(folder)
    jobs = plan_jobs(["in", "in/*.png", "jobs.yaml", "in/none.png"], command_layer({"curves": 3}, ()))
    assert [(str(job.image), str(job.output)) for job in jobs] == [
        ("in/deep/c.png", "out/c.svg"),
        ("in/a.png", "in/a.svg"),
        ("in/b.jpg", "in/b.jpg.svg"),
        ("in/b.png", "in/b.png.svg"),
        ("in/broken.png", "in/broken.svg"),
        ("in/none.png", "in/none.svg"),
    ]
    assert {job.settings.curves for job in jobs} == {3}
    (folder / "empty").mkdir()
    for name, words in (("empty", "no images"), ("in/*.gif", "nothing matches")):
        with pytest.raises(UsageError, match=words):
            plan_jobs([name])


def test_the_place_of_the_manifest(folder: Path) -> None:
    """With the results; of several folders of them, in the one that holds all, or with the batch file."""
    path = str(folder / "jobs.yaml")
    for outputs, home in (
        (("out", "out"), folder / "out"),
        (("out", "out/{curves}/{stem}.svg"), folder / "out"),
        (("out/x", "out/y"), folder),
        (("out/x", "/elsewhere/{stem}.svg"), folder),
    ):
        jobs = [f"{{images: in/{n}.png, output: '{out}'}}" for n, out in zip("ab", outputs, strict=True)]
        write(folder, f"jobs: [{', '.join(jobs)}]")
        assert home_of(load_jobs(Path(path)), [path]) == home
        assert home_of(load_jobs(Path(path)), [path, "x.png"]) == (Path() if home == folder else home)


def test_shards_are_parts_whatever_the_list(folder: Path) -> None:
    """Each image is in one, and in the same one where others are missing."""
    jobs = load_jobs(write(folder, "jobs: [{images: in/**/*.*, output: out}]"))
    parts = [{job.image for job in jobs if in_shard(job, folder / "out", i, 3)} for i in (1, 2, 3)]
    assert sorted(path for part in parts for path in part) == sorted(job.image for job in jobs)
    assert max(map(len, parts)) < len(jobs)
    fewer = load_jobs(write(folder, "jobs: [{images: in/*.png, output: out}]"))
    for job in fewer[:2]:
        if job.output in {other.output for other in jobs}:
            assert [in_shard(job, folder / "out", i, 3) for i in (1, 2, 3)] == [job.image in p for p in parts]


@pytest.mark.parametrize("text", ["0/3", "4/3", "1", "a/b", "-1/3"])
def test_invalid_shards_are_refused(folder: Path, cli: Cli, text: str) -> None:
    assert "is not of the form I/N" in cli("batch", folder / "in", "--shard", text, code=2).err


STYLES = ["brush", "ink", "low-poly", "placeholder", "poster", "stained-glass"]
MACHINES = ["embroidery", "laser-cut", "laser-engrave", "plotter", "stencil", "vinyl"]


def test_all_presets_are_valid_and_described() -> None:
    assert preset_names() == sorted(STYLES + MACHINES)
    for name in preset_names():
        make_settings(**load_preset(name))
        assert (FOLDER / f"{name}.yaml").read_text("utf-8").startswith("# "), "says what it is for"


@pytest.mark.parametrize("name", MACHINES)
def test_presets_for_machines_make_outlines_of_a_known_size(name: str, tmp_path: Path) -> None:
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
    own.write_text("report: pages\n", "utf-8")
    said = cli("vectorize", image, "-o", tmp_path / "d.svg", "--preset", own, *quick, code=2).line
    assert "mine.yaml:1: unknown key 'report'" in said and "option of the command line, --report" in said


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
