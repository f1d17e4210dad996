"""Results are written atomically; failures leave nothing behind."""

from __future__ import annotations

import errno
import gzip
import io
import os
import stat
import subprocess
import sys
from pathlib import Path

import pytest
from PIL import Image

from tests.fuzz.corpus import saved
from tests.scenes import random_scene
from warpsplat.errors import OutputError, UsageError
from warpsplat.files import output as files
from warpsplat.files.marks import mark_dxf, mark_eps, mark_pdf, mark_png
from warpsplat.files.output import SVG_ENDINGS, check_output, write_atomically
from warpsplat.scene import Kind
from warpsplat.svg.write import write_svg


def test_writes_and_replaces(tmp_path: Path) -> None:
    path = tmp_path / "a.svg"
    write_atomically(path, b"one")
    os.link(path, tmp_path / "backup.svg")
    write_atomically(path, b"two")
    assert path.read_bytes() == b"two"
    assert (tmp_path / "backup.svg").read_bytes() == b"one", "other hard links keep the old content"
    assert sorted(os.listdir(tmp_path)) == ["a.svg", "backup.svg"]
    umask = os.umask(0)
    os.umask(umask)
    assert path.stat().st_mode & 0o777 == 0o666 & ~umask


FULL = OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


@pytest.mark.parametrize(
    ("call", "error"),
    [("fsync", FULL), ("replace", FULL), ("fsync", KeyboardInterrupt())],
    ids=["full disk", "failed rename", "interrupt"],
)
def test_failures_leave_the_old_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, call: str, error: BaseException
) -> None:
    path = tmp_path / "a.svg"
    write_atomically(path, b"old")

    def fail(*_: object) -> None:
        raise error

    monkeypatch.setattr(os, call, fail)
    with pytest.raises((OutputError, KeyboardInterrupt)) as caught:
        write_atomically(path, b"new")
    assert error is not FULL or "a.svg: could not be written: No space left" in str(caught.value)
    assert path.read_bytes() == b"old"
    assert os.listdir(tmp_path) == ["a.svg"]


def test_impossible_outputs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
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


def test_the_mode_of_the_old_file_is_kept(tmp_path: Path) -> None:
    path = tmp_path / "a.svg"
    check_output(path)
    assert not os.listdir(tmp_path)
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


def test_broken_links(tmp_path: Path) -> None:
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
def test_impossible_names(tmp_path: Path) -> None:
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


def test_files_that_may_be_replaced(tmp_path: Path) -> None:
    path = tmp_path / "a.svg"
    check_output(path, overwrite=False)
    png = saved(Image.new("RGB", (4, 4)), "PNG")
    drawn = b'<svg xmlns="http://www.w3.org/2000/svg"/>'
    ours = write_svg(random_scene(Kind.FILL, count=3, width=40, height=30)).encode()
    dxf, eps = b"  0\nSECTION\n  2\nHEADER\n  0\nENDSEC\n  0\nEOF", b"%!PS-Adobe-3.0 EPSF-3.0\n%%EOF\n"
    known = mark_png(png), mark_pdf(b"%PDF-1.7"), mark_dxf(dxf), mark_eps(eps)
    for data in (b"", ours, gzip.compress(ours), *known):
        path.write_bytes(data)
        check_output(path, overwrite=False)
    for data in (drawn, png, b"%PDF-1.7", dxf, eps, b"RIFF, some other WebP"):
        path.write_bytes(data)
        with pytest.raises(UsageError, match="was not written by warpsplat; --overwrite"):
            check_output(path, overwrite=False)
        check_output(path, overwrite=True)
        assert path.read_bytes() == data
    with Image.open(io.BytesIO(mark_png(png))) as marked:
        marked.load()
        assert marked.info["Software"] == "warpsplat"


def test_only_temporary_files_of_dead_runs_are_removed(tmp_path: Path) -> None:
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
