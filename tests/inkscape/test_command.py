"""``warpsplat inkscape``: what is put where, and what is left alone."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import get_args
from xml.etree import ElementTree

import pytest

from tests.cli.helpers import Cli, run
from warpsplat.fit.settings import Subject
from warpsplat.inkscape import command
from warpsplat.inkscape.command import FILES, SCRIPT, SOURCE


def test_it_is_installed_and_removed(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    folder = tmp_path / "new" / "extensions"
    for _ in range(2):
        assert run("inkscape", "--folder", folder) == 0
    assert str(folder) in capfd.readouterr().out
    assert sorted(path.name for path in folder.iterdir()) == sorted(FILES)
    text = (folder / SCRIPT).read_text("utf-8")
    assert f"COMMAND = {[sys.executable, '-m', 'warpsplat']!a}\n" in text
    assert len(text.splitlines()) == len((SOURCE / SCRIPT).read_text("utf-8").splitlines())
    (folder / "other.py").touch()
    assert run("inkscape", "--folder", folder, "--remove") == 0
    assert [path.name for path in folder.iterdir()] == ["other.py"]


def test_files_of_others_stay(tmp_path: Path, cli: Cli) -> None:
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


def test_the_dialog_offers_what_there_is() -> None:
    """Its parameters become arguments of the script, by their names."""
    root = ElementTree.parse(SOURCE / FILES[1]).getroot()
    space = root.tag.partition("}")[0] + "}"
    assert [option.get("value") for option in root.iter(f"{space}option")] == [*get_args(Subject)]
    script = (SOURCE / SCRIPT).read_text("utf-8")
    for parameter in root.iter(f"{space}param"):
        assert f'"--{parameter.get("name")}"' in script
    assert root.findtext(f"{space}script/{space}command") == SCRIPT
