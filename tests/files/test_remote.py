"""Images and results behind URLs: fsspec's file system in memory stands for a store."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import pytest

from warpsplat.errors import ImageError, OutputError, UsageError
from warpsplat.files import remote as module
from warpsplat.files.inputs import read_input
from warpsplat.files.output import may_replace, write_result
from warpsplat.files.remote import find_remote, is_url, listed, remote

pytest.importorskip("upath")


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
    monkeypatch.setitem(sys.modules, "upath", None)
    with pytest.raises(UsageError, match=r"pip install 'warpsplat\[remote\]'"):
        remote("memory://bucket/a.png")
