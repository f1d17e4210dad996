"""The gallery's list, files and records belong together; nothing is trained."""

from __future__ import annotations

import importlib
import shlex
import sys
from collections.abc import Iterator
from types import ModuleType

import click
import pytest
from PIL import Image

from tests import ROOT
from tests.needs import WHOLE
from warpsplat.cli.main import cli
from warpsplat.run.options import KINDS
from warpsplat.svg.inspect import inspect_svg

DOCS = ROOT / "docs"
pytestmark = [
    WHOLE,
    pytest.mark.skipif(
        not (DOCS / "gallery" / "gallery.yaml").exists(),
        reason="source distributions are without the gallery",
    ),
]


@pytest.fixture(scope="module")
def gallery() -> Iterator[ModuleType]:
    """The script, imported as the site's hooks import it."""
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
