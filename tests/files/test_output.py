"""Results are written beside and renamed; failures leave nothing behind."""

from __future__ import annotations

import errno
import os
import stat
import subprocess
import sys
from pathlib import Path

import pytest
from PIL import Image

from tests.scenes import random_scene
from warpsplat.errors import OutputError, UsageError
from warpsplat.files import output as files
from warpsplat.files.marks import mark_png
from warpsplat.files.output import SVG_ENDINGS, check_output, write_atomically
from warpsplat.scene import Kind
from warpsplat.svg.write import write_svg


def test_writes_and_replaces(tmp_path: Path) -> None:
    path = tmp_path / "a.svg"
    write_atomically(path, b"one")
    write_atomically(path, b"two")
    assert path.read_bytes() == b"two"
    assert os.listdir(tmp_path) == ["a.svg"]
    umask = os.umask(0)
    os.umask(umask)
    assert path.stat().st_mode & 0o777 == 0o666 & ~umask


@pytest.mark.parametrize("call", ["fsync", "replace"])
def test_a_full_disk_leaves_the_old_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, call: str) -> None:
    path = tmp_path / "a.svg"
    write_atomically(path, b"old")

    def fail(*_: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, call, fail)
    with pytest.raises(OutputError, match=r"a\.svg: could not be written: No space left"):
        write_atomically(path, b"new")
    assert path.read_bytes() == b"old"
    assert os.listdir(tmp_path) == ["a.svg"]


def test_interrupt_while_writing_leaves_the_old_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "a.svg"
    write_atomically(path, b"old")

    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(os, "fsync", interrupt)
    with pytest.raises(KeyboardInterrupt):
        write_atomically(path, b"new")
    assert path.read_bytes() == b"old"
    assert os.listdir(tmp_path) == ["a.svg"]


def test_outputs_that_cannot_be(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(UsageError, match="does not exist"):
        check_output(tmp_path / "missing" / "a.svg")
    with pytest.raises(UsageError, match="is not a folder"):
        check_output(tmp_path / "file" / "a.svg")
    with pytest.raises(UsageError, match="is a folder, not a file"):
        check_output(tmp_path)

    def refuse(*_: object) -> None:
        raise OSError(errno.EROFS, os.strerror(errno.EROFS))

    monkeypatch.setattr(os, "open", refuse)
    with pytest.raises(UsageError, match="Read-only file system"):
        check_output(tmp_path / "a.svg")


def test_check_leaves_nothing(tmp_path: Path) -> None:
    check_output(tmp_path / "a.svg")
    assert not os.listdir(tmp_path)


def test_the_mode_of_the_old_file_is_kept(tmp_path: Path) -> None:
    path = tmp_path / "a.svg"
    path.write_bytes(b"old")
    for mode in (0o640, 0o600, 0o664):
        path.chmod(mode)
        write_atomically(path, b"new")
        assert stat.S_IMODE(path.stat().st_mode) == mode


def test_the_umask_of_the_process_is_left_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """For a moment without one, other threads would make files that anybody may write."""

    def refuse(_: int) -> int:
        raise AssertionError("umask")

    before = os.umask(0o027)
    try:
        with monkeypatch.context() as patch:
            patch.setattr(os, "umask", refuse)
            write_atomically(tmp_path / "a.svg", b"new")
    finally:
        os.umask(before)
    assert stat.S_IMODE((tmp_path / "a.svg").stat().st_mode) == 0o640


def test_other_hard_links_keep_the_old_content(tmp_path: Path) -> None:
    path, backup = tmp_path / "a.svg", tmp_path / "backup.svg"
    path.write_bytes(b"old")
    os.link(path, backup)
    write_atomically(path, b"new")
    assert (path.read_bytes(), backup.read_bytes()) == (b"new", b"old")


def test_links_that_lead_nowhere(tmp_path: Path) -> None:
    (tmp_path / "one.svg").symlink_to(tmp_path / "two.svg")
    (tmp_path / "two.svg").symlink_to(tmp_path / "one.svg")
    with pytest.raises(UsageError, match="loop of links"):
        check_output(tmp_path / "one.svg")
    with pytest.raises(OutputError, match="loop of links"):
        write_atomically(tmp_path / "one.svg", b"")
    (tmp_path / "far.svg").symlink_to(tmp_path / "missing" / "a.svg")
    with pytest.raises(UsageError, match=r"missing, to which far\.svg links, does not exist"):
        check_output(tmp_path / "far.svg")
    (tmp_path / "near.svg").symlink_to(tmp_path / "new.svg")
    check_output(tmp_path / "near.svg")


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs pipes with names")
def test_names_that_cannot_be_files(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.svg")
    with pytest.raises(UsageError, match="pipe"):
        check_output(tmp_path / "pipe.svg", overwrite=False)
    for name in ("x" * 300 + ".svg", "a\0.svg"):
        with pytest.raises(UsageError, match="cannot be written"):
            check_output(tmp_path / name)
    with pytest.raises(UsageError, match=r"ends with \.svg or \.svgz"):
        check_output(tmp_path / "a.png", endings=SVG_ENDINGS)
    check_output(tmp_path / "a.SVG", endings=SVG_ENDINGS)
    check_output(tmp_path / "a.svgz", endings=SVG_ENDINGS)


def test_what_may_be_replaced(tmp_path: Path) -> None:
    path = tmp_path / "a.svg"
    ours = write_svg(random_scene(Kind.FILL, count=3, width=40, height=30)).encode()
    drawn = b'<svg xmlns="http://www.w3.org/2000/svg"/>'
    cases = {"missing": None, "empty": b"", "ours": ours, "drawn": drawn}
    for name, data in cases.items():
        if data is not None:
            path.write_bytes(data)
        if name == "drawn":
            with pytest.raises(UsageError, match="was not written by warpsplat; --overwrite"):
                check_output(path, overwrite=False)
            check_output(path, overwrite=True)
            assert path.read_bytes() == drawn
        else:
            check_output(path, overwrite=False)


def test_a_png_of_ours_is_known(tmp_path: Path) -> None:
    path = tmp_path / "a.png"
    picture = Image.new("RGB", (4, 4))
    picture.save(path)
    unmarked = path.read_bytes()
    path.write_bytes(mark_png(unmarked))
    check_output(path, overwrite=False)
    with Image.open(path) as marked:
        marked.load()
        assert marked.info["Software"] == "warpsplat"
    path.write_bytes(unmarked)
    with pytest.raises(UsageError, match="not written by warpsplat"):
        check_output(path, overwrite=False)


def test_only_the_temporary_files_of_the_dead_are_removed(tmp_path: Path) -> None:
    dead = subprocess.Popen([sys.executable, "-c", ""])
    dead.wait()
    here = files._machine()
    names = {
        "dead": f".warpsplat-{here}-{dead.pid}-00000000.tmp",
        "alive": f".warpsplat-{here}-{os.getppid()}-00000000.tmp",
        "elsewhere": f".warpsplat-00000000-{dead.pid}-00000000.tmp",
        "old": f".warpsplat-00000000-{dead.pid}-00000001.tmp",
        "other": f".warpsplat-{here}-{dead.pid}.tmp",
    }
    for name in names.values():
        (tmp_path / name).touch()
    os.utime(tmp_path / names["old"], (0, 0))
    check_output(tmp_path / "a.svg")
    assert sorted(os.listdir(tmp_path)) == sorted(names[k] for k in ("alive", "elsewhere", "other"))
