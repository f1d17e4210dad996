"""Whatever texts a page gets stay texts."""

from __future__ import annotations

import re
from urllib.parse import unquote_to_bytes

import pytest
from hypothesis import given
from hypothesis import strategies as st
from jinja2 import ChoiceLoader, DictLoader, UndefinedError

from tests.pages.helpers import NASTY, Tags
from warpsplat.files.marks import PAGE_MARK
from warpsplat.pages import environment
from warpsplat.pages.environment import MARK, page

SOURCE = """{% extends "base.html.j2" %}{% block title %}{{ name }}{% endblock %}
{% block main %}<p id="it" title="{{ name }}">{{ name }}</p><a href="{{ name|address }}">x</a>
<script type="application/json" id="data">{{ {"name": name}|tojson }}</script>{% endblock %}"""


@pytest.fixture(scope="module", autouse=True)
def template() -> None:
    made = environment.environment()
    assert made.loader
    made.loader = ChoiceLoader([DictLoader({"test.html.j2": SOURCE}), made.loader])


def made(name: str) -> Tags:
    return Tags(page("test.html.j2", assets=("viewer.css", "viewer.js"), name=name))


TEXTS = st.text(alphabet=st.characters(codec="utf-8") | st.sampled_from("<>\"'&/{}%"), max_size=40)


@given(st.sampled_from(NASTY) | TEXTS)
def test_texts_add_no_element_and_no_attribute(name: str) -> None:
    nasty, plain = made(name), made("plain")
    assert nasty.tags == plain.tags
    assert nasty.attributes == plain.attributes
    link = nasty.links[-1]
    assert not re.search(r"[^\w./%~-]", link)
    assert unquote_to_bytes(link) == name.encode("utf-8", "surrogateescape")


def test_a_page_loads_nothing_from_elsewhere() -> None:
    """Only our scripts run, nothing is loaded from elsewhere, and the mark is near the start."""
    text = page("test.html.j2", assets=("viewer.css", "viewer.js"), name="x")
    assert "default-src &#39;none&#39;" in text and "script-src &#39;sha256-" in text
    assert "connect-src" not in text
    assert "connect-src" in page("test.html.j2", connects=True, name="x")
    assert MARK.encode() == PAGE_MARK and PAGE_MARK in text.encode()[:2000]
    assert not re.findall(r"(?:src|href)=[\"'](?!data:|#|x)", text)


def test_a_missing_value_is_an_error() -> None:
    with pytest.raises(UndefinedError):
        page("test.html.j2")
