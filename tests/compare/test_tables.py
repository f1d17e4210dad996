"""Tables of comparisons."""

from __future__ import annotations

import math
from dataclasses import replace

from tests.compare.tracers import stub
from warpsplat.compare.comparison import OURS, Comparison, ComparisonRow
from warpsplat.compare.tables import markdown, means
from warpsplat.fit.settings import make_settings
from warpsplat.metrics import Score

SCORE = Score(28.125, 0.75, ms_ssim=0.9, ssimulacra2=None, paths=8, nodes=96, bytes=1234, gzip_bytes=640)


def row(image: str, program: str = OURS, setting: str = "8", score: Score | None = SCORE) -> ComparisonRow:
    return ComparisonRow(
        image, program, setting, "<svg/>", 2.5, 4.25, score, "" if score else "failed: ValueError: no"
    )


def comparison(*rows: ComparisonRow) -> Comparison:
    return Comparison(rows, make_settings(curves=8, iterations=12, seed=3), stub())


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


def test_infinity_is_null_in_json() -> None:
    values = comparison(row("a.png", score=replace(SCORE, psnr=math.inf)), row("b.png", score=None)).as_dict()
    assert values["results"][0]["psnr"] is None
    assert values["results"][1]["error"] == "failed: ValueError: no"
    assert values[OURS]["kind"] == "fill"
    assert values["Bands"]["settings"] == {"one": {"bands": 1}, "four": {"bands": 4}}
