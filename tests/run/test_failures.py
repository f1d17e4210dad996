"""A device that fails in the middle of a run: the shapes that are left make the file, as the error says."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from PIL import Image

import warpsplat
from tests import fake_cuda
from tests.cli.helpers import one_line
from tests.fit.pictures import picture
from tests.run.helpers import CLEAR, PICTURE, Make, fitted, refined
from warpsplat.errors import DeviceError, ExitCode
from warpsplat.fit.step import Step
from warpsplat.rendering import device
from warpsplat.rendering.parameters import Parameters
from warpsplat.rendering.program import Program
from warpsplat.run.result import STOPPED
from warpsplat.svg.write import read_metadata

Fail = Callable[..., None]


RUNS: dict[str, Make] = {
    "open": lambda **given: fitted(open=True, **given),
    "paint": lambda **given: fitted(paint="auto", **given),
    "layered": lambda **given: fitted(curves=None, levels=(4, 12), **given),
    "transparent": lambda **given: fitted(image=CLEAR, **given),
    "target": lambda **given: fitted(target_psnr=20.0, **given),
    "refined": refined,
}


@pytest.fixture
def fail(monkeypatch: pytest.MonkeyPatch) -> Fail:
    """Make the device fail after some steps: with ``keeps`` its memory can still be read."""
    monkeypatch.setattr(device, "_failed", {})

    def after(steps: int, *, keeps: bool = False) -> None:
        done, error = [0], "Warp CUDA error 719: unspecified launch failure (in function f)"

        def refused(*_: Any, **__: Any) -> None:
            raise RuntimeError(f"Warp copy error: {error}")

        def advance(step: Step) -> None:
            if done[0] == steps:
                monkeypatch.setattr(Program, "run", refused)
                if not keeps:
                    monkeypatch.setattr(Parameters, "_download", refused)
                raise RuntimeError(f"Graph launch error: {error}")
            done[0] += 1
            make_step(step)

        make_step = Step.advance
        monkeypatch.setattr(Step, "advance", advance)

    return after


@pytest.mark.parametrize("name", RUNS)
def test_the_shapes_read_back_last_make_the_file(name: str, fail: Fail, tmp_path: Path) -> None:
    fail(52)
    output = tmp_path / "out.svg"
    with pytest.raises(DeviceError, match=r"failed: unspecified launch failure .CUDA error 719.") as caught:
        RUNS[name](output=output)
    assert caught.value.exit_code == ExitCode.RESOURCES
    made = caught.value.result
    assert made.stopped and made.scene.is_finite and 0 < made.iterations <= 52
    assert f"its file has the shapes after {made.iterations} steps" in str(caught.value)
    assert output.read_text() == made.svg
    if name != "refined":
        assert read_metadata(made.svg) == STOPPED and 0 < len(made.scene) <= 12


def test_shapes_that_can_still_be_read_are(fail: Fail) -> None:
    fail(40, keeps=True)
    with pytest.raises(DeviceError, match="after 40 steps") as caught:
        fitted()
    assert caught.value.result.score.psnr > 15


@pytest.mark.parametrize("run", [fitted, refined])
def test_failures_after_a_fit_keep_it(run: Make, fail: Fail, monkeypatch: pytest.MonkeyPatch) -> None:
    """Then the fit is whole, but for the pixels that should be empty."""
    fail(-1)

    def refused(*_: Any) -> None:
        raise RuntimeError("Graph creation error: Warp CUDA error 2: out of memory (in function f)")

    for place in ("fit.clear", "run.refine"):
        monkeypatch.setattr(f"warpsplat.{place}.clear_empty", refused)
    with pytest.raises(DeviceError, match=r"not enough memory; .* after 56 steps") as caught:
        run(image=CLEAR, background="none")
    assert caught.value.result.iterations == 56


def test_drawings_keep_their_trace(fail: Fail, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    fail(-1)

    def refused(*_: Any) -> None:
        raise RuntimeError("Error launching kernel: Warp CUDA error 719: unspecified launch failure")

    monkeypatch.setattr(Program, "run", refused)
    output = tmp_path / "out.svg"
    with pytest.raises(DeviceError, match=r"CUDA error 719.; its file is the trace alone$") as caught:
        warpsplat.vectorize(PICTURE, subject="drawing", device="cpu", output=output)
    assert caught.value.result.stopped and caught.value.result.score.psnr > 15
    assert output.read_text() == caught.value.result.svg


def test_before_there_are_shapes_nothing_is_written(fail: Fail, tmp_path: Path) -> None:
    fail(3)
    with pytest.raises(DeviceError, match=r"719\)$") as caught:
        fitted(output=tmp_path / "out.svg")
    assert caught.value.result is None and not list(tmp_path.iterdir())


def test_a_search_keeps_the_best_that_it_has_tried(fail: Fail) -> None:
    """It fails while the next candidate is made."""
    whole = RUNS["target"]()
    fail(whole.iterations - 2)
    with pytest.raises(DeviceError) as caught:
        RUNS["target"]()
    made = caught.value.result
    assert made.score.psnr > 19 and made.stopped


def test_a_failed_run_is_resumed_from_its_checkpoint(
    fail: Fail, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    kept = tmp_path / "run.ckpt"
    usual = fitted()
    with monkeypatch.context():
        fail(40)
        with pytest.raises(DeviceError, match="; --resume continues from the checkpoint"):
            fitted(checkpoint=kept, checkpoint_every=0)
    monkeypatch.undo()
    assert kept.exists()
    assert fitted(checkpoint=kept, resume=True).svg == usual.svg


def test_several_numbers_keep_the_smaller_ones(fail: Fail) -> None:
    ready: list[warpsplat.Result] = []
    fail(80 + 30)
    options: dict[str, Any] = {"subject": "photo", "device": "cpu", "threads": 1, "ready": ready.append}
    with pytest.raises(DeviceError) as caught:
        warpsplat.vectorize_several(PICTURE, [6, 10], iterations=80, **options)
    assert len(ready) == 1 and not ready[0].stopped and caught.value.result.stopped


@pytest.fixture
def image(tmp_path: Path) -> Path:
    """A photograph."""
    Image.fromarray((255 * picture(64, 48)).astype("uint8")).save(tmp_path / "a.png")
    return tmp_path / "a.png"


CLI = ("-m", "warpsplat", "vectorize", "a.png", "--subject", "photo", "--curves", "12", "--iterations", "100")


@pytest.mark.parametrize("failing", ["launch:250", "sync:250"])
def test_a_launch_that_fails(failing: str, image: Path) -> None:
    """At once, or when something waits for it: then the device's memory is lost."""
    done = fake_cuda.run(*CLI, "--device", "cuda:0", fail=failing, cwd=image.parent)
    assert done.returncode == ExitCode.RESOURCES and not done.stdout
    line = one_line(done.stderr)
    found = re.fullmatch(
        r"warpsplat: a\.png: cuda:0 \(.*\) failed: .*; its file has the shapes after (\d+) steps", line
    )
    assert found and 0 < int(found[1]) < 100, line
    svg = (image.parent / "a.svg").read_text()
    assert read_metadata(svg) == STOPPED and svg.count("<path") <= 12


MEMORY = """
import json
import warp as wp
import warpsplat
from tests import fake_cuda
from warpsplat.errors import DeviceError

def made(device, **given):
    return warpsplat.vectorize("a.png", 12, subject="photo", iterations=100, device=device, **given)

def fill(progress):
    if progress.step == 40:
        gpu = wp.get_device("cuda:0")
        fake_cuda.options.memory = gpu.total_memory - gpu.free_memory

def tried(device, **given):
    try:
        return made(device, **given)
    except DeviceError as error:
        words.append(str(error))
        return error.result

words = []
whole = fake_cuda.options.memory
usual = made("cuda:0")
cut = tried("cuda:0", callback=fill)
fake_cuda.options.memory = whole
again = made("cuda:0")
second = made("cuda:1")
fake_cuda.options.memory = 42 << 20
reduced = made("cuda:1").reduced
print(json.dumps([usual.svg == again.svg == second.svg, cut.iterations, words, reduced]))
"""


@pytest.mark.slow
def test_memory_of_a_device(image: Path) -> None:
    """One that is full ends the run with a file; it works on once there is room. A run is planned for what is
    free, by device.
    """
    Image.open(image).resize((300, 220)).save(image)
    done = fake_cuda.run("-c", MEMORY, devices=2, cwd=image.parent)
    assert done.returncode == 0 and done.stderr == "", done.stderr
    same, steps, (words,), reduced = json.loads(done.stdout)
    assert same and 25 <= steps < 100
    assert re.search(
        r"not enough memory on cuda:0 \(.*\): .* more are needed, .* are free; fewer shapes", words
    )
    for remedy in ("--curves", "--max-memory", "smaller image", "--device cpu", f"after {steps} steps"):
        assert remedy in words
    assert (
        "free memory of cuda:1 for it is" in reduced and "processed at 150x110, measured at full" in reduced
    )


@pytest.mark.slow
@pytest.mark.parametrize("workers", [1, 2])
def test_a_batch_outlives_a_device(workers: int, tmp_path: Path) -> None:
    """``auto`` takes the CPU then; a worker process is replaced. What was saved can be made again."""
    for number in range(3):
        pixels = (255 * picture(64, 48 + number)).astype("uint8")
        Image.fromarray(pixels).save(tmp_path / f"{number}.png")
    words = f"-m warpsplat batch . --curves 8 --iterations 60 --workers {workers} --minify --subject photo"
    done = fake_cuda.run(*words.split(), fail="sync:200", cwd=tmp_path)
    assert done.returncode == ExitCode.SOME_FAILED, done.stderr
    assert "its file has the shapes after" in done.stderr
    told = re.findall("^warpsplat: the CPU is used; cuda:0", done.stderr, re.MULTILINE)
    assert len(told) == (workers == 1)
    assert len(list(tmp_path.glob("*.svg"))) == 3, "the failed ones, too"
    failed = len(re.findall(r"^\[.*failed: ", done.stderr, re.MULTILINE))
    again = fake_cuda.run(*words.split(), "--retry-failed", cwd=tmp_path)
    assert again.returncode == 0, again.stderr
    assert f"{failed} made, {3 - failed} skipped, 0 failed" in again.stdout
