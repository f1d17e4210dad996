"""``warpsplat inkscape``, and the script that it installs: what it adds to a document, and what it says."""

from __future__ import annotations

import re
import sys
from pathlib import Path
from typing import get_args
from urllib.parse import quote
from xml.etree import ElementTree

import numpy as np
import pytest

from tests.cli.helpers import Cli
from tests.cli.helpers import run as cli_run
from tests.inkscape.helpers import PICTURE, SIZED, document, pixels, run, script, without_images
from warpsplat.fit.settings import Subject
from warpsplat.inkscape import command
from warpsplat.inkscape.command import FILES, SCRIPT, SOURCE

SVG = "{http://www.w3.org/2000/svg}"
CLIP = '<clipPath id="c"><circle cx="30" cy="30" r="22"/></clipPath>'


def image(more: str = "", name: str = "i") -> str:
    return f'<image id="{name}" x="8" y="12" width="60" height="40" {more} HREF/>'


@pytest.fixture
def stand_in(tmp_path: Path) -> Path:
    """The script, with a program in place of warpsplat that makes ``PICTURE`` of anything."""
    program = tmp_path / "program.py"
    program.write_text(f"import sys\nassert sys.stdin.buffer.read(4) == b'\\x89PNG'\nprint({PICTURE!r})")
    return script(tmp_path, str(program))


def changed(stand_in: Path, text: str, *ids: str) -> str:
    """The document with the vectors of its images."""
    path = stand_in.parent / "document.svg"
    path.write_text(text, "utf-8")
    done = run(stand_in, path, *(f"--id={one}" for one in ids))
    assert (done.returncode, done.stderr) == (0, b"")
    return done.stdout.decode()


PLACES = {
    "as it is": (image(), SIZED),
    "units": (
        '<image id="i" x="2mm" y=".25in" width="40%" height="36pt" preserveAspectRatio="none" HREF/>',
        'width="50mm" height="40mm"',
    ),
    "percentages of a nested view": (
        '<svg x="20" y="10" width="60" height="60" viewBox="0 0 200 100">'
        '<image id="i" x="10%" y="10%" width="80%" height="80%" HREF/></svg>',
        SIZED,
    ),
    "its own pixels": ('<image id="i" x="1" HREF/>', 'width="200" height="150"'),
    "its own proportions": ('<image id="i" y="4" height="30" HREF/>', SIZED),
    "in a taller box": ('<image id="i" width="60" height="90" HREF/>', SIZED),
    "at an edge": ('<image id="i" width="30" height="90" preserveAspectRatio="xMinYMax" HREF/>', SIZED),
    "distorted": ('<image id="i" width="30" height="90" preserveAspectRatio="none" HREF/>', SIZED),
    "filling a box": (
        '<image id="i" x="9" y="5" width="40" height="70" preserveAspectRatio="xMaxYMid slice" HREF/>',
        SIZED,
    ),
    "transformed in a group": (
        f'<g transform="rotate(20) scale(.9 1.1)">{image("""transform="skewX(9)" """)}</g>',
        SIZED,
    ),
    "clipped": (CLIP + image('transform="scale(1.3)" clip-path="url(#c)"'), SIZED),
    "translucent": (image('opacity=".6" style="opacity:.4"'), SIZED),
    "under other defaults": (f'<g fill="#0ff" stroke="#0f0" stroke-width="9">{image()}</g>', SIZED),
}


@pytest.mark.parametrize("place", PLACES)
def test_vectors_are_where_the_image_is(stand_in: Path, place: str) -> None:
    text = document(*PLACES[place])
    made = changed(stand_in, text, "i")
    assert made.index("<image") < made.index('id="i-vectors"')
    there = pixels(text)
    error, all_of_it = (np.abs(pixels(without_images(one)) - there).mean() for one in (made, text))
    # The edges, softer in the bitmap: at most 0.007 of it. A shift by one unit: at least 0.013.
    assert error < 0.01 * all_of_it


def test_several_images_keep_their_identifiers_apart(stand_in: Path) -> None:
    """All of those in a group; and what else is in the document stays."""
    rest = (
        '<!-- note --><other:data xmlns:other="http://other" other:of="1"/><text id="i-vectors9">a  b</text>'
    )
    text = document(f'<g id="both">{image()}{image(name="j")}</g>{image(name="k")}{rest}')
    made = changed(stand_in, text, "both", "i")
    root = ElementTree.fromstring(made)
    names = [element.get("id") for element in root.iter() if element.get("id")]
    assert len(names) == len(set(names))
    gradients = [element.get("id") for element in root.iter(f"{SVG}linearGradient")]
    used = re.findall(r'fill="url\(#(.*?)\)"', made)
    assert used == gradients == ["i-vectors2-g0", "j-vectors-g0"]
    assert [child.get("id") for child in root[0]] == ["i", "i-vectors2", "j", "j-vectors"]
    assert made.count("<image") == 3
    for part in ("<!-- note -->", "<other:data", 'other:of="1"', ">a  b<", "xlink:href="):
        assert part in made


@pytest.mark.parametrize("link", ["100%25%20b.png", "../ä ö/100%25%20b.png", "file://FOLDER/100%25%20b.png"])
def test_linked_files(stand_in: Path, link: str) -> None:
    """From the document, or from the copy that Inkscape makes for the run."""
    folder = stand_in.parent / "ä ö"
    (folder / "of it").mkdir(parents=True)
    (folder / "100% b.png").write_bytes(b"\x89PNG")
    link = link.replace("FOLDER", quote(str(folder)))
    text = document(f'<image id="i" width="9" height="9" xlink:href="{link}"/>')
    paths = [folder / "a.svg", folder / "of it" / "b.svg"]
    for path, original in (paths, paths[::-1]):
        path.write_text(text, "utf-8")
        assert b'id="i-vectors"' in run(stand_in, path, "--id=i", original=original).stdout


FAILURES = {
    "nothing selected": ('<rect id="i"/>', "Select a bitmap first"),
    "no file": ('<image id="i" xlink:href="none.png"/>', "i: there is no file none.png"),
    "a broken file": ('<image id="i" xlink:href="data:image/png;base64,abcde"/>', "i: "),
    "a unit": ('<image id="i" y="6em" HREF/>', "i: 6em is no length"),
}


@pytest.mark.parametrize("failure", FAILURES)
def test_failures_are_reported_and_change_nothing(stand_in: Path, failure: str) -> None:
    inner, message = FAILURES[failure]
    path = stand_in.parent / "document.svg"
    path.write_text(document(image(name="first") + inner), "utf-8")
    done = run(stand_in, path, *([] if failure == "nothing selected" else ["--id=first"]), "--id=i")
    assert done.returncode
    assert done.stdout == b""
    assert message in done.stderr.decode()
    assert len(done.stderr.splitlines()) == 1


def test_warpsplat_itself(tmp_path: Path) -> None:
    """With all that can be chosen; what it cannot do is said in its own words."""
    path = tmp_path / "document.svg"
    path.write_text(document(image()), "utf-8")
    installed = script(tmp_path)
    chosen = ("--subject=drawing", "--colors=3", "--time-budget=30", "--id=i")
    done = run(installed, path, *chosen)
    assert (done.returncode, done.stderr) == (0, b"")
    text = document(image())
    assert np.abs(pixels(without_images(done.stdout.decode())) - pixels(text)).mean() < 12
    path.write_text(document('<image id="i" xlink:href="document.svg"/>'), "utf-8")
    done = run(installed, path, "--id=i")
    assert (done.returncode, done.stdout) == (1, b"")
    assert done.stderr.startswith(b"i: warpsplat: ")


def test_a_program_that_is_gone(tmp_path: Path) -> None:
    path = tmp_path / "document.svg"
    path.write_text(document(image()), "utf-8")
    moved = script(tmp_path)
    moved.write_text(moved.read_text("utf-8").replace(sys.executable, "/gone/python"), "utf-8")
    done = run(moved, path, "--id=i")
    assert done.stdout == b""
    assert b"/gone/python" in done.stderr


def test_it_is_installed_and_removed(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    folder = tmp_path / "new" / "extensions"
    for _ in range(2):
        assert cli_run("inkscape", "--folder", folder) == 0
    assert str(folder) in capfd.readouterr().out
    assert sorted(path.name for path in folder.iterdir()) == sorted(FILES)
    text = (folder / SCRIPT).read_text("utf-8")
    assert f"COMMAND = {[sys.executable, '-m', 'warpsplat']!a}\n" in text
    assert len(text.splitlines()) == len((SOURCE / SCRIPT).read_text("utf-8").splitlines())
    (folder / "other.py").touch()
    assert cli_run("inkscape", "--folder", folder, "--remove") == 0
    assert [path.name for path in folder.iterdir()] == ["other.py"]


def test_foreign_files_are_not_replaced_or_removed(tmp_path: Path, cli: Cli) -> None:
    other = tmp_path / FILES[1]
    other.write_text("another")
    for words in ((), ("--remove",)):
        said = cli("inkscape", "--folder", tmp_path, *words, code=2).line
        assert f"{other}: not a file of warpsplat" in said
    assert [(path.name, path.read_text()) for path in tmp_path.iterdir()] == [(FILES[1], "another")]


def test_from_a_sandbox(tmp_path: Path) -> None:
    path = tmp_path / ".var/app/org.inkscape.Inkscape" / SCRIPT
    assert b"COMMAND = ['flatpak-spawn', '--host', " in command.content(path)


def test_the_folder_without_inkscape(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setenv("APPDATA", str(tmp_path))
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    assert command.data_folder().name == "inkscape"


def test_the_dialog_offers_all_subjects() -> None:
    """Its parameters become arguments of the script, by their names."""
    root = ElementTree.parse(SOURCE / FILES[1]).getroot()
    space = root.tag.partition("}")[0] + "}"
    assert [option.get("value") for option in root.iter(f"{space}option")] == [*get_args(Subject)]
    script = (SOURCE / SCRIPT).read_text("utf-8")
    for parameter in root.iter(f"{space}param"):
        assert f'"--{parameter.get("name")}"' in script
    assert root.findtext(f"{space}script/{space}command") == SCRIPT
