"""What a run of a batch does: made, skipped, failed, goals."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from tests.cli.helpers import run
from tests.jobs.helpers import answers, write
from warpsplat.jobs.batch.manifest import NAME, entry_of
from warpsplat.jobs.batch.plan import load_jobs


def test_a_run_reports_skips_and_redoes(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = "defaults: {curves: 4, iterations: 6, device: cpu, output: out}\njobs: [{images: in/*.png}]\n"
    path = write(folder, text)
    assert run("batch", path) == 5
    captured = capsys.readouterr()
    assert "3 images: 2 made, 0 skipped, 1 failed" in captured.out
    assert "broken.png: not an image" in captured.err
    assert sorted(os.listdir(folder / "out")) == ["a.svg", "b.svg", NAME]
    made = [entry_of(line) for line in (folder / "out" / NAME).read_bytes().splitlines()]
    psnr = [entry.figures["psnr"] for entry in made if entry and entry.event == "made"]
    times = {p: p.stat().st_mtime_ns for p in (folder / "out").iterdir()}

    assert run("batch", path, "--json") == 5
    images, values = answers(capsys.readouterr().out)
    assert (values["made"], values["skipped"], values["failed"]) == (0, 2, 1)
    assert [r["psnr"] for r in images if r["status"] == "skipped"] == psnr, "figures of what was made before"
    assert times == {p: p.stat().st_mtime_ns for p in (folder / "out").iterdir()}

    noise = np.random.default_rng(9).integers(0, 255, (24, 32, 3), dtype=np.uint8)
    Image.fromarray(noise).save(folder / "in" / "a.png")  # another image under the old name
    (folder / "in" / "broken.png").unlink()
    assert run("batch", path, "--json") == 0
    assert answers(capsys.readouterr().out)[1]["made"] == 1

    write(folder, text.replace("curves: 4", "curves: 5"))
    assert run("batch", path, "-q") == 0
    assert capsys.readouterr() == ("", "")
    assert all((folder / "out" / n).read_text().count("<path") == 5 for n in ("a.svg", "b.svg"))


def test_a_stopped_result_is_made_again(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = write(folder, "jobs: [{images: in/a.png, curves: 30, iterations: 5, device: cpu}]")
    assert run("batch", path, "-q") == 0
    output = load_jobs(path)[0].output
    svg = output.read_text()
    for made in (0, 1):
        assert run("batch", path, "--json") == 0
        assert answers(capsys.readouterr().out)[1]["made"] == made
        assert output.read_text() == svg
        output.write_text(svg[: svg.index("<!--")] + "<!--warpsplat stopped" + svg[svg.index("-->") :])


def test_missed_goals_have_their_exit_code(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = "jobs: [{images: in/a.png, curves: 3, iterations: 3, target-psnr: 90, output: out, device: cpu}]"
    assert run("batch", write(folder, text)) == 6
    assert "goal missed: target-psnr 90 dB" in capsys.readouterr().err
    assert (folder / "out/a.svg").exists()


class PanicException(BaseException):
    pass


FAILURES: list[tuple[BaseException, str]] = [
    (MemoryError(), "not enough memory"),
    (RuntimeError("Failed to allocate 99 bytes on device 'cpu'"), "not enough memory: Failed to allocate 99"),
    (PanicException("index out of bounds"), "renderer gave up: index out of bounds"),
    (RecursionError("too deep"), "internal error: RecursionError: too deep"),
    (OSError(28, "No space left on device", "/x"), "/x: No space left"),
]


@pytest.mark.parametrize(("error", "words"), FAILURES)
def test_whatever_an_image_throws_is_its_own_failure(
    folder: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    error: BaseException,
    words: str,
) -> None:
    def load(data: bytes, name: str, *, paper: object) -> np.ndarray:
        if name.endswith("a.png"):
            raise error
        return np.full((24, 32, 3), 0.5, np.float32)

    monkeypatch.setattr("warpsplat.files.sources.load_image", load)
    text = "jobs: [{images: 'in/[ab].png', curves: 3, iterations: 3, output: out, device: cpu}]"
    assert run("batch", write(folder, text), "--json") == 5
    captured = capsys.readouterr()
    images, _ = answers(captured.out)
    assert [r["status"] for r in images] == ["failed", "made"]
    assert words in images[0]["error"]
    assert "a.png" in images[0]["error"]
    assert words in captured.err


def test_a_line_break_in_a_name_breaks_no_line(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = write(folder, 'jobs: [{images: "in/\\nx.png", device: cpu}]\n')
    assert run("batch", path) == 5
    assert capsys.readouterr().err.splitlines() == [
        "[1/1] failed: in/\\nx.png: no such file".replace("in/", f"{folder}/in/"),
        "failed:",
        f"  {folder}/in/\\nx.png: no such file",
    ]


def test_another_mask_makes_another_result(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """By its content; one that is missing or of other proportions is the failure of its image."""
    (folder / "masks").mkdir()
    mask = folder / "masks" / "face.png"
    Image.new("L", (64, 48), "white").save(mask)
    text = "jobs: [{images: in/a.png, curves: 4, iterations: 6, device: cpu, importance: masks/face.png}]"
    path = write(folder, text)
    for made in (1, 0):
        assert run("batch", path, "--json") == 0
        assert answers(capsys.readouterr().out)[1]["made"] == made
    assert load_jobs(write(folder, text.replace(", importance: masks/face.png", "")))[0].output.exists()
    assert run("batch", folder / "jobs.yaml", "--json") == 0
    assert answers(capsys.readouterr().out)[1]["made"] == 1, "without it"
    write(folder, text)
    half = Image.new("L", (64, 48), "white")
    half.paste("black", (0, 0, 32, 48))
    half.save(mask)
    assert run("batch", path, "--json") == 0
    assert answers(capsys.readouterr().out)[1]["made"] == 1
    for break_it, cause in (
        (lambda: half.resize((48, 48)).save(mask), "48x48 pixels"),
        (mask.unlink, "no such file"),
    ):
        break_it()
        assert run("batch", path) == 5
        message = capsys.readouterr().err
        assert f"{folder / 'in' / 'a.png'}: {mask}: {cause}" in message


def test_a_mask_is_text(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = write(folder, "jobs:\n  - images: in/a.png\n    importance: 3\n")
    assert run("batch", path) == 2
    assert f"{path}:3: importance: must be text, not 3" in capsys.readouterr().err
