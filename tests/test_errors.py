"""Words of messages."""

from __future__ import annotations

import re

import pytest

from tests import ROOT
from warpsplat.errors import counted


@pytest.mark.parametrize(("number", "words"), [(0, "0 paths"), (1, "1 path"), (2, "2 paths")])
def test_plurals(number: int, words: str) -> None:
    assert counted(number, "path") == words


NOUNS = "paths|images|nodes|shapes|results|colours|workers|iterations|steps|threads|strokes|layers"

PLURAL = re.compile(rf"""\{{[^{{}}"']+(?:\[["']\w+["']\])?\}} (?:{NOUNS})\b""")

OF_AT_LEAST_TWO = {
    "MAX_LINKED",
    "two.shapes:,",
    "MOST_COLOR_COUNT",
    "worth.most:,",
    "space",
    "len(found)",
    "counts[output]",
    "len(curves)",
    "len(images)",
}
"""Limits, and numbers that messages speak of only if there are several."""


def test_no_message_counts_one_in_the_plural() -> None:
    """``{number} paths`` says "1 paths"."""
    sources = [
        *ROOT.glob("warpsplat/**/*.py"),
        *ROOT.glob("cli/*.py"),
        *ROOT.glob("warpsplat/pages/assets/*.js"),
    ]
    found = [match for path in sources for match in PLURAL.findall(path.read_text("utf-8"))]
    named = {match[1:].partition("}")[0] for match in found}
    assert named <= OF_AT_LEAST_TWO
