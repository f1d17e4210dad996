"""The list of smoke tests names what there is."""

from __future__ import annotations

from tests import ROOT
from tests.needs import needs_missing
from tests.smoke import NAMES


def test_the_list_names_what_there_is() -> None:
    for name in NAMES:
        path, _, test = name.partition("::")
        place = ROOT / path
        if not needs_missing(place):
            assert place.exists(), name
            assert not test or f"\ndef {test.partition('[')[0]}" in place.read_text(encoding="utf-8"), name
