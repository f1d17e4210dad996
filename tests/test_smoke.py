"""The list of smoke tests names what there is."""

from __future__ import annotations

import ast

import pytest

from tests import ROOT
from tests.needs import needs_missing
from tests.smoke import NAMES


@pytest.mark.parametrize("name", NAMES)
def test_the_list_names_what_there_is(name: str) -> None:
    path, _, test = name.partition("::")
    place = ROOT / path
    if needs_missing(place):
        pytest.skip("an extension that is not there")
    assert place.exists()
    if test:
        tree = ast.parse(place.read_text(encoding="utf-8"))
        names = [node.name for node in tree.body if isinstance(node, ast.FunctionDef)]
        assert any(found.startswith(test.partition("[")[0]) for found in names)
