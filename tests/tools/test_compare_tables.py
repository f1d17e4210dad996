"""Tables and plots of comparisons."""

from __future__ import annotations

import math
import sys
from dataclasses import replace
from xml.etree import ElementTree

import pytest
from matplotlib.figure import Figure

from tests.tracers import stub
from warpsplat.errors import UsageError
from warpsplat.fit.settings import make_settings
from warpsplat.metrics import Score
from warpsplat.tools.compare import OURS, Comparison, Row
from warpsplat.tools.compare_tables import draw_panel, markdown, means, plot, table
from warpsplat.tools.tracer import vtracer

SCORE = Score(
    psnr=28.125,
    ssim=0.75,
    ms_ssim=0.9,
    ssimulacra2=None,
    paths=8,
    nodes=96,
    bytes=1234,
    gzip_bytes=640,
)


def row(image: str, program: str = OURS, setting: str = "8", score: Score | None = SCORE) -> Row:
    return Row(image, program, setting, "<svg/>", 2.5, 4.25, score, "" if score else "failed: ValueError: no")


def comparison(*rows: Row) -> Comparison:
    return Comparison(rows, make_settings(curves=8, iterations=12, seed=3), stub())


def cells(text: str) -> list[list[str]]:
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in text.splitlines()]


def test_a_table_has_the_figures_under_their_headings() -> None:
    text = table([(OURS, "8", {"psnr": 28.125, "bytes": 1234, "paths": 8}), ("Bands", "one", {"psnr": 9.0})])
    assert len({len(line) for line in text.splitlines()}) == 1, "columns of one width"
    heads, rule, *lines = cells(text)
    assert heads == ["program", "setting", "PSNR [dB]", "kB", "paths"]
    assert all(set(dashes) <= {"-", ":"} for dashes in rule)
    assert lines == [[OURS, "8", "28.12", "1.2", "8"], ["Bands", "one", "9.00", "-", "-"]]


def test_an_exact_file_has_no_decibels() -> None:
    assert "exact" in table([(OURS, "8", {"psnr": math.inf})])


def test_means_are_of_settings_that_all_images_have() -> None:
    found = comparison(
        row("a.png"),
        row("a.png", "Bands", "one"),
        row("b.png", score=replace(SCORE, psnr=30.125, ssim=None, bytes=2234)),
        row("b.png", "Bands", "one", score=None),
    )
    ((program, setting, values),) = means(found)
    assert (program, setting) == (OURS, "8")
    assert [values[k] for k in ("psnr", "bytes", "seconds", "cpu_seconds")] == [29.125, 1734, 2.5, 4.25]
    assert values["ssim"] is None


def test_the_tables_of_all_images() -> None:
    one = comparison(row("a.png"), row("a.png", "Bands", "one", score=None))
    text = markdown(one)
    assert [line for line in text.splitlines() if line[:2] == "##"] == ["## a.png", "## Settings"]
    assert "Bands, one: failed: ValueError: no" in text.splitlines()
    assert "the number of fills; 12 steps, seed 3" in text
    assert "Bands 1.2" in text
    assert "  * four: bands 4" in text.splitlines()
    two = comparison(*one.rows, row("b.png"))
    assert "## Mean of 2 images" in markdown(two)


def test_what_cannot_be_held_by_json_is_none() -> None:
    values = comparison(row("a.png", score=replace(SCORE, psnr=math.inf)), row("b.png", score=None)).as_dict()
    assert values["results"][0]["psnr"] is None
    assert values["results"][1]["error"] == "failed: ValueError: no"
    assert values[OURS]["kind"] == "fill"
    assert values["Bands"]["settings"] == {"one": {"bands": 1}, "four": {"bands": 4}}


def test_a_panel_has_a_point_for_each_file() -> None:
    rows = [
        row("a.png"),
        row("a.png", setting="16", score=replace(SCORE, psnr=30.0, bytes=2400)),
        row("a.png", setting="32", score=replace(SCORE, psnr=math.inf)),
        row("a.png", "Bands", "one", score=replace(SCORE, psnr=9.0, bytes=500)),
        row("a.png", "Bands", "four", score=None),
    ]
    axes = Figure().add_subplot()
    draw_panel(axes, "a.png", rows, "Bands")
    ours, theirs = axes.lines
    assert ours.get_xydata().tolist() == [[1.234, 28.125], [2.4, 30.0]]  # type: ignore[union-attr]
    assert theirs.get_xydata().tolist() == [[0.5, 9.0]]  # type: ignore[union-attr]
    assert [text.get_text() for text in axes.texts] == ["8", "16", "one"]


def test_a_plot_is_an_svg_with_a_panel_for_each_image() -> None:
    names = ["a$b$_{.png", "b<&>.png"]
    found = comparison(*(row(name, program) for name in names for program in (OURS, "Bands")))
    data = plot(found)
    words = [
        element.text for element in ElementTree.fromstring(data).iter("{http://www.w3.org/2000/svg}text")
    ]
    for name in names:
        assert words.count(name) == 1
    assert words.count("Bands") == len(names)
    assert plot(found) == data, "the same bytes"


def test_a_plot_without_a_point() -> None:
    """All files exact, or none."""
    ElementTree.fromstring(plot(comparison(row("a.png", score=None))))


@pytest.mark.parametrize("module", ["vtracer", "matplotlib"])
def test_packages_that_are_missing(monkeypatch: pytest.MonkeyPatch, module: str) -> None:
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(UsageError, match=f"needs {module}, which is not installed: pip install {module}"):
        vtracer() if module == "vtracer" else plot(comparison(row("a.png")))
