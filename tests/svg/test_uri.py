"""Data URIs: what browsers decode is the file."""

from __future__ import annotations

from urllib.parse import unquote
from xml.etree import ElementTree

import pytest

from tests.drawing.drawings import logo
from warpsplat.svg.uri import data_uri
from warpsplat.svg.write import minified, write_svg

KIND = "data:image/svg+xml,"


@pytest.mark.parametrize("title", ["", 'A <b> & "c" 100% #1 ä\u2028', "it's"])
def test_a_uri_holds_the_file(title: str) -> None:
    text = minified(write_svg(logo().scene, title=title))
    uri = data_uri(text)
    assert uri.startswith(KIND)
    assert uri.isascii()
    assert not set('"<>#\n\\{}|^`') & set(uri)
    got, want = (ElementTree.tostring(ElementTree.fromstring(t)) for t in (unquote(uri[len(KIND) :]), text))
    assert got == want
    if not title:
        assert len(uri) < 1.15 * len(text)
