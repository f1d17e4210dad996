"""The documentation is right: its Python runs, its commands parse, its links and gallery are whole.

Python blocks that are whole programs are marked ``python``; fragments are marked ``py``.
"""

from __future__ import annotations

import importlib
import json
import re
import runpy
import shlex
import shutil
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

import click
import pytest
from PIL import Image

from tests import ROOT
from tests.needs import WHOLE
from tests.networks import stand_ins
from warpsplat.cli.main import COMMANDS, cli
from warpsplat.fit.settings import PRESETS
from warpsplat.run.options import KINDS
from warpsplat.svg.inspect import inspect_svg
from warpsplat.svg.viewer import render_svg

pytestmark = [pytest.mark.usefixtures("single_precision"), WHOLE]

PAGES = sorted([*ROOT.glob("*.md"), *ROOT.glob("docs/*.md")])
CAT = "docs/images/cat.jpg"
PHOTOGRAPHS = ("photo.jpg", "cat.jpg", CAT)
"""Names of one on the pages: the reader's own, the tutorial's copy, and the repository's."""

SMALL = (72, 64)
"""Pixels that it is reduced to, so that blocks are quick."""


def blocks(page: Path, language: str) -> list[str]:
    """Return the code of a page in a language, without the indentation of lists."""
    text = page.read_text("utf-8")
    found = re.findall(rf"^( *)```{language}\n(.*?)^\1```$", text, re.DOTALL | re.MULTILINE)
    return [re.sub(rf"^{indent}", "", code, flags=re.MULTILINE) for indent, code in found]


def with_code(language: str) -> list[object]:
    return [pytest.param(page, id=page.name) for page in PAGES if blocks(page, language)]


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A reader's folder: the pictures of the documentation, small; and runs are short."""
    (tmp_path / CAT).parent.mkdir(parents=True)
    for path in ROOT.glob("docs/images/sources/*"):
        shutil.copy(path, tmp_path)
    with Image.open(ROOT / CAT) as image:
        image.thumbnail(SMALL)
        for name in PHOTOGRAPHS:
            image.save(tmp_path / name)
    for name in PRESETS:
        monkeypatch.setitem(PRESETS, name, {"iterations": 30})
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize("page", with_code("python"))
def test_python_runs(page: Path, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Run the blocks of a page in order. Networks of others are small ones."""
    names: dict[str, object] = {"__name__": "__main__"}
    for number, block in enumerate(blocks(page, "python")):
        if "import torch" in block or "warpsplat.torch" in block:
            pytest.importorskip("torch").set_num_threads(1)  # several would wait for each other
            for name, module in stand_ins().items():
                monkeypatch.setitem(sys.modules, name, module)
        exec(compile(block, f"{page.name}, block {number}", "exec"), names)


@pytest.mark.parametrize("page", with_code("sh"))
def test_commands_parse(page: Path) -> None:
    """Each line of ``warpsplat``: its command and options are there and take such values."""
    for words in commands(page):
        assert words[1] in COMMANDS, " ".join(words)
        command = cli.get_command(click.Context(cli), words[1])
        assert command
        try:
            command.make_context(words[1], words[2:])
        except click.ClickException as error:
            pytest.fail(f"{' '.join(words)}: {error.format_message()}")


def commands(page: Path) -> Iterator[list[str]]:
    """Yield the words of each run of warpsplat."""
    for block in blocks(page, "sh"):
        for line in block.replace("\\\n", " ").splitlines():
            for part in line.split("&&"):
                words = shlex.split(part, comments=True)
                if words and Path(words[0]).name == "warpsplat":
                    yield words


def test_there_are_commands_to_parse() -> None:
    assert len([words for page in PAGES for words in commands(page)]) > 30


HERE = re.compile(
    r"https://(raw\.githubusercontent\.com/warpsplat/warpsplat|github\.com/warpsplat/warpsplat/(blob|tree))/main/"
)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_files_of_links_are_there(page: Path) -> None:
    """Links among the repository's files, by its host's name as well; those of made pages the site checks."""
    text = re.sub(r"```.*?```", "", page.read_text("utf-8"), flags=re.DOTALL)
    for link in re.findall(r"\]\(([^)\s#]+)", text):
        if HERE.match(link):
            assert (ROOT / HERE.sub("", link)).exists(), link
        elif ":" not in link:
            made = link in MADE and page.parent == ROOT / "docs"
            assert made or (page.parent / link).exists(), link


MADE = {
    *(f"notebooks/{path.stem}.md" for path in ROOT.glob("examples/*.ipynb")),
    "architecture.md",
    "changelog.md",
    "contributing.md",
    "commands.md",
    "gallery/index.md",
}
"""Pages that the site makes."""


def test_figures_are_drawn_from_the_renderer(tmp_path: Path) -> None:
    """All of them; the script holds its gradient against central differences."""
    runpy.run_path(str(ROOT / "docs" / "figures.py"))["main"](tmp_path)
    kept = ROOT / "docs" / "images" / "how"
    assert {path.name for path in tmp_path.iterdir()} == {path.name for path in kept.iterdir()}
    for path in tmp_path.iterdir():
        drawn, committed = (render_svg(each.read_text("utf-8")) for each in (path, kept / path.name))
        assert drawn.size == committed.size


@pytest.fixture(scope="module")
def records() -> Iterator[ModuleType]:
    """The records of the pages' figures, imported as the scripts beside it import it."""
    sys.path.insert(0, str(ROOT / "docs"))
    yield importlib.import_module("records")
    sys.path.remove(str(ROOT / "docs"))


def test_pages_show_their_records_and_say_when_these_are_old(records: ModuleType) -> None:
    """Also after a change of golden files: ``python docs/remake.py``, or ``--text``, which takes a second."""
    shown = {page.name: page.read_text("utf-8") for page in records.pages()}
    assert {"README.md", "index.md", "tutorial.md", "styles.md", "comparison.md"} <= {*shown}
    for name, text in shown.items():
        assert records.filled(text) == text, f"{name}: run python docs/remake.py"
        assert " {age} -->" in text, f"{name} does not say how old its figures are"


def test_pictures_are_those_of_their_records(records: ModuleType) -> None:
    pictures = importlib.import_module("pictures")
    for name in pictures.COMMANDS:
        group, _, rest = name.partition("/")
        assert records.read(group)[rest]["made_of"] == pictures.made_of(name), (
            f"python docs/pictures.py {name}"
        )


def test_a_record_is_old_when_golden_files_of_its_subject_change(
    records: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    digests = json.loads(records.GOLDEN.read_text("utf-8"))
    made = {name: records.stamp(name) for name in ("photo", "drawing", "line", "pixel", "refined")}
    assert len({record["golden"] for record in made.values()}) == len(made)
    monkeypatch.setattr(records, "GOLDEN", tmp_path / "digests.json")
    records.GOLDEN.write_text(json.dumps({**digests, "drawing": "another"}))
    assert [name for name, record in made.items() if not records.is_current(record)] == ["drawing"]
    assert "before the last change of results" in records.age(made.values())
    assert "before" not in records.age([made["photo"]])


OTHERS = {"pydiffvg.md"}
"""Pages that name the files of other programs."""

IMAGINED = "warpsplat/palette/"
"""The extension that CONTRIBUTING.md has readers write."""

REMOVED = re.compile(r"`[^`\n]+` \(since removed\)")
"""How the history of docs/experiments.md names what is gone."""

SOURCES = {
    path.relative_to(ROOT).as_posix(): path
    for folder in ("warpsplat", "cli", "kernels", "tests", "docs", "examples")
    for path in (ROOT / folder).rglob("*.py")
}

PACKAGES = {"torch", "pydiffvg"}
"""Folders that have the names of other packages."""

FOLDERS = "|".join({path.name for path in (ROOT / "warpsplat").iterdir() if path.is_dir()} - PACKAGES)


def defines(name: str) -> bool:
    """Whether ``fit.rounding.freeze_stage`` is a module of warpsplat, or a name in one."""
    folder, *rest = name.split(".")
    for end in range(len(rest), -1, -1):
        stem = "/".join(("warpsplat", folder, *rest[:end]))
        if file := SOURCES.get(f"{stem}.py") or SOURCES.get(f"{stem}/__init__.py"):
            text = file.read_text("utf-8")
            return all(re.search(rf"\b(def|class) {one}\b|\b{one}\b.* = ", text) for one in rest[end:])
    return False


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_files_and_modules_named_by_pages_exist(page: Path) -> None:
    """Source files, modules and names in them, and commands of the tests."""
    text = REMOVED.sub("", re.sub(r"```.*?```", "", page.read_text("utf-8"), flags=re.DOTALL))
    for file in re.findall(r"`([\w/]+\.py)\b[^`\n]*`", text) if page.name not in OTHERS else ():
        known = file.startswith(IMAGINED) or any(f"/{each}".endswith(f"/{file}") for each in SOURCES)
        assert known, file
    for name in re.findall(rf"`((?:{FOLDERS})(?:\.\w+)+)`", text):
        assert name.endswith(".py") or defines(name), name
    for module in re.findall(r"python -m (tests(?:\.\w+)*)", page.read_text("utf-8")):
        stem = module.replace(".", "/")
        assert {f"{stem}.py", f"{stem}/__main__.py"} & {*SOURCES}, module


DOCS = ROOT / "docs"


@pytest.fixture(scope="module")
def gallery() -> Iterator[ModuleType]:
    """The script, imported as the site's hooks import it."""
    if not (DOCS / "gallery" / "gallery.yaml").exists():
        pytest.skip("source distributions are without the gallery")
    sys.path.insert(0, str(DOCS))
    yield importlib.import_module("gallery")
    sys.path.remove(str(DOCS))


def test_each_image_has_an_author_a_licence_and_a_source(gallery: ModuleType) -> None:
    known, listed = gallery.licences(), gallery.entries()
    notices = (gallery.FOLDER / "NOTICES.txt").read_text("utf-8")
    assert len({entry.name for entry in listed}) == len(listed)
    for entry in listed:
        assert entry.title and entry.what and entry.author and entry.package
        assert entry.licence in known
        path = entry.image.relative_to(gallery.FOLDER).as_posix()
        assert (path in notices) == (entry.licence == "MIT")


def test_images_are_small_and_no_file_is_without_an_entry(gallery: ModuleType) -> None:
    listed = gallery.entries()
    for entry in listed:
        with Image.open(entry.image) as image:
            assert max(image.size) <= 512, entry.name
    files = {path for folder in ("images", "records") for path in (gallery.FOLDER / folder).rglob("*.*")}
    assert files == {path for entry in listed for path in (entry.image, entry.svg, entry.record)}
    assert sum(path.stat().st_size for path in files) < 5_000_000


def test_records_belong_to_the_files(gallery: ModuleType) -> None:
    for entry in gallery.entries():
        record = entry.figures()
        svg = entry.svg.read_bytes()
        made_of = {**entry.inputs(), "svg": gallery.digest(svg)}
        assert {key: record["made_of"][key] for key in made_of} == made_of, entry.name
        assert record["bytes"] == len(svg)
        assert record["shapes"] > 0
        assert record["subject"] == entry.subject, entry.name
        lengths = {len(column) for column in record["history"].values()}
        assert len(lengths) == 1 and max(lengths) <= gallery.MOST_POINTS
        inspect_svg(svg.decode())


def test_commands_say_the_settings(gallery: ModuleType) -> None:
    command = cli.get_command(click.Context(cli), "vectorize")
    assert command
    for entry in gallery.entries():
        _, name, image, *words = shlex.split(entry.command)
        assert (name, image) == ("vectorize", entry.image.name)
        given = command.make_context("vectorize", [str(entry.image), *words]).params
        for key, value in entry.settings.items():
            if key in KINDS:
                assert given[key] is True, entry.name
            else:
                assert given[key] == type(given[key])(value), (entry.name, key)
