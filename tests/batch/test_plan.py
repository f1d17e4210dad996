"""Batch files: what is accepted, and what is refused with line and key before anything starts."""

from __future__ import annotations

import gzip
import os
from dataclasses import fields
from pathlib import Path

import pytest
from PIL import Image

import warpsplat.configs
from tests.batch.helpers import load_jobs, write
from tests.cli.helpers import Cli, run
from tests.files.test_formats import PIXELS
from tests.scenes import random_scene
from warpsplat.batch.file import MAX_FILE
from warpsplat.batch.images import ENDINGS
from warpsplat.batch.layers import KEYS, command_layer
from warpsplat.batch.results import marked_key
from warpsplat.errors import UsageError
from warpsplat.fit.settings import Settings, make_settings
from warpsplat.run.result import job_key
from warpsplat.scene import Basis, Kind
from warpsplat.svg.write import write_svg


def test_jobs(folder: Path) -> None:
    text = """
defaults: {curves: 9, open: true, output: out, device: cpu}
jobs:
  - {images: 'in/[ab].*', open: false}
  - {images: [in/**/c.png, in/broken.png], curves: 5, quality: draft, output: other}
"""
    jobs = load_jobs(write(folder, text))
    assert [(str(j.image.relative_to(folder)), str(j.output.relative_to(folder))) for j in jobs] == [
        ("in/a.png", "out/a.svg"),
        ("in/b.jpg", "out/b.jpg.svg"),
        ("in/b.png", "out/b.png.svg"),
        ("in/deep/c.png", "other/deep/c.svg"),
        ("in/broken.png", "other/broken.svg"),
    ]
    assert [j.settings.kind for j in jobs] == [Kind.FILL] * 3 + [Kind.STROKE] * 2
    assert [j.settings.curves for j in jobs] == [9, 9, 9, 5, 5]
    assert jobs[3].settings.iterations == make_settings("draft").iterations
    assert {j.device for j in jobs} == {"cpu"}


def test_every_setting_is_a_key(folder: Path) -> None:
    """Those of researchers as well, in the defaults and over them."""
    named = {name.replace("-", "_") for name in KEYS} | {"kind", "simplify"}
    assert {f.name for f in fields(Settings)} <= named
    text = """
defaults: {renderer: gaussian, xing: 0.01, order: age, through-scales: false,
  rates: {points: 0.5, colors: 0.01}, density: {interval: 400, opacity-start: 0.3}}
jobs:
  - images: in/a.png
  - {images: in/b.jpg, renderer: exact, basis: spline, density: {interval: 100}}
"""
    first, second = load_jobs(write(folder, text))
    assert (first.settings.order, first.settings.xing, first.settings.through_scales) == ("age", 0.01, False)
    assert (first.settings.rates["points"], first.settings.rates["colors"]) == (0.5, 0.01)
    assert (second.settings.renderer, second.settings.basis) == ("exact", Basis.SPLINE)
    assert (second.settings.density.interval, second.settings.density.opacity_start) == (100, 0.3)


def named(folder: Path, text: str, *images: str) -> list[str]:
    """Return the results of a batch file beside some empty images."""
    for image in images:
        (folder / image).parent.mkdir(parents=True, exist_ok=True)
        (folder / image).touch()
    return sorted(job.output.relative_to(folder).as_posix() for job in load_jobs(write(folder, text)))


def test_a_result_in_a_folder_keeps_the_folders_below_the_pattern(folder: Path) -> None:
    text = "jobs: [{images: 'icons/**/*.png', output: out}]"
    assert named(folder, text, "icons/logo.png", "icons/a/logo.png", "icons/b/x.png") == [
        *("out/a/logo.svg", "out/b/x.svg", "out/logo.svg")
    ]


def test_images_of_one_name_from_several_patterns_share_no_result(folder: Path) -> None:
    text = "jobs: [{images: [logo.png, 'icons/**/*.png'], output: out}]"
    assert named(folder, text, "logo.png", "icons/logo.png", "icons/a/logo.png") == [
        *("out/a/logo.svg", "out/icons/logo.svg", "out/logo.svg")
    ]
    text = "jobs: [{images: [photos/logo.jpg, icons/logo.png], output: out}]"
    assert named(folder, text, "photos/logo.jpg") == ["out/logo.jpg.svg", "out/logo.png.svg"]


def test_images_of_results_that_clash_are_named(folder: Path) -> None:
    text = "jobs: [{images: 'icons/**/*.png', output: 'out/{stem}.svg'}]"
    with pytest.raises(UsageError, match=r"of \S*icons/a/logo\.png and \S*icons/logo\.png; give a folder"):
        named(folder, text, "icons/logo.png", "icons/a/logo.png")


@pytest.mark.parametrize(
    ("text", "meant"),
    [
        ("jobs: [{images: in/a.png, curvs: 3}]", "curves"),
        ("jobs: [{imagess: in/a.png}]", "images"),
        ("jobs: [{images: in/a.png, density: {intervall: 3}}]", "interval"),
        ("jobs: [{images: in/a.png, rates: {pints: 3}}]", "points"),
        ("presets: {mine: {}}\njobs: [{images: in/a.png, preset: mime}]", "mine"),
    ],
)
def test_the_nearest_name_is_suggested(folder: Path, text: str, meant: str) -> None:
    with pytest.raises(UsageError, match=f"did you mean '{meant}'\\?$"):
        load_jobs(write(folder, text))


BAD = [
    ("# nothing", 1, "mapping"),
    ("- 1", 1, "mapping"),
    ("defaults: {}\n", 1, "'jobs' is missing"),
    ("jobs:\n  - curves: 3\n", 2, "'images' is missing"),
    ("jobs: []\n", 1, "at least one"),
    ("jobs:\n  - images: in/a.png\n    curvs: 3\n", 3, "curvs"),
    ("jobs:\n  - images: in/a.png\n    curves: 0\n", 3, "curves"),
    ("jobs:\n  - images: in/a.png\n    curves: '12'\n", 3, "curves"),
    ("jobs:\n  - images: in/a.png\n    curves:\n", 3, "curves"),
    ("defaults:\n  seed: true\njobs:\n  - images: in/a.png\n", 2, "seed"),
    ("defaults:\n  quality: [draft]\njobs:\n  - images: in/a.png\n", 2, "quality"),
    (
        "jobs:\n  - images: in/a.png\n    closed: true\n    open: true\n",
        2,
        "closed and open cannot be combined",
    ),
    ("jobs:\n  - images: in/a.png\n    open: maybe\n", 3, "open must be true or false"),
    ("jobs:\n  - images: in/a.png\n    output: 3\n", 3, "output"),
    ("jobs:\n  - images: in/a.png\n    importance: 3\n", 3, "importance: must be text, not 3"),
    ("jobs:\n  - images: nothing/*.png\n", 2, "nothing/*.png"),
    ("jobs:\n  - images: 7\n", 2, "images"),
    ("jobs:\n  - images: in/a.png\n    curves: 1\n    curves: 2\n", 4, "twice"),
    ("jobs:\n  - images: in/a.png\n  - images: in/a.png\n", 2, "a.svg"),
    ("jobs:\n  - images: [in/a.png\n", 3, "YAML"),
    ("jobs:\n\t- images: x\n", 2, "YAML"),
    ("jobs:\n  - images: !foo x\n", 2, "plain value"),
    ("jobs:\n  - images: in/a.png\n    curves: 2001-99-99\n", 3, "plain value"),
    ("jobs:\n  - images: in/a.png\n    curves: !!int abc\n", 3, "plain value"),
    ("jobs:\n  - images: 'in/**a/[.png'\n", 2, "[.png"),
    ("jobs:\n  - images: ~nosuchuser/a.png\n", 2, "nosuchuser"),
    ("jobs:\n  - images: in/a.png\n    output: ~nosuchuser\n", 3, "nosuchuser"),
    ("jobs:\n  - images: in/a.png\n    output: in/b.jpg\n", 3, "not a folder"),
    ("jobs:\n  - images: in/a.png\n    time-budget: soon\n", 3, "time-budget"),
    ("jobs:\n  - images: in/deep/../pic.svg\n", 2, "overwritten"),
    ("jobs: " + "[" * 2000, 1, "nested"),
    ('jobs:\n  - images: "\\U00110000"\n', 2, "YAML"),
    ('jobs:\n  - images: "in/\\0.png"\n', 2, "no name can have"),
    ('jobs:\n  - images: "in/\\ud800.png"\n', 2, "no name can have"),
    ('jobs:\n  - images: in/a.png\n    output: "\\ud800"\n', 3, "no name can have"),
    ("jobs:\n  - images: in/a.png\n    output: " + "x" * 300 + "\n", 3, "too long"),
    ("jobs:\n  - images: in/a.png\n    output: new/" + "x" * 300 + "\n", 3, "too long"),
    ("jobs:\n  - images: " + "x" * 300 + ".png\n", 2, "too long"),
    ("jobs:\n  - images: in/a.png\n    curves: &a [1, *a]\n", 3, "plain value"),
    ("jobs:\n  - images: in/a.png\n    curves: [[1, 2]]\n", 3, "one value"),
    ("jobs:\n  - images: in/a.png\n    coarse: many\n", 3, "coarse must be a number from 0 to 1"),
    ("jobs:\n  - images: in/a.png\n    rates: 3\n", 3, "rates"),
    ("jobs:\n  - images: in/a.png\n    rates:\n      points: [1]\n", 4, "rates: points"),
    ("jobs:\n  - images: in/a.png\n    density:\n      intervall: 3\n", 4, "intervall"),
    (
        "jobs:\n  - images: in/a.png\n    density:\n      interval: 0.5\n",
        4,
        "interval must be a whole number from 0 to",
    ),
    ("jobs:\n  - images: in/a.png\n    renderer: splat\n    basis: spline\n", 2, "needs the basis cubic"),
    ("? &a [*a]\n: 1\n", 1, "unknown key"),
    ("jobs:\n  - \x01\n", 2, "not allowed"),
    (
        "jobs:\n  - {images: in/a.png, preset: fine}\n",
        2,
        "there is no 'fine'; known are: brush, embroidery, ",
    ),
    ("presets: [fine]\njobs: [{images: in/a.png}]\n", 1, "presets: must be a mapping"),
    ("presets:\n  fine: {curvs: 3}\njobs: [{images: in/a.png}]\n", 2, "unknown key 'curvs' in preset 'fine'"),
    ("presets:\n  fine:\n    curves: 0\njobs: [{images: in/a.png}]\n", 3, "curves"),
    ("jobs:\n  - images: in/a.png\n    matrix: {curves: 3}\n", 3, "must be a list"),
    ("jobs:\n  - images: in/a.png\n    matrix: {curves: []}\n", 3, "must be a list"),
    ("jobs:\n  - images: in/a.png\n    matrix: {curves: [3, x]}\n", 3, "curves"),
    ("jobs:\n  - images: in/a.png\n    matrix: {rates: [3]}\n", 3, "unknown key 'rates' in matrix"),
    ("jobs:\n  - images: in/a.png\n    matrix: {curves: [3, 4]}\n", 2, "2 results would be"),
    ("jobs:\n  - images: in/a.png\n    output: '{curvs}.svg'\n", 3, "'{curvs}' is not a field"),
    ("jobs:\n  - images: in/a.png\n    output: '{.svg'\n", 3, "'{' is not a field"),
    ("jobs:\n  - images: in/a.png\n    output: '{stem}'\n", 3, "names of results end with .svg"),
    (f"jobs:\n  - images: in/a.png\n    matrix: {{curves: {[*range(1, 1002)]}}}\n", 3, "combinations"),
    # Values are shown by their beginning.
    (f"jobs:\n  - images: in/a.png\n    rates: {{points: [{5000 * 'xyz, '}]}}", 3, "points"),
    (f"jobs:\n  - images: in/a.png\n    curves: '{4000 * 'x'}'", 3, "curves"),
    (f"jobs:\n  - images: in/a.png\n    time-budget: 0x{4000 * 'f'}", 3, "time-budget"),
    (f"jobs:\n  - images: in/a.png\n    seed: 0x{4000 * 'f'}", 3, "seed"),
    (f"jobs:\n  - images: in/a.png\n    palette: ['{4000 * '#'}']", 3, "palette"),
    *(
        (f'jobs:\n  - images: in/a.png\n    {key}: "\\ud800"', 3, "")  # half a character
        for key in ("palette", "device", "importance", "size", "quality", "preset", "levels")
    ),
]


@pytest.mark.parametrize(("text", "line", "word"), BAD)
def test_errors_name_line_and_key(folder: Path, cli: Cli, text: str, line: int, word: str) -> None:
    path = write(folder, text)
    (folder / "in" / "pic.svg").touch()
    before = sorted(os.listdir(folder / "in"))
    captured = cli("batch", path, code=2)
    assert captured.err.startswith(f"warpsplat: {path}:{line}: "), captured.err
    assert word in captured.err
    assert captured.err.count("\n") == 1
    assert len(captured.err) < 1500
    assert sorted(os.listdir(folder / "in")) == before, "nothing started"


def test_the_formats_of_folders_are_read() -> None:
    Image.init()
    own = [ending for ending in ENDINGS if ending not in {".jfif", ".heic", ".heif", ".jxl"}]
    assert {Image.registered_extensions()[ending] for ending in own} <= PIXELS


def test_examples_are_valid(tmp_path: Path) -> None:
    examples = sorted(Path(p) for p in warpsplat.configs.__path__)[0]
    files = sorted(examples.glob("*.yaml"))
    assert files
    for name in ("photos/a.jpg", "photos/b.png", "more/x/c.png", "portrait.png", "kodak/a.png"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).touch()
    for file in files:
        copy = tmp_path / file.name
        copy.write_text(file.read_text())
        assert load_jobs(copy)


def test_a_batch_file_is_there_and_bounded(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="no such file"):
        load_jobs(tmp_path / "none.yaml")
    for text, words in (("", "is empty"), ("#" * (MAX_FILE + 1), "larger than 1 MiB")):
        with pytest.raises(UsageError, match=words):
            load_jobs(write(tmp_path, text))


@pytest.mark.parametrize("key", ["device: ", "rates: {points: ", "curves: ", "palette: "])
def test_aliases_do_not_multiply(folder: Path, key: str) -> None:
    """A value of a billion elements takes a line; neither building nor saying it takes a billion."""
    bomb = ["&a0 [x, x, x, x, x, x, x, x, x]"]
    bomb += [f"&a{i} [{', '.join([f'*a{i - 1}'] * 9)}]" for i in range(1, 10)]
    value = f"[{', '.join(bomb)}]" + key.count("{") * "}"
    with pytest.raises(UsageError, match=r"jobs\.yaml:3: ") as caught:
        load_jobs(write(folder, f"jobs:\n  - images: in/a.png\n    {key}{value}"))
    assert len(str(caught.value)) < 300
    with pytest.raises(UsageError, match=r"--set rates\.points="):
        command_layer({}, [f"rates.points={value.removesuffix('}')}"])


def test_aliases_that_users_write(folder: Path) -> None:
    text = """
presets:
  small: &small {curves: &few 9, rates: &rates {points: 0.5}}
jobs:
  - {images: in/a.png, curves: *few, rates: *rates, output: one}
  - images: in/a.png
    rates: {points: 0.25}
    output: two
"""
    jobs = load_jobs(write(folder, text))
    assert [job.settings.curves for job in jobs] == [9, 512]
    assert [job.settings.rates["points"] for job in jobs] == [0.5, 0.25]


def test_foreign_results_are_named_before_anything_starts(
    folder: Path, capfd: pytest.CaptureFixture[str], cli: Cli
) -> None:
    drawn = "<svg xmlns='http://www.w3.org/2000/svg'/>"
    for name in ("in/a.svg", "in/b.svg"):
        (folder / name).write_text(drawn)
    path = write(folder, "jobs: [{images: 'in/**/[abc].png', curves: 3, iterations: 3, device: cpu}]")
    said = cli("batch", path, code=2).line
    assert all(words in said for words in ("2 results", "in/a.svg", "in/b.svg", "--overwrite"))
    assert (folder / "in/a.svg").read_text() == drawn
    assert not (folder / "in/deep/c.svg").exists()
    assert run("batch", path, "--overwrite") == 0
    assert run("batch", path) == 0, "our own may be replaced"
    assert "3 skipped" in capfd.readouterr().out


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs pipes with names")
def test_a_pipe_among_the_results_is_found_before(folder: Path, cli: Cli) -> None:
    os.mkfifo(folder / "in" / "a.svg")
    assert "jobs.yaml:2: output: " in cli("batch", write(folder, "jobs:\n  - images: in/a.png\n"), code=2).err


def test_a_result_folder_that_cannot_be_written_is_found_before(
    folder: Path, cli: Cli, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object) -> None:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr("warpsplat.files.output._temporary", refuse)
    path = write(folder, "defaults:\n  output: out\njobs:\n  - images: in/a.png\n")
    (folder / "out").mkdir()
    assert "jobs.yaml:2: output: cannot write to" in cli("batch", path, code=2).err
    (folder / "out").rmdir()
    monkeypatch.setattr(os, "access", lambda *_: False)
    assert "jobs.yaml:2: output: " in cli("batch", path, code=2).err
    assert not (folder / "out").exists()


@pytest.mark.parametrize("size", [0, 700, -1])
def test_a_result_that_was_cut_short_is_not_done(folder: Path, size: int) -> None:
    job = load_jobs(write(folder, "jobs: [{images: in/a.png, curves: 9, iterations: 3, device: cpu}]"))[0]
    data = job.image.read_bytes()
    key = job_key(job.settings, data)
    whole = write_svg(random_scene(Kind.FILL, count=9, width=32, height=24), metadata=key).encode()
    assert marked_key(whole) == key
    assert job_key(job.settings, data + b" ") != key, "another image"
    assert marked_key(gzip.compress(whole)) == key
    assert not marked_key(whole[:size])
    assert not marked_key(gzip.compress(whole)[:size])
