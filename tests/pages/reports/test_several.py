"""The page on several versions of an image, and its knee."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

import warpsplat
from warpsplat.pages.plot import BOTTOM
from warpsplat.pages.reports.several import knee, knee_of, plots, several_page, versions_of
from warpsplat.run.result import Result


def test_the_knee_of_a_corner_and_of_a_logarithm() -> None:
    assert knee(np.array([1.0, 2, 3, 13]), np.array([0.0, 5, 9, 10])) == 2
    x = np.linspace(16, 1024, 4001)
    at = knee(x, 3 * np.log2(x) + 7)
    assert at is not None
    assert x[at] == pytest.approx((1024 - 16) / np.log(1024 / 16), rel=0.01), "there the slope is the mean"


@pytest.mark.parametrize("gain", [[1.0, 2, 3], [1.0, 1.2, 4], [3.0, 4, 2], [1.0, 1, 1], [1.0, 2]], ids=str)
def test_curves_without_a_knee(gain: list[float]) -> None:
    assert knee(np.arange(1.0, len(gain) + 1), np.array(gain)) is None


@pytest.fixture(scope="module")
def results() -> list[Result]:
    image = np.random.default_rng(1).integers(0, 255, (16, 24, 3)).astype(np.uint8)
    settings = warpsplat.make_settings(iterations=2, subject="photo")
    found = warpsplat.vectorize_several(image, [6, 2, 4], settings=settings, device="cpu", threads=1)
    # Figures of a curve with a knee.
    scores = {2: 20.0, 4: 25.0, 6: 26.0}
    return [
        replace(result, score=replace(result.score, psnr=scores[len(result.scene)]))
        for result in found
        if result.score
    ]


def test_the_knee_is_marked(results: list[Result]) -> None:
    versions = versions_of(results, "a.svg")
    assert [version.file for version in versions] == ["a-2.svg", "a-4.svg", "a-6.svg"]
    assert knee_of(versions) == 1
    by_shapes, by_size = plots(versions, 1)
    for one in (by_shapes, by_size):
        assert [mark.strong for mark in one.marks] == [False, True, False]
    text = several_page(versions, Image.new("RGB", (24, 16)), name="a.png", command="warpsplat ...")
    assert "The knee is at 4 shapes: up to there a kB buys" in text
    assert text.count("the knee</span>") == 1
    labels = [float(y) for y in re.findall(r'<circle class="mark[^>]*/>\s*<text [^>]*y="([\d.]+)"', text)]
    assert len(labels) == 6 and max(labels) < BOTTOM, "the axis has figures of its own below"


def test_versions_without_figures_have_no_plots(results: list[Result]) -> None:
    versions = versions_of([replace(result, score=None, stopped=True) for result in results], "a.svg")
    assert knee_of(versions) is None and plots(versions, None) == []
    text = several_page(versions, Image.new("RGB", (24, 16)), name="a.png")
    assert "Quality by shapes and size" not in text
    assert "The run was stopped" in text
    alone = several_page(versions[:1], Image.new("RGB", (24, 16)), name="a.png")
    assert "in 1 version<" in alone and "in 3 versions<" in text
