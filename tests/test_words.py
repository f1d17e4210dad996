"""One word for one thing (docs/words.md), in what the program says of itself."""

from __future__ import annotations

import inspect
import re

import click
import pytest

import warpsplat
from tests import ROOT
from warpsplat.cli.main import COMMANDS, cli
from warpsplat.run.options import OPTIONS

OTHERWISE = re.compile(r"(?<![-\w`])(?<!zier )(?<!quadratic )(?<!cubic )curves?\b(?![=:`])")
"""``curve`` in another meaning than that of a piece of an outline, and not as the name of the flag."""


def check(text: str) -> None:
    text = re.sub(r"^ *curves: .*$|\{curves\}", "", text, flags=re.MULTILINE)  # of settings and arguments
    found = [text[max(0, m.start() - 30) : m.end() + 10] for m in OTHERWISE.finditer(text)]
    assert not found


@pytest.mark.parametrize("name", COMMANDS)
def test_help(name: str) -> None:
    command = cli.get_command(click.Context(cli), name)
    assert command
    check(command.get_help(click.Context(command)))


def test_options_and_the_library() -> None:
    for option in OPTIONS:
        check(option.help)
    for public in ("vectorize", "refine", "render", "load_svg", "save_svg", "score", "Result", "Scene"):
        check(inspect.getdoc(getattr(warpsplat, public)) or "")


@pytest.mark.parametrize("page", ["README.md", "docs/index.md", "docs/tutorial.md", "docs/benchmarks.md"])
def test_pages(page: str) -> None:
    text = (ROOT / page).read_text("utf-8")
    check(re.sub(r"```.*?```|`[^`\n]*`", "", text, flags=re.DOTALL))


def test_what_it_would_find() -> None:
    for text in ("512 closed curves", "the curves that move", "Curves are fitted.".lower()):
        with pytest.raises(AssertionError):
            check(text)
    check("--curves 5, curves=5, Bézier curves, quadratic curves")
