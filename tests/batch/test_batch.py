"""Runs of batches: made, skipped, failed, goals."""

from __future__ import annotations

import json
import os
import shutil
import signal
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from tests.batch.helpers import Answers, answers, load_jobs, write
from tests.cli.helpers import Cli, one_line, run
from warpsplat.batch.display import BatchDisplay
from warpsplat.batch.manifest import NAME, Manifest, entry_of
from warpsplat.batch.run import JobOutcome


def test_a_run_reports_skips_and_redoes(folder: Path, cli: Cli, batch: Answers) -> None:
    text = "defaults: {curves: 4, iterations: 6, device: cpu, output: out}\njobs: [{images: in/*.png}]\n"
    path = write(folder, text)
    captured = cli("batch", path, code=5)
    assert "3 images: 2 made, 0 skipped, 1 failed" in captured.out
    assert "broken.png: not an image" in captured.err
    assert sorted(os.listdir(folder / "out")) == ["a.svg", "b.svg", NAME]
    made = [entry_of(line) for line in (folder / "out" / NAME).read_bytes().splitlines()]
    psnr = [entry.figures["psnr"] for entry in made if entry and entry.event == "made"]
    times = {p: p.stat().st_mtime_ns for p in (folder / "out").iterdir()}

    images, values = batch("batch", path, code=5)
    assert (values["made"], values["skipped"], values["failed"]) == (0, 2, 1)
    assert [r["psnr"] for r in images if r["status"] == "skipped"] == psnr, "figures of what was made before"
    assert times == {p: p.stat().st_mtime_ns for p in (folder / "out").iterdir()}

    noise = np.random.default_rng(9).integers(0, 255, (24, 32, 3), dtype=np.uint8)
    Image.fromarray(noise).save(folder / "in" / "a.png")
    (folder / "in" / "broken.png").unlink()
    assert batch("batch", path)[1]["made"] == 1

    write(folder, text.replace("curves: 4", "curves: 5"))
    assert cli("batch", path, "-q") == ("", "")
    assert all((folder / "out" / n).read_text().count("<path") == 5 for n in ("a.svg", "b.svg"))


@pytest.mark.parametrize("as_json", [False, True])
def test_an_interrupted_run_counts_what_is_left(
    folder: Path, cli: Cli, monkeypatch: pytest.MonkeyPatch, as_json: bool
) -> None:
    for i in range(5):
        shutil.copy(folder / "in" / "a.png", folder / "in" / f"more{i}.png")
    usual = BatchDisplay.add

    def interrupting(display: BatchDisplay, report: JobOutcome) -> None:
        usual(display, report)
        signal.raise_signal(signal.SIGINT)

    monkeypatch.setattr(BatchDisplay, "add", interrupting)
    settings = ("--curves", 4, "--iterations", 6, "--device", "cpu", "--workers", 1)
    arguments = ("batch", folder / "in", "-o", folder / "out", *settings, *(["--json"] if as_json else []))
    captured = cli(*arguments, code=130)
    assert one_line(captured.err) == "warpsplat: interrupted; the same command goes on with the rest"
    if as_json:
        (image,), values = answers(captured.out)
        assert image["status"] == "made"
        assert (values["images"], values["made"], values["not_started"]) == (9, 1, 8)
    else:
        assert "\n9 images: 1 made, 0 skipped, 0 failed, 8 not started (" in captured.out
    monkeypatch.undo()
    out, err = cli(*arguments, code=5)
    assert "not started" not in out and "not_started" not in out and "goes on" not in err


def test_a_stopped_result_is_made_again(folder: Path, batch: Answers) -> None:
    path = write(folder, "jobs: [{images: in/a.png, curves: 30, iterations: 5, device: cpu}]")
    assert run("batch", path, "-q") == 0
    output = load_jobs(path)[0].output
    svg = output.read_text()
    for made in (0, 1):
        assert batch("batch", path)[1]["made"] == made
        assert output.read_text() == svg
        output.write_text(svg[: svg.index("<!--")] + "<!--warpsplat stopped" + svg[svg.index("-->") :])


class PanicException(BaseException):
    pass


def test_any_exception_fails_only_its_image(folder: Path, monkeypatch: pytest.MonkeyPatch, cli: Cli) -> None:
    """Even what is no ``Exception``."""
    words = "renderer gave up: index out of bounds"

    def load(data: object, name: str, *, paper: object, factor: int) -> np.ndarray:
        if name.endswith("a.png"):
            raise PanicException("index out of bounds")
        return np.full((24, 32, 3), 0.5, np.float32)

    monkeypatch.setattr("warpsplat.run.prepare.image_of", load)
    text = "jobs: [{images: 'in/[ab].png', curves: 3, iterations: 3, output: out, device: cpu}]"
    captured = cli("batch", write(folder, text), "--json", code=5)
    images, _ = answers(captured.out)
    assert [r["status"] for r in images] == ["failed", "made"]
    assert "a.png" in images[0]["error"] and words in images[0]["error"] and words in captured.err


def test_a_line_break_in_a_name_breaks_no_line(folder: Path, cli: Cli) -> None:
    path = write(folder, 'jobs: [{images: "in/\\nx.png", device: cpu}]\n')
    said = cli("batch", path, code=5).err
    assert said.splitlines() == [
        "[1/1] failed: in/\\nx.png: no such file".replace("in/", f"{folder}/in/"),
        "failed:",
        f"  {folder}/in/\\nx.png",
    ]


def test_a_changed_mask_makes_the_image_again(folder: Path, cli: Cli, batch: Answers) -> None:
    """By its content; one that is missing or of other proportions is the failure of its image."""
    (folder / "masks").mkdir()
    mask = folder / "masks" / "face.png"
    Image.new("L", (64, 48), "white").save(mask)
    text = "jobs: [{images: in/a.png, curves: 4, iterations: 6, device: cpu, importance: masks/face.png}]"
    path = write(folder, text)
    for made in (1, 0):
        assert batch("batch", path)[1]["made"] == made
    assert load_jobs(write(folder, text.replace(", importance: masks/face.png", "")))[0].output.exists()
    assert batch("batch", folder / "jobs.yaml")[1]["made"] == 1, "without it"
    write(folder, text)
    half = Image.new("L", (64, 48), "white")
    half.paste("black", (0, 0, 32, 48))
    half.save(mask)
    assert batch("batch", path)[1]["made"] == 1
    for break_it, cause in (
        (lambda: half.resize((48, 48)).save(mask), "48x48 pixels"),
        (mask.unlink, "no such file"),
    ):
        break_it()
        message = cli("batch", path, code=5).err
        assert f"{folder / 'in' / 'a.png'}: {mask}: {cause}" in message


SMALL = ("--curves", "3", "--iterations", "3", "--device", "cpu")


def test_minified_results_are_known_by_the_manifest(
    folder: Path, capfd: pytest.CaptureFixture[str], batch: Answers
) -> None:
    """Also where a run was killed after the file was there and before that was noted."""
    arguments = ("batch", folder / "in" / "a.png", folder / "in" / "b.png", "-o", folder / "out", *SMALL)
    assert run(*arguments, "--minify", "--curves", "40") == 0
    svgs = {path: path.read_bytes() for path in (folder / "out").glob("*.svg")}
    assert len(svgs) == 2
    assert not any(b"warpsplat" in data for data in svgs.values())
    notes = folder / "out" / NAME
    lines = notes.read_bytes().splitlines(keepends=True)
    assert [json.loads(line)["event"] for line in lines] == ["writing", "made"] * 2
    notes.write_bytes(b"".join(lines[:3]))
    capfd.readouterr()
    images, totals = batch(*arguments, "--minify", "--curves", "40")
    assert (totals["skipped"], totals["made"]) == (2, 0)
    assert all(image["psnr"] > 5 for image in images)
    assert svgs == {path: path.read_bytes() for path in (folder / "out").glob("*.svg")}
    notes.unlink()
    assert run(*arguments, "--minify", "--curves", "40") == 2, "without it, they may be anybody's"
    assert "--overwrite" in capfd.readouterr().err


def test_without_a_manifest_figures_are_those_of_the_files(folder: Path, batch: Answers) -> None:
    arguments = ("batch", folder / "in" / "a.png", "-o", folder / "out", *SMALL, "--json")
    (made,), _ = batch(*arguments, "--curves", "30")
    (folder / "out" / NAME).unlink()
    for _ in range(2):  # then they are noted
        (found,), _ = batch(*arguments, "--curves", "30")
        assert found["status"] == "skipped"
        assert (found["psnr"], found["bytes"]) == (made["psnr"], made["bytes"])


def test_failures_are_tried_again_when_asked_or_changed(
    folder: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    broken = folder / "in" / "broken.png"
    arguments = ("batch", broken, "-o", folder / "out", *SMALL, "--json")

    def tried(*more: str, code: int = 5) -> bool:
        assert run(*arguments, *more) == code
        (image,), _ = answers(capfd.readouterr().out)
        return not image.get("before", False)

    assert tried()
    assert not tried()
    assert tried("--retry-failed")
    assert not tried()
    assert tried("--seed", "7"), "other settings"
    broken.write_bytes(b"something else")
    assert tried()
    broken.write_bytes((folder / "in" / "a.png").read_bytes())
    assert tried(code=0)


def test_a_dry_run_writes_nothing(folder: Path, cli: Cli) -> None:
    path = write(folder, "jobs: [{images: 'in/*.png', output: out, curves: 3, iterations: 3, device: cpu}]")
    said = cli("batch", path, "--dry-run").out
    assert f"{folder / 'out' / 'a.svg'}: would be made of {folder / 'in' / 'a.png'}" in said
    assert not (folder / "out").exists()
    assert run("batch", path, "-q") == 5
    before = {p: p.read_bytes() for p in (folder / "out").iterdir()}
    captured = cli("batch", path, "--dry-run", "--set", "seed=0", code=5)
    assert "already made with these settings" in captured.out
    assert "broken.png: not an image" in captured.err
    assert {p: p.read_bytes() for p in (folder / "out").iterdir()} == before


def test_several_images_of_vectorize(folder: Path, cli: Cli, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(folder)
    mask = ("--importance", "in/deep/c.png")
    assert run("vectorize", "in/a.png", "in/b.png", "-o", "out/", *mask, *SMALL) == 0
    assert sorted(os.listdir("out")) == ["a.svg", "b.svg", NAME]
    for more, words in (
        (("-o", "x.svg"), "x.svg: is not a folder"),
        (("-o", "-"), "standard output"),
        (("-",), "standard input"),
        (("--data-uri",), "one image"),
    ):
        said = cli("vectorize", "in/a.png", "in/b.png", *more, code=2).err
        assert words in said
        assert said.count("\n") == 1
    assert run("vectorize", "in/a.png", "in/broken.png", *SMALL) == 5
    assert Path("a.svg").exists()


def test_images_that_another_process_works_on_are_waited_for(
    folder: Path, batch: Answers, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It is done elsewhere in the end, or, if that process dies, here; other images need not wait."""
    asked: list[str] = []
    claim = Manifest.claim

    def reluctant(notes: Manifest, output: Path, key: str) -> bool:
        asked.append(output.name)
        return claim(notes, output, key) if asked.count(output.name) > 2 or output.name == "b.svg" else False

    monkeypatch.setattr(Manifest, "claim", reluctant)
    images, _ = batch("batch", folder / "in" / "a.png", folder / "in" / "b.png", *SMALL)
    made = [(Path(image["output"]).name, image["status"]) for image in images]
    assert made == [("b.svg", "made"), ("a.svg", "made")]
    assert asked == ["a.svg", "b.svg", "a.svg", "a.svg"]


@pytest.mark.slow
@pytest.mark.usual_seed
def test_processes_make_the_same_files(folder: Path, batch: Answers) -> None:
    images = [str(folder / "in" / name) for name in ("a.png", "b.png", "broken.png", "b.jpg")]
    for workers in ("1", "2"):
        images_said, totals = batch(
            "batch", *images, "-o", folder / workers, *SMALL, "--workers", workers, code=5
        )
        assert (totals["made"], totals["failed"], totals["workers"]) == (3, 1, int(workers))
        assert len({image["image"] for image in images_said}) == 4
    first, second = ({p.name: p.read_bytes() for p in (folder / w).glob("*.svg")} for w in ("1", "2"))
    assert first == second
