"""The manifest: lines of JSON that survive crashes, and claims that end with their process."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests import ROOT
from warpsplat.batch.manifest import NAME, Entry, Manifest, entry_of
from warpsplat.errors import UsageError

GOOD = Entry("a.svg", "key", "made", "d1", "a.png", figures={"psnr": 20.5, "bytes": 7})


@pytest.fixture
def notes(tmp_path: Path) -> Manifest:
    made = Manifest(tmp_path / "deep" / NAME)
    made.open()
    return made


def test_entries_are_found_by_name(notes: Manifest) -> None:
    output = notes.path.parent / "a.svg"
    for digest, key in (("d1", "key"), ("d2", "key"), ("d3", "other")):
        notes.append(Entry(notes.name(output), key, "made", digest, figures={"psnr": 20.5}))
    again = Manifest(notes.path)
    again.open(write=False)
    assert [entry.digest for entry in again.entries(output)] == ["d1", "d2", "d3"]
    notes.append(Entry("b.svg", "key", "failed", error="e"))
    again.refresh()
    assert again.entries(notes.path.parent / "b.svg") == [Entry("b.svg", "key", "failed", error="e")]


def test_a_torn_line_is_ignored_and_ends_where_the_next_begins(notes: Manifest) -> None:
    notes.append(GOOD)
    with notes.path.open("ab") as file:
        file.write(GOOD.line()[:30])
    notes.refresh()
    assert notes.damaged == 0, "perhaps it is being written"
    notes.append(Entry("b.svg", "key", "made"))
    notes.refresh()
    assert notes.damaged == 1
    assert len(notes.entries(notes.path.parent / "a.svg")) == 1
    assert len(notes.entries(notes.path.parent / "b.svg")) == 1


@pytest.mark.parametrize(
    "line",
    [
        *(b"", b"{", b"[1]", b"null", b"\xff\xfe"),
        GOOD.line().replace(b'"v": 1', b'"v": 2'),
        GOOD.line().replace(b'"output": "a.svg", ', b""),
    ],
    ids=map(str, range(7)),  # lines hold the time of day, which names of tests must not
)
def test_invalid_lines_are_no_entries(line: bytes) -> None:
    assert entry_of(line) is None


def test_a_manifest_must_be_a_regular_file(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    for path in (
        tmp_path,
        tmp_path / "pipe",
        Path("/dev/null"),
        tmp_path / "pipe" / "x",
        tmp_path / ("x" * 300),
    ):
        with pytest.raises(UsageError, match="--manifest FILE"):
            Manifest(path).open()


CLAIM = """
import sys
from pathlib import Path
from warpsplat.batch.manifest import Manifest
notes = Manifest(Path(sys.argv[1]))
notes.open()
print(*(notes.claim(notes.path.parent / name, "key") for name in ("a.svg", "b.svg")), flush=True)
sys.stdin.read()
"""


def test_a_claim_holds_for_other_processes_and_ends_with_its_own(notes: Manifest) -> None:
    output, other = notes.path.parent / "a.svg", notes.path.parent / "b.svg"
    assert notes.claim(output, "key")
    process = subprocess.Popen(
        [sys.executable, "-c", CLAIM, str(notes.path)],
        cwd=ROOT,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    assert process.stdout
    assert process.stdout.readline() == "False True\n"
    assert not notes.claim(other, "key")
    assert notes.claim(other, "other settings")
    notes.append(GOOD)
    process.kill()
    process.communicate()
    assert notes.claim(other, "key")
