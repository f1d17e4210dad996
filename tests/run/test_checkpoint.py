"""Resumed runs end with the same bytes, and take their own checkpoints only."""

from __future__ import annotations

import itertools
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import warpsplat
from tests.run.helpers import CLEAR, PICTURE, Make, after, fitted, refined, slopes
from tests.scenes import forms_scene, mixed_scene
from warpsplat.errors import CheckpointError, OutputError, UsageError
from warpsplat.files.packed import is_packed, pack, unpack
from warpsplat.fit import checkpoint
from warpsplat.run import checkpoint as module
from warpsplat.svg.write import read_metadata

MASK = np.ascontiguousarray(PICTURE[..., 0])


def loss_from(begin: float) -> warpsplat.CustomLoss:
    return warpsplat.CustomLoss(slopes, 0.1, with_target=True, begin=begin)


RUNS: dict[str, Make] = {
    "closed": fitted,
    "open": lambda **given: fitted(open=True, **given),
    "splat": lambda **given: fitted(renderer="splat", **given),
    "gaussian": lambda **given: fitted(renderer="gaussian", open=True, **given),
    "layered": lambda **given: fitted(curves=None, levels=(4, 12), iterations=28, **given),
    "mixed": lambda **given: fitted(mixed=True, **given),
    "paint": lambda **given: fitted(paint="auto", **given),
    "palette": lambda **given: fitted(colors=4, **given),
    "transparent": lambda **given: fitted(**{"image": CLEAR} | given),
    "importance": lambda **given: fitted(importance=MASK, **given),
    "size": lambda **given: fitted(max_bytes=1200, curves=34, iterations=16, **given),
    "target": lambda **given: fitted(target_psnr=20.0, curves=10, iterations=12, **given),
    "ellipses": lambda **given: fitted(shape="ellipse", **given),
    "lines": lambda **given: fitted(shape="line", **given),
    "loss": lambda **given: fitted(loss_from(0.5), colors=4, **given),  # which begins in the middle
    "refine": refined,
    "refine forms": lambda **given: refined(forms_scene(48, 36).append(mixed_scene(48, 36)), **given),
}


@pytest.mark.parametrize("kind", RUNS)
def test_a_run_goes_on_to_the_same_bytes(tmp_path: Path, kind: str) -> None:
    """Stopped at some step; some twice, the second time after an evaluation of the file."""
    run, path = RUNS[kind], tmp_path / "run.checkpoint"
    whole = run()
    first = run(checkpoint=path, stop=after(3 + sum(map(ord, kind)) % 24))
    assert first.stopped and first.iterations < whole.iterations and is_packed(path)
    if kind in {"closed", "transparent", "size"}:
        second = run(checkpoint=path, resume=True, stop=after(30))
        assert second.stopped and first.iterations < second.iterations < whole.iterations
    result = run(checkpoint=path, resume=True)
    assert result.svg == whole.svg
    assert result.as_dict() | {"seconds": 0} == whole.as_dict() | {"seconds": 0}
    assert not path.exists(), "a finished run leaves none"


def test_a_run_that_was_killed_goes_on_from_the_last_save(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(checkpoint, "LEAST_SAVE_RATIO", 0.0)
    path = tmp_path / "run.checkpoint"

    def killed() -> bool:
        if next(steps) == 31:
            raise KeyboardInterrupt
        return False

    steps = itertools.count(1)
    with pytest.raises(KeyboardInterrupt):
        fitted(checkpoint=path, checkpoint_every=0, stop=killed)
    content = unpack(path)
    assert content["fits"] == [] and content["state"]["step"] == 30
    assert content["run"]["settings"]["curves"] == 10 and content["version"] == warpsplat.__version__
    assert fitted(checkpoint=path, resume=True).svg == fitted().svg


def test_a_stopped_file_says_so_and_a_goal_is_stopped_between_its_fits(tmp_path: Path) -> None:
    """Stopped in the last step of a fit, the run that resumes begins the next one."""
    path = tmp_path / "run.checkpoint"
    run = RUNS["layered"]
    stopped = run(checkpoint=path, stop=after(21))
    content = unpack(path)
    assert content["state"] is None and len(content["fits"]) == 1
    assert "stopped" in read_metadata(stopped.svg)
    assert run(checkpoint=path, resume=True).svg == run().svg


FLAT = np.repeat(np.repeat(np.float32([[[1, 0, 0], [0, 0, 1]]]), 12, axis=0), 8, axis=1)


@pytest.mark.parametrize("given", [{"subject": "drawing", "image": FLAT}, {"time_budget": 30}])
def test_runs_without_checkpoints_start_from_the_beginning(
    tmp_path: Path, given: dict[str, Any], caplog: pytest.LogCaptureFixture
) -> None:
    path = tmp_path / "run.checkpoint"
    assert fitted(checkpoint=path, resume=True, stop=lambda: True, **given).stopped
    assert "no checkpoint exists yet" in caplog.text
    assert not fitted(checkpoint=path, resume=True, stop=lambda: "time_budget" in given, **given).missed
    assert "starts from the beginning" in caplog.text


@pytest.fixture(scope="module")
def saved(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("saved") / "run.checkpoint"
    fitted(checkpoint=path, stop=after(12))
    return path


@pytest.mark.parametrize(
    ("given", "cause"),
    [
        ({"image": PICTURE[::-1]}, "image differs"),
        ({"image": PICTURE[:-1]}, "image differs"),
        ({"importance": MASK}, "mask differs"),
        ({"curves": 11}, r"curves differs \(10, now 11\)"),
        ({"loss": loss_from(0.0)}, "loss differs"),
        ({"settings": warpsplat.make_settings(curves=10, rates={"points": 2.0})}, "differs"),
    ],
)
def test_a_checkpoint_of_another_run_is_refused(saved: Path, given: dict[str, Any], cause: str) -> None:
    if "settings" in given:
        given |= dict.fromkeys(("curves", "iterations", "seed", "subject"))
    with pytest.raises(UsageError, match=rf"run\.checkpoint: .*{cause}"):
        fitted(checkpoint=saved, resume=True, **given)
    with pytest.raises(UsageError, match="command differs"):
        RUNS["refine"](checkpoint=saved, resume=True)
    assert is_packed(saved)


def changed(saved: Path, path: Path, **change: str) -> Path:
    """Write a valid checkpoint with changed content."""
    path.write_bytes(pack(unpack(saved) | change))
    return path


def test_damage_and_another_version_are_one_line(saved: Path, tmp_path: Path) -> None:
    path = tmp_path / "run.checkpoint"
    path.write_bytes(saved.read_bytes()[:-1])
    with pytest.raises(CheckpointError, match=r"run\.checkpoint: the checkpoint is damaged"):
        fitted(checkpoint=path, resume=True)
    with pytest.raises(UsageError, match=r"run\.checkpoint: made by warpsplat 9\.9, this is"):
        fitted(checkpoint=changed(saved, path, version="9.9"), resume=True)


def test_another_device_is_said(saved: Path, tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    path = changed(saved, tmp_path / "run.checkpoint", device="another")
    fitted(checkpoint=path, resume=True, stop=lambda: True)
    assert "its bytes will differ" in caplog.text


def test_no_file_is_replaced_unasked(saved: Path, tmp_path: Path) -> None:
    path, other = tmp_path / "run.checkpoint", tmp_path / "notes.txt"
    shutil.copy(saved, path)
    other.write_text("hours of work")
    for file, how, cause in (
        (path, {}, "a checkpoint exists; --resume continues"),
        (other, {}, "is not a checkpoint; --overwrite"),
        (other, {"resume": True}, "not a checkpoint of warpsplat"),
        (tmp_path, {}, "is a folder"),
        (tmp_path / "none" / "a", {}, "does not exist"),
        (Path("-"), {}, "not the standard output"),
    ):
        with pytest.raises(UsageError, match=cause):
            fitted(checkpoint=file, **how)
    with pytest.raises(UsageError, match="needs a checkpoint"):
        fitted(resume=True)
    with pytest.raises(UsageError, match="another name"):
        fitted(checkpoint=tmp_path / "a.svg", output=tmp_path / "a.svg")
    with pytest.raises(UsageError, match="not a time"):
        fitted(checkpoint=path, checkpoint_every="soon")
    assert other.read_text() == "hours of work" and path.read_bytes() == saved.read_bytes()
    fitted(checkpoint=other, overwrite=True, stop=after(2))
    assert is_packed(other)


def test_a_full_disk_does_not_end_a_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    def full(path: Path, data: bytes) -> None:
        raise OutputError(f"{path}: could not be written: No space left on device")

    monkeypatch.setattr(module, "write_atomically", full)
    result = fitted(checkpoint=tmp_path / "run.checkpoint", stop=after(3))
    assert result.iterations == 3
    assert "No space left on device; the run continues without" in caplog.text
