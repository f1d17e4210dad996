"""Batches whose results are no SVGs."""

from __future__ import annotations

from pathlib import Path

import pytest
from PIL import Image

from tests.batch.helpers import Answers, write
from tests.cli.helpers import run
from warpsplat.batch.manifest import NAME, entry_of
from warpsplat.batch.plan import plan_jobs
from warpsplat.files.marks import mark_dxf, mark_eps, mark_pdf, mark_png, picture_key
from warpsplat.files.output import may_replace

SMALL = ("--curves", "3", "--iterations", "3", "--device", "cpu")


def kept(folder: Path) -> dict[str, tuple[bytes, int]]:
    return {path.name: (path.read_bytes(), path.stat().st_mtime_ns) for path in folder.glob("[ab].*")}


@pytest.mark.parametrize(("other", "package"), [("pdf", "typst"), ("dxf", "ezdxf"), ("eps", "")])
def test_pictures_are_made_once_with_and_without_a_manifest(
    other: str, package: str, folder: Path, capsys: pytest.CaptureFixture[str], batch: Answers
) -> None:
    if package:
        pytest.importorskip(package)
    images = [folder / "in" / name for name in ("a.png", "b.png")]
    ending = {"a": "png", "b": other}
    write(
        folder,
        "\n".join(
            ["jobs:", *(f"- {{images: {i}, output: 'out/{i.stem}.{ending[i.stem]}'}}" for i in images)]
        ),
    )
    arguments = ("batch", folder / "jobs.yaml", *SMALL)
    assert run(*arguments) == 0
    assert "kB gzipped) as an SVG" in capsys.readouterr().out
    made = kept(folder / "out")
    assert sorted(made) == ["a.png", f"b.{other}"]
    with Image.open(folder / "out" / "a.png") as shown, Image.open(images[0]) as given:
        assert shown.size == given.size
    notes = folder / "out" / NAME
    lines = notes.read_bytes().splitlines(keepends=True)
    entries = [entry for line in lines if (entry := entry_of(line))]
    assert {picture_key(data) for data, _ in made.values()} == {entry.key for entry in entries}

    notes.write_bytes(
        b"".join(line for line in lines if b'"writing"' in line)
    )  # killed before that was noted
    found, totals = batch(*arguments)
    assert totals["skipped"] == 2
    assert all(image["psnr"] > 5 for image in found)

    notes.unlink()
    assert batch(*arguments)[1]["skipped"] == 2, "they say themselves what they were made of"
    assert kept(folder / "out") == made

    torn = folder / "out" / "a.png"
    torn.write_bytes(torn.read_bytes()[:-10])
    assert batch(*arguments, "--json", "--seed", "1")[1]["made"] == 2


def test_pictures_of_others_stay(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    theirs = folder / "out" / "a.png"
    theirs.parent.mkdir()
    Image.new("RGB", (9, 9)).save(theirs)
    before = theirs.read_bytes()
    arguments = ("batch", folder / "in" / "a.png", "-o", folder / "out" / "{stem}.png", *SMALL)
    assert run(*arguments) == 2
    assert "--overwrite replaces them" in capsys.readouterr().err
    assert theirs.read_bytes() == before
    assert run(*arguments, "--overwrite", "-q") == 0
    assert may_replace(theirs)


def test_no_result_replaces_an_input(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
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
        assert run("batch", *case, "--overwrite") == 2
        assert "would be overwritten by" in capsys.readouterr().err


def test_results_beside_the_images_are_no_images(folder: Path, batch: Answers) -> None:
    (folder / "in" / "broken.png").unlink()
    arguments = (
        "batch",
        folder / "in" / "*.png",
        "-o",
        folder / "in" / "{stem}-3.png",
        *SMALL,
        "--minify",
        "--json",
    )
    for status in ("made", "skipped"):
        assert batch(*arguments)[1][status] == 2
    assert sorted(path.name for path in (folder / "in").glob("*.png")) == [
        "a-3.png",
        "a.png",
        "b-3.png",
        "b.png",
    ]
    assert len(plan_jobs([str(folder / "in" / "a-3.png")])) == 1, "unless it is named itself"


def test_a_key_is_that_of_a_whole_picture(tmp_path: Path) -> None:
    path = tmp_path / "a.png"
    Image.new("RGB", (5, 4)).save(path)
    plain = path.read_bytes()
    png, pdf = mark_png(plain, "aB3._x9Z"), mark_pdf(b"%PDF-1.7\n%%EOF", "aB3._x9Z")
    dxf = mark_dxf(b"  0\nSECTION\n  0\nENDSEC\n  0\nEOF\n", "aB3._x9Z")
    eps = mark_eps(b"%!PS-Adobe-3.0 EPSF-3.0\n%%EOF\n", "aB3._x9Z")
    assert {picture_key(data) for data in (png, pdf, dxf, eps)} == {"aB3._x9Z"}
    for data in (
        b"",
        plain,
        mark_png(plain),
        png[:-1],
        pdf[:-1],
        pdf + b"x",
        dxf[:-1],
        eps[:-1],
        mark_pdf(b"%PDF-1.7"),
        b"\x89PNG",
    ):
        assert picture_key(data) == ""
    path.write_bytes(png)
    with Image.open(path) as image:
        image.load()
        assert image.info["Software"] == "warpsplat aB3._x9Z"
