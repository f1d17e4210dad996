"""Images and results behind URLs: fsspec's file system in memory stands for a store."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from tests.cli.helpers import run
from tests.fuzz.corpus import saved
from warpsplat.errors import ImageError, OutputError, UsageError
from warpsplat.files import remote as module
from warpsplat.files.inputs import read_input
from warpsplat.files.output import may_replace, write_result
from warpsplat.files.remote import find_remote, is_remote, is_url, listed, remote
from warpsplat.jobs.batch.images import find_images
from warpsplat.jobs.batch.plan import in_shard, plan_jobs

fsspec = pytest.importorskip("fsspec")
pytest.importorskip("upath")

EFFORT = ("--curves", "4", "--iterations", "4", "--quality", "draft", "--workers", "1")


def png(seed: int) -> bytes:
    pixels = np.random.default_rng(seed).integers(0, 255, (24, 32, 3), dtype=np.uint8)
    return saved(Image.fromarray(pixels), "PNG")


@pytest.fixture
def store(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[Any]:
    store = fsspec.filesystem("memory")
    store.store.clear()
    for name in ("in/a.png", "in/b.PNG", "in/deep/c.png", "in/.hidden.png", "in/notes.txt", "in/a.svg"):
        store.pipe_file(f"/bucket/{name}", png(len(name)))
    module._listed.clear()
    monkeypatch.chdir(tmp_path)
    yield store
    store.store.clear()
    module._listed.clear()


def names(found: list[Path]) -> list[str]:
    return [str(path).removeprefix("memory://bucket/") for path in found]


def test_urls() -> None:
    assert all(map(is_url, ("s3://bucket/a.png", "https://host/a.png?x=1")))
    assert not any(map(is_url, ("C:/a.png", "a/b.png", "./s3://x")))
    with pytest.raises(UsageError, match="nope://a/b"):
        remote("nope://a/b")


@pytest.mark.usefixtures("store")
def test_finds_files_folders_and_patterns() -> None:
    ends = (".png",)
    assert names(find_remote("memory://bucket/in", ends)[0]) == ["in/a.png", "in/b.PNG"]
    found, root = find_remote("memory://bucket/in/*", ends)
    assert names(found) == ["in/a.png", "in/b.PNG", "in/notes.txt"]
    assert names([root]) == ["in"]
    found, root = find_remote("memory://bucket/**/c.png", ends)
    assert (names(found), str(root)) == (["in/deep/c.png"], "memory://bucket")
    assert names(find_remote("memory://bucket/in/missing.png", ends)[0]) == ["in/missing.png"]
    with pytest.raises(UsageError, match="nothing matches"):
        find_images("memory://bucket/*.tif", Path())


def test_a_file_url_is_a_path(tmp_path: Path) -> None:
    (tmp_path / "a.png").write_bytes(png(0))
    assert not is_remote(remote(f"file://{tmp_path}/a.png"))
    assert [found.path for found in find_images(f"file://{tmp_path}/*.png", Path())] == [tmp_path / "a.png"]


def test_a_query_is_no_pattern(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "READ_ONLY", ("memory",))
    found, _ = find_remote("memory://host/a.png?x=[1]", (".png",))
    assert [str(path) for path in found] == ["memory://host/a.png?x=[1]"]


@pytest.mark.usefixtures("store")
def test_reads_and_writes() -> None:
    path = remote("memory://bucket/out/a.svg")
    with pytest.raises(ImageError, match=r"memory://bucket/out/a\.svg: no such file"):
        read_input(path)
    write_result(path, b"<svg/>")
    assert read_input(path) == b"<svg/>"
    assert not may_replace(path)
    write_result(path, b"")
    with pytest.raises(ImageError, match="is empty"):
        read_input(path)
    with pytest.raises(ImageError, match="larger than"):
        read_input(remote("memory://bucket/in/a.png"), limit=10)


def test_a_store_that_refuses_is_one_line(store: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    class RefusalError(Exception):
        """An error like boto's, which derive from no OSError."""

    def refuse(*given: Any, **named: Any) -> Any:
        raise RefusalError("Access Denied\nand much more")

    path = remote("memory://bucket/in/a.png")
    monkeypatch.setattr(type(store), "pipe_file", refuse)
    name = r"^memory://bucket/in/a\.png"
    with pytest.raises(OutputError, match=name + ": could not be written: Access Denied$"):
        write_result(path, b"")
    monkeypatch.setattr(type(store), "open", refuse)
    with pytest.raises(ImageError, match=name + ": cannot be read: Access Denied$"):
        read_input(path)
    monkeypatch.setattr(type(store), "ls", refuse)
    with pytest.raises(OutputError, match="cannot be listed: Access Denied"):
        listed(path)


def test_writes_atomically_where_the_store_does_not(store: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "WHOLE", ())
    path = remote("memory://bucket/new/a.svg")
    write_result(path, b"one")
    write_result(path, b"two")
    assert store.cat_file("/bucket/new/a.svg") == b"two"
    monkeypatch.setattr(type(store), "mv", lambda *given: (_ for _ in ()).throw(OSError("gone")))
    with pytest.raises(OutputError, match="gone"):
        write_result(path, b"three")
    assert store.cat_file("/bucket/new/a.svg") == b"two"
    assert [entry.rpartition("/")[2] for entry in store.ls("/bucket/new", detail=False)] == ["a.svg"]


def test_without_the_package(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "upath", None)
    with pytest.raises(UsageError, match=r'pip install "warpsplat\[remote\]"'):
        remote("memory://bucket/a.png")


def batch(*given: str) -> int:
    return run("batch", *given, *EFFORT)


def test_a_batch_from_a_store_to_a_store(
    store: Any, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    store.pipe_file("/bucket/in/broken.png", b"no image")
    given = ("memory://bucket/in", "-o", "memory://bucket/out", "--json")
    assert batch(*given) == 5
    assert "memory://bucket/in/broken.png: " in capsys.readouterr().err
    made = {f"/bucket/out/{name}.svg" for name in ("a", "b")}
    assert set(store.find("/bucket/out")) == made
    assert [path.name for path in tmp_path.iterdir()] == ["warpsplat-manifest.jsonl"], "nothing else is local"
    before = {name: store.cat_file(name) for name in made}
    assert batch(*given) == 5
    rows = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
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


def test_files_of_others_are_not_replaced(store: Any, capsys: pytest.CaptureFixture[str]) -> None:
    store.pipe_file("/bucket/out/a.svg", b"<svg>mine</svg>")
    assert batch("memory://bucket/in/a.png", "-o", "memory://bucket/out") == 2
    assert "memory://bucket/out/a.svg" in capsys.readouterr().err
    assert store.cat_file("/bucket/out/a.svg") == b"<svg>mine</svg>"


@pytest.mark.usefixtures("store")
def test_shards_partition_the_images() -> None:
    jobs = plan_jobs(["memory://bucket/**/*.png", "memory://bucket/in/b.PNG"])
    parts = [[job for job in jobs if in_shard(job, Path(), i, 3)] for i in (1, 2, 3)]
    assert sum(map(len, parts)) == len(jobs) == 3
    assert [str(job.output) for job in jobs][:2] == [
        "memory://bucket/in/a.svg",
        "memory://bucket/in/deep/c.svg",
    ]


def test_nothing_is_written_to_the_web(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "READ_ONLY", ("memory",))
    with pytest.raises(UsageError, match="nothing can be written to memory://"):
        plan_jobs(["memory://host/a.png"])
