"""Help in groups, and what shells complete."""

from __future__ import annotations

import click
import pytest

from tests.cli.helpers import Cli, run
from warpsplat.cli.help import GroupedCommand
from warpsplat.cli.main import COMMANDS, cli
from warpsplat.svg.page import MILLIMETRES, PAGES

MANY = ("vectorize", "refine", "batch")
"""Commands with many options."""


@pytest.mark.parametrize("name", COMMANDS)
def test_help(name: str, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    """Of many options, twelve or so are explained, all are named, and ``--help-all`` explains each once."""
    monkeypatch.setenv("COLUMNS", "80")
    texts = []
    for flag in ("--help", "--help-all") if name in MANY else ("--help",):
        assert run(name, flag) == 0
        texts.append(capfd.readouterr().out)
        assert max(map(len, texts[-1].splitlines())) < 80
    command = cli.get_command(click.Context(cli), name)
    assert command
    flags = [p for p in command.get_params(click.Context(command)) if isinstance(p, click.Option)]
    assert all(each.opts[-1] in texts[0] for each in flags)
    assert isinstance(command, GroupedCommand) == (name in MANY) == (len(flags) > 20)
    short, every = (" ".join(text.split()) for text in (texts[0], texts[-1]))
    help_of = {each.opts[-1]: " ".join((each.help or "").split()) for each in flags}
    assert all(words in every for words in help_of.values())
    if name in MANY:
        assert short.endswith(f"warpsplat {name} --help-all explains all options.")
        common = [each.opts[-1] for each in flags if getattr(each, "common", False)]
        assert [flag for flag, words in help_of.items() if words in short] == common
        assert 5 <= len(common) <= 14


COMPLETED = {
    "vec": {"vectorize", "file"},
    "vectorize ph": {"file"},
    "vectorize --qual": {"--quality"},
    "vectorize --quality ": {"draft", "balanced", "high"},
    "vectorize --preset st": {"stained-glass", "stencil", "file"},
    "vectorize --shape c": {"circle"},
    "vectorize --palette n": {"file", "navy"},
    "vectorize --background n": {"none", "navy"},
    "vectorize --page ": set(PAGES),
    "vectorize --units ": set(MILLIMETRES),
    "vectorize --device c": {"cpu", "cuda:0"},
    "batch in": {"file"},
    "batch --set density.st": {"density.start=", "density.stop="},
    "render --renderer e": {"exact"},
}
"""Beginnings of command lines, and what completes them."""


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_completion(shell: str, monkeypatch: pytest.MonkeyPatch, cli: Cli) -> None:
    monkeypatch.setenv("_WARPSPLAT_COMPLETE", f"{shell}_source")
    assert "_warpsplat_completion" in cli().out
    monkeypatch.setenv("_WARPSPLAT_COMPLETE", f"{shell}_complete")
    for line, wanted in COMPLETED.items():
        words = f"warpsplat {line}".split(" ")
        monkeypatch.setenv("COMP_WORDS", f"warpsplat {line}")
        monkeypatch.setenv("COMP_CWORD", words[-1] if shell == "fish" else f"{len(words) - 1}")
        lines = cli().out.splitlines()
        rows = [line.split("\t")[0].split(",") for line in lines]
        found = rows if shell != "zsh" else [[a, b] for [a], [b] in zip(rows[::3], rows[1::3], strict=True)]
        assert {value if kind == "plain" else kind for kind, value in found} == wanted
