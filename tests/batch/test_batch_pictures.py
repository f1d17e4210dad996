"""Batches whose results are no SVGs."""

from __future__ import annotations

from pathlib import Path

import pytest
from PIL import Image

from tests.batch.helpers import Answers, write
from tests.cli.helpers import Cli, run
from warpsplat.batch.manifest import NAME, entry_of
from warpsplat.batch.plan import plan_jobs
from warpsplat.files.marks import picture_key
from warpsplat.files.output import may_replace

SMALL = ("--curves", "3", "--iterations", "3", "--device", "cpu")


def kept(folder: Path) -> dict[str, tuple[bytes, int]]:
    return {path.name: (path.read_bytes(), path.stat().st_mtime_ns) for path in folder.glob("[ab].*")}


@pytest.mark.parametrize(("other", "package"), [("pdf", "typst"), ("dxf", "ezdxf"), ("eps", "")])
def test_pictures_are_made_once_with_and_without_a_manifest(
    other: str, package: str, folder: Path, cli: Cli, batch: Answers
) -> None:
    if package:
        pytest.importorskip(package)
    images = [folder / "in" / name for name in ("a.png", "b.png")]
    ending = {"a": "png", "b": other}
    jobs = (f"- {{images: {i}, output: 'out/{i.stem}.{ending[i.stem]}'}}" for i in images)
    write(folder, "\n".join(["jobs:", *jobs]))
    arguments = ("batch", folder / "jobs.yaml", *SMALL)
    assert "kB gzipped) as an SVG" in cli(*arguments).out
    made = kept(folder / "out")
    assert sorted(made) == ["a.png", f"b.{other}"]
    with Image.open(folder / "out" / "a.png") as shown, Image.open(images[0]) as given:
        assert shown.size == given.size
    notes = folder / "out" / NAME
    lines = notes.read_bytes().splitlines(keepends=True)
    entries = [entry for line in lines if (entry := entry_of(line))]
    assert {picture_key(data) for data, _ in made.values()} == {entry.key for entry in entries}

    # Killed before that was noted.
    notes.write_bytes(b"".join(line for line in lines if b'"writing"' in line))
    found, totals = batch(*arguments)
    assert totals["skipped"] == 2
    assert all(image["psnr"] > 5 for image in found)

    notes.unlink()
    again = (*arguments, "--overwrite")  # or who made what is left of a torn PDF is unknown
    assert batch(*again)[1]["skipped"] == 2, "they say themselves what they were made of"
    assert kept(folder / "out") == made

    for path in (folder / "out").glob("[ab].*"):
        path.write_bytes(path.read_bytes()[:-10])
    assert batch(*again)[1]["made"] == 2, "none is whole"


def test_foreign_pictures_are_not_replaced(folder: Path, cli: Cli) -> None:
    theirs = folder / "out" / "a.png"
    theirs.parent.mkdir()
    Image.new("RGB", (9, 9)).save(theirs)
    before = theirs.read_bytes()
    arguments = ("batch", folder / "in" / "a.png", "-o", folder / "out" / "{stem}.png", *SMALL)
    assert "--overwrite replaces them" in cli(*arguments, code=2).err
    assert theirs.read_bytes() == before
    assert run(*arguments, "--overwrite", "-q") == 0
    assert may_replace(theirs)


def test_no_result_replaces_an_input(folder: Path, cli: Cli) -> None:
    """Not even with --overwrite: neither the image of another job nor a mask."""
    inside = folder / "in"
    mask = inside / "m.PNG"
    for path in (inside / "a.jpg", mask):
        path.write_bytes(b"")
    cases = (
        (inside / "a.png", inside / "a.jpg", "-o", inside / "{stem}.png"),
        (inside / "a.png", "-o", mask, "--importance", mask),
    )
    for case in cases:
        assert "would be overwritten by" in cli("batch", *case, "--overwrite", code=2).err


def test_results_beside_the_images_are_no_images(folder: Path, batch: Answers) -> None:
    (folder / "in" / "broken.png").unlink()
    output = ("-o", folder / "in" / "{stem}-3.png", "--minify")
    arguments = ("batch", folder / "in" / "*.png", *output, *SMALL)
    for status in ("made", "skipped"):
        assert batch(*arguments)[1][status] == 2
    assert len([*(folder / "in").glob("*.png")]) == 4
    assert len(plan_jobs([str(folder / "in" / "a-3.png")])) == 1, "unless it is named itself"
