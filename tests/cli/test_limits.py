"""Limits of the system (space, permission, streams): one line, the right code, nothing half written."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests import make_image
from tests.cli.helpers import MANIFEST, one_line
from tests.forks import QUICK, Forks
from tests.fuzz.corpus import own_svg

pytestmark = pytest.mark.slow


@pytest.fixture
def folder() -> Iterator[Path]:
    """A folder with inputs that every user can reach."""
    with tempfile.TemporaryDirectory() as name:
        path = Path(name)
        path.chmod(0o755)
        make_image(path / "a.png")
        (path / "drawing.svg").write_bytes(own_svg("fill"))
        (path / "jobs.yaml").write_text(
            f"jobs: [{{images: a.png, output: out, curves: 4, iterations: {QUICK[-1]}, device: cpu}}]"
        )
        yield path


ROOM = 200
"""Largest file [bytes]: less than any result."""

WRITING = {
    "vectorize": f"vectorize a.png -o a.svg {' '.join(QUICK)}",
    "refine": "refine drawing.svg a.png -o a.svg --device cpu --iterations 1",
    "render": "render drawing.svg -o a-large.png --scale 9",
}


@pytest.mark.parametrize("command", WRITING)
@pytest.mark.parametrize("limit", ["size of files", "permission"])
def test_a_result_that_cannot_be_written(forks: Forks, folder: Path, command: str, limit: str) -> None:
    before = sorted(os.listdir(folder))
    if limit == "permission":
        folder.chmod(0o555)
        code, out, err = forks.run(WRITING[command].split(), folder, rights=False)
        assert code == 2 and "ermission" in err
    else:
        code, out, err = forks.run(WRITING[command].split(), folder, file_size=ROOM)
        assert code == 4, err
    assert out == ""
    assert one_line(err).startswith("warpsplat: ")
    assert sorted(os.listdir(folder)) == before


def test_results_of_a_batch_that_cannot_be_written(forks: Forks, folder: Path) -> None:
    code, out, err = forks.run(["batch", "jobs.yaml"], folder, file_size=ROOM)
    assert code == 5 and "1 failed" in out and "Traceback" not in err
    assert os.listdir(folder / "out") == [MANIFEST]
    (folder / "out" / MANIFEST).unlink()
    (folder / "out").rmdir()
    folder.chmod(0o555)
    code, out, err = forks.run(["batch", "jobs.yaml"], folder, rights=False)
    assert code == 2 and out == "", "before any work"
    assert one_line(err).startswith("warpsplat: ")
    assert "jobs.yaml:1: " in err and "output" in err


@pytest.mark.parametrize("name", ["a.png", "drawing.svg"])
def test_an_input_without_permission(forks: Forks, folder: Path, name: str) -> None:
    (folder / name).chmod(0)
    code, _, err = forks.run(["eval", "a.png", "drawing.svg"], folder, rights=False)
    assert code == 3, err
    assert one_line(err).startswith("warpsplat: ")
    assert f"{name}: no permission" in err
