"""Resumed runs end with the same bytes, and take their own checkpoints only."""

from __future__ import annotations

import itertools
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import warpsplat
from tests.run.helpers import CLEAR, PICTURE, Make, after, fitted, refined, slopes
from tests.scenes import forms_scene, mixed_scene
from warpsplat.errors import OutputError, UsageError, WarpsplatError
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
    header, _ = unpack(path)
    assert [state["step"] for state in header["fits"]] == [30]
    assert header["run"]["settings"]["curves"] == 10 and header["version"] == warpsplat.__version__
    assert fitted(checkpoint=path, resume=True).svg == fitted().svg


def test_a_stopped_file_says_so_and_a_goal_is_stopped_between_its_fits(tmp_path: Path) -> None:
    """Stopped in the last step of a fit, the run that resumes begins the next one."""
    path = tmp_path / "run.checkpoint"
    run = RUNS["layered"]
    stopped = run(checkpoint=path, stop=after(21))
    header, _ = unpack(path)
    assert not header["under way"] and len(header["fits"]) == 1
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


def changed(saved: Path, path: Path, change: Callable[[dict[str, Any], dict[str, np.ndarray]], None]) -> Path:
    """Write a valid archive with changed content."""
    header, arrays = unpack(saved)
    change(header, arrays)
    path.write_bytes(pack(header, arrays))
    return path


def at(*keys: Any, value: Any) -> Callable[[dict[str, Any], dict[str, np.ndarray]], None]:
    """Return a change of one entry."""

    def change(header: dict[str, Any], arrays: dict[str, np.ndarray]) -> None:
        place: Any = arrays if "/" in str(keys[0]) else header
        for key in keys[:-1]:
            place = place[key]
        place[keys[-1]] = value(place[keys[-1]]) if callable(value) else value

    return change


@pytest.mark.parametrize(
    ("change", "cause"),
    [
        (at("format", value=2), "format 2, this program reads 1"),
        (at("version", value="9.9"), "made by warpsplat 9.9"),
        (at("fits", value=3), "no list"),
        (at("under way", value=None), "under way is no bool"),
        (at("fits", 0, "step", value=56), "step is no int"),
        (at("fits", 0, "step", value=True), "step is no int"),
        (at("fits", 0, "curves", value=11), "curves"),
        (at("fits", 0, "generator", value={}), "damaged"),
        (at("fits", 0, "generator", "state", "state", value=-1), "damaged"),
        (at("fits", 0, "room", value=[]), "damaged"),
        (at("fits", 0, "room", 0, "slots", value=10**6), "slots"),
        (at("fits", 0, "per_pixel", value=float("nan")), "per_pixel"),
        (at("0/points", value=lambda a: np.where(a == a.max(), np.float32(np.nan), a)), "points has numbers"),
        (at("0/points", value=lambda a: a[:-1]), "points"),
        (at("0/points", value=lambda a: a.view(np.int32)), "points has elements of another type"),
        (at("0/moment2.points", value=lambda a: -1 - a), "moment2.points has numbers"),
        (at("0/held.colors", value=lambda a: a + 2), "held.colors"),
        (at("0/kind", value=lambda a: a + 7), "kind has numbers"),
        (at("0/first", value=lambda a: a[::-1].copy()), "first does not ascend"),
        (at("0/starts", value=lambda a: a[:1]), "starts does not ascend"),
        (at("0/paint", value=lambda a: a + 1), "gradient has no stops"),
        (at("0/picture", value=lambda a: a + 1), "picture has numbers"),
        (at("0/twin", value=lambda a: a[None]), "dimensions"),
        (at("0/ages", value=lambda a: a[1:]), "ages has shape"),
    ],
)  # fmt: skip
def test_damage_is_one_line(saved: Path, tmp_path: Path, change: Any, cause: str) -> None:
    path = changed(saved, tmp_path / "run.checkpoint", change)
    with pytest.raises(WarpsplatError, match=cause) as caught:
        fitted(checkpoint=path, resume=True)
    assert int(caught.value.exit_code) in (2, 3)
    assert str(caught.value).startswith(str(path)) and "\n" not in str(caught.value)


def test_a_checkpoint_of_another_device(
    saved: Path, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    path = changed(saved, tmp_path / "run.checkpoint", at("device", value="another"))
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
