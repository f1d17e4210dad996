"""Batches of images behind URLs."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from tests.cli.helpers import run
from tests.files.memory_store import png
from warpsplat.batch.images import find_images
from warpsplat.batch.plan import plan_jobs
from warpsplat.errors import UsageError
from warpsplat.files import remote as module
from warpsplat.files.remote import is_remote, remote

pytest.importorskip("upath")

EFFORT = ("--curves", "4", "--iterations", "4", "--quality", "draft", "--workers", "1")


def test_a_file_url_is_a_path(tmp_path: Path) -> None:
    (tmp_path / "a.png").write_bytes(png(0))
    assert not is_remote(remote(f"file://{tmp_path}/a.png"))
    assert [found.path for found in find_images(f"file://{tmp_path}/*.png", Path())] == [tmp_path / "a.png"]


def batch(*given: str) -> int:
    return run("batch", *given, *EFFORT)


def test_a_batch_from_a_store_to_a_store(
    store: Any, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    store.pipe_file("/bucket/in/broken.png", b"no image")
    given = ("memory://bucket/in", "-o", "memory://bucket/out", "--json")
    assert batch(*given) == 5
    assert "memory://bucket/in/broken.png: " in capfd.readouterr().err
    made = {f"/bucket/out/{name}.svg" for name in ("a", "b")}
    assert set(store.find("/bucket/out")) == made
    assert [path.name for path in tmp_path.iterdir()] == ["warpsplat-manifest.jsonl"], "nothing else is local"
    before = {name: store.cat_file(name) for name in made}
    assert batch(*given) == 5
    rows = [json.loads(line) for line in capfd.readouterr().out.splitlines()]
    assert {row["image"]: row["status"] for row in rows if "image" in row} == {
        "memory://bucket/in/a.png": "skipped",
        "memory://bucket/in/b.PNG": "skipped",
        "memory://bucket/in/broken.png": "failed",
    }
    store.rm_file("/bucket/out/a.svg")
    module._listed.clear()
    batch(*given)
    assert {name: store.cat_file(name) for name in made} == before, "what is gone is made again"


def test_the_bytes_of_a_local_batch(store: Any, tmp_path: Path) -> None:
    (tmp_path / "a.png").write_bytes(store.cat_file("/bucket/in/a.png"))
    assert batch("a.png", "-o", "here") == 0
    assert batch("a.png", "-o", "memory://bucket/{stem}-{curves}.svg") == 0
    assert batch("memory://bucket/in/a.png", "-o", "there") == 0
    wanted = (tmp_path / "here/a.svg").read_bytes()
    assert store.cat_file("/bucket/a-4.svg") == wanted
    assert (tmp_path / "there/a.svg").read_bytes() == wanted


def test_foreign_results_at_a_url_are_not_replaced(store: Any, capfd: pytest.CaptureFixture[str]) -> None:
    store.pipe_file("/bucket/out/a.svg", b"<svg>mine</svg>")
    assert batch("memory://bucket/in/a.png", "-o", "memory://bucket/out") == 2
    assert "memory://bucket/out/a.svg" in capfd.readouterr().err
    assert store.cat_file("/bucket/out/a.svg") == b"<svg>mine</svg>"


@pytest.mark.usefixtures("store")
def test_nothing_is_written_to_the_web_and_no_match_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(UsageError, match="nothing matches"):
        find_images("memory://bucket/*.tif", Path())
    monkeypatch.setattr(module, "READ_ONLY", ("memory",))
    with pytest.raises(UsageError, match="nothing can be written to memory://"):
        plan_jobs(["memory://host/a.png"])
