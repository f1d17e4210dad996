"""The option ``--report``; and whatever texts a page gets stay texts."""

from __future__ import annotations

import re
from pathlib import Path
from urllib.parse import unquote_to_bytes

import pytest
from hypothesis import given
from hypothesis import strategies as st
from jinja2 import ChoiceLoader, DictLoader, UndefinedError

from tests.cli.helpers import QUICK, Cli, one_line, run
from tests.pages.helpers import NASTY, Tags
from warpsplat.files.marks import HEAD, is_marked
from warpsplat.pages import environment
from warpsplat.pages.environment import MARK, page


def test_vectorize_refine_and_eval(image: Path, tmp_path: Path, cli: Cli) -> None:
    svg, page = tmp_path / "a.svg", tmp_path / "a.html"
    said = cli("vectorize", image, "-o", svg, "--report", page, "--json", *QUICK).values
    assert said["report"] == str(page)
    text = page.read_text("utf-8")
    assert MARK in text and "photo.png" in text
    words = re.findall("<span>(.*?)</span>", text[text.index('id="command"') :])
    assert words[:2] == ["warpsplat", "vectorize"] and words[3:7] == ["--curves", "8", "--iterations", "12"]
    better = tmp_path / "b.svg"
    arguments = ("-o", better, "--iterations", "5", "--device", "cpu", "--report", page, "-q")
    assert run("refine", svg, image, *arguments) == 0  # our page may be replaced
    assert "<span>refine</span>" in page.read_text("utf-8") and "PSNR before" in page.read_text("utf-8")
    assert cli("eval", image, svg, "--report", page, "--json").values["report"] == str(page)
    assert "<span>refine</span>" not in page.read_text("utf-8")


@pytest.mark.parametrize("place", ["photo.png", "a.svg", "a.txt", "-", "other.html", "no/a.html"])
def test_invalid_places_of_a_report(
    place: str, image: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "other.html").write_text("<p>mine</p>")
    path = place if place == "-" else tmp_path / place
    before = image.read_bytes()
    assert run("vectorize", image, "-o", tmp_path / "a.svg", "--report", path, *QUICK) == 2
    one_line(capfd.readouterr().err)
    assert not (tmp_path / "a.svg").exists() and image.read_bytes() == before
    assert (tmp_path / "other.html").read_text() == "<p>mine</p>"


def test_several_images_have_a_list(image: Path, tmp_path: Path) -> None:
    other = tmp_path / "other.png"
    other.write_bytes(image.read_bytes())
    pages = tmp_path / "all.html"
    assert run("vectorize", image, other, "-o", tmp_path / "out", "--report", pages, "-q", *QUICK) == 0
    assert MARK in pages.read_text("utf-8")
    assert sorted(path.name for path in (tmp_path / "all-pages").iterdir()) == [
        "other.svg.html",
        "photo.svg.html",
    ]


@pytest.mark.parametrize(
    ("report", "said"),
    [
        ("m.html", "is another file of this batch"),
        ("out/photo.svg", "is another file of this batch"),
        ("photo.png", "is another file of this batch"),
        ("notes.txt", "is a file, not a folder"),
        ("", "index.html: exists and was not written by warpsplat"),
    ],
)
def test_a_report_of_a_batch_replaces_no_other_file(
    image: Path, tmp_path: Path, cli: Cli, report: str, said: str
) -> None:
    for name in ("notes.txt", "index.html"):
        (tmp_path / name).write_text("mine")
    before = sorted(tmp_path.rglob("*"))
    places = ("-o", tmp_path / "out", "--report", tmp_path / report, "--manifest", tmp_path / "m.html")
    assert said in cli("batch", image, *places, *QUICK, code=2).line
    assert sorted(tmp_path.rglob("*")) == before
    assert (tmp_path / "notes.txt").read_text() == (tmp_path / "index.html").read_text() == "mine"


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
    assert is_marked(text.encode()[:HEAD], b"")
    assert not re.findall(r"(?:src|href)=[\"'](?!data:|#|x)", text)


def test_a_missing_value_is_an_error() -> None:
    with pytest.raises(UndefinedError):
        page("test.html.j2")
