"""The report on any file, and the page on several versions of an image."""

from __future__ import annotations

import io
import math
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image

import warpsplat
from tests.pages.helpers import NASTY, Tags, data_of
from warpsplat.fit.progress import Progress
from warpsplat.pages.plot import BOTTOM
from warpsplat.pages.reports.pictures import (
    MAP_QUALITIES,
    ShownImage,
    encoded,
    first_that_fits,
    shown_image,
)
from warpsplat.pages.reports.several import knee, knee_of, several_page, versions_of
from warpsplat.pages.reports.several import plots as version_plots
from warpsplat.pages.reports.shapes import contributions, matched
from warpsplat.pages.reports.single import Facts, headline, notes, plots, report_page, table
from warpsplat.rendering.backend import Backend
from warpsplat.run.render import to_pillow
from warpsplat.run.result import Result
from warpsplat.svg.read import load_kept
from warpsplat.svg.viewer import draw

SVG = (
    '<svg xmlns="http://www.w3.org/2000/svg" width="48" height="32" viewBox="0 0 48 32">'
    '<rect width="48" height="32" fill="#446688"/>'
    '<g id="far"><path d="M4 4H30V28H4Z" fill="#a33" fill-opacity=".8"/><path d="M20 8H44V24H20Z"/></g>'
    '<g id="near"><path d="M10 20L40 6" stroke="#3a3" stroke-width="3" fill="none"/></g></svg>'
)
BARE = SVG.replace('<rect width="48" height="32" fill="#446688"/>', "")


def grain(channels: int = 3) -> np.ndarray:
    return np.random.default_rng(1).integers(0, 256, (32, 48, channels)).astype(np.uint8)


@pytest.fixture(scope="module")
def page() -> str:
    """The report on ``SVG``."""
    return warpsplat.report(SVG, grain(), name="a", svg_name="a.svg", command="a", device="cpu")


@pytest.mark.parametrize(
    ("svg", "channels"), [(SVG, 3), (SVG, 4), (BARE, 4)], ids=["plain", "behind", "clear"]
)
def test_a_contribution_is_what_the_psnr_falls_without_the_shape(svg: str, channels: int) -> None:
    """Measured on the file without it, as a viewer shows it."""
    image = warpsplat.load_image(grain(channels))
    base, target = matched(load_kept(svg, 48, 32, "x"), image)
    found = contributions(base.scene, target, Backend.on("cpu", 1))
    assert found and base.document
    shapes = re.findall(r"<path[^>]*/>", svg)
    assert len(found) == len(shapes) == 3

    def figure(text: str) -> float:
        """Return the PSNR; with opacity, of the mean of the errors on black and on white."""
        shown = draw(text, 48, 32) / 255.0
        shown[..., :3] *= shown[..., 3:]
        difference = shown[..., : target.shape[2]] - target
        errors = [difference[..., :3]]
        if target.shape[2] == 4:
            errors.append(difference[..., :3] - difference[..., 3:])
        return float(-10 * np.log10(np.mean(np.square(errors))))

    for shape, contribution in zip(shapes, found, strict=True):
        assert contribution == pytest.approx(figure(svg) - figure(svg.replace(shape, "")), abs=0.02)


def test_the_list_of_shapes(page: str) -> None:
    values = data_of(page)["listing"]
    assert values["kinds"] == ["fill", "fill", "stroke"]
    assert values["colors"] == [["#a33"], ["#000"], ["#3a3"]]
    assert values["opacities"] == [0.8, 1.0, 1.0]
    assert (values["layers"], values["names"]) == ([0, 0, 1], ["far", "near"])
    assert (values["elements"], values["background"]) == ([3, 4, 6], 1)  # the root is 0


def test_a_file_without_shapes_has_no_list() -> None:
    text = SVG.replace("</svg>", '<path d="M0 0H9V9Z" shape-rendering="crispEdges"/></svg>')
    only = re.sub(r"<g id.*</g>", "", text)
    kept = data_of(warpsplat.report(text, grain(), device="cpu"))["listing"]
    assert kept["kinds"][-1] == "kept" and kept["contributions"][-1] is None
    bare = warpsplat.report(only, grain(), device="cpu")
    assert data_of(bare)["listing"] is None
    assert "The shapes of this file are not listed" in bare


@pytest.mark.parametrize("text", NASTY)
def test_texts_are_not_markup(text: str, page: str) -> None:
    titled = SVG.replace('id="far"', 'id="far" data-x="&lt;/script>"')
    made = warpsplat.report(titled, grain(), name=text, svg_name=text, command=text, device="cpu")
    # Each word of the command has an element of its own, so that lines end between them.
    nasty, plain = ([tag for tag in Tags(each).tags if tag != "span"] for each in (made, page))
    assert nasty == plain
    assert data_of(made)["svg"] == titled


KEYS = ["psnr", "ssim", "bytes", "shapes", "seconds", "why", "subject", "missed", "stopped", "reduced"]


@settings(deadline=None, max_examples=50)
@given(
    st.dictionaries(
        st.sampled_from([*KEYS, "levels"]),
        st.none()
        | st.booleans()
        | st.integers(-9, 10**6)
        | st.floats()
        | st.text(max_size=9)
        | st.lists(st.integers()),
    )
)
def test_figures_may_be_missing_or_of_any_kind(figures: dict[str, Any]) -> None:
    """A manifest may contain anything."""
    image = warpsplat.load_image(grain())
    for rows in (headline(figures), table(Facts(figures), ShownImage(image, 48, 32)), notes(Facts(figures))):
        assert all(isinstance(text, str) for row in rows for text in row)


def test_plots_of_a_run() -> None:
    history = [Progress(i, 9, 20.0 + i, float(i), i / 9, fine=i > 4, shapes=10 + i) for i in range(9)]
    quality, count = plots(history)
    assert [faint for _, faint in quality.lines] == [True, False]
    assert quality.up[0][1] == "20" and count.up[0][1] == "0"
    assert plots(()) == plots([Progress(0, 9, math.inf, 0.0, 0.0, fine=True)]) == []


def test_the_size_of_a_page_is_limited(page: str) -> None:
    """However small the image file is, and whatever it shows."""
    noise = np.random.default_rng(0).random((300, 300, 3), np.float32)
    assert len(encoded(noise, 2000)) < 2000 * 4 / 3 + 40
    assert len(first_that_fits(to_pillow(noise), MAP_QUALITIES, 2000)) < 2000 * 4 / 3 + 40
    # Of the pictures, each stands in the page once.
    pictures = re.findall(r"data:image/webp;base64,[\w+/=]+", page)
    assert len(pictures) == len(set(pictures)) == 2
    small = io.BytesIO()
    Image.fromarray(grain()).save(small, "JPEG", quality=5)
    made = warpsplat.report(SVG, small.getvalue(), device="cpu")
    assert len(made) <= len(SVG) + 2 * len(small.getvalue()) + 90_000  # half of it for pictures is still free


def test_only_the_picture_on_a_sheet_is_shown(tmp_path: Path) -> None:
    image = np.full((40, 60, 3), 255, np.uint8)
    image[10:30, 28:32] = 0
    result = warpsplat.vectorize(image, subject="line", page="a5", iterations=5, device="cpu")
    made = warpsplat.report(result, image, tmp_path / "x.html", device="cpu")
    values = data_of(made)
    assert values["svg"] == result.svg
    assert re.fullmatch(r"0 0 \d+ \d+", values["view"])
    sides = [float(side) for side in values["view"].split()[2:]]
    assert sides[0] / sides[1] == pytest.approx(1.5, rel=0.01)
    assert values["listing"]["kinds"] == ["stroke"] * len(result.scene)


@pytest.mark.parametrize("placing", [{"size": "50x40mm"}, {"page": "a4"}, {"size": "3x100mm"}])
def test_the_picture_on_a_sheet_has_the_proportions_of_the_image(
    tmp_path: Path, placing: dict[str, str]
) -> None:
    """Also on a coarse grid, where margins in whole units are not precise enough."""
    image = grain()[:23, :32]
    result = warpsplat.vectorize(image, 3, subject="photo", iterations=3, device="cpu", **placing)
    view = data_of(warpsplat.report(result, image, tmp_path / "x.html", device="cpu"))["view"]
    across, down = (float(side) for side in view.split()[2:])
    assert across / down == pytest.approx(32 / 23, rel=1e-6)


@pytest.mark.parametrize("size", [(17_000, 2), (2, 17_000)])
def test_an_image_that_is_longer_than_a_webp_can_be(size: tuple[int, int]) -> None:
    width, height = size
    image = np.random.default_rng(0).integers(0, 256, (height, width, 3)).astype(np.uint8)
    shown = shown_image(image, None)
    assert (shown.width, shown.height) == size and shown.reduced_size
    assert shown.pixels.shape[:2] == (height // 2, width // 2)
    head = f'<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{height}">'
    svg = f'{head}<path d="M0 0h9v9z"/></svg>'
    page = report_page(svg, image, Backend.on("cpu", 1), Facts(), name="long.png", svg_name="a.svg")
    assert f"{width} × {height}" in page and "data:image/webp;base64," in page


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
    by_shapes, by_size = version_plots(versions, 1)
    for one in (by_shapes, by_size):
        assert [mark.strong for mark in one.marks] == [False, True, False]
    text = several_page(versions, Image.new("RGB", (24, 16)), name="a.png", command="warpsplat ...")
    assert "The knee is at 4 shapes: up to there a kB buys" in text
    assert text.count("the knee</span>") == 1
    labels = [float(y) for y in re.findall(r'<circle class="mark[^>]*/>\s*<text [^>]*y="([\d.]+)"', text)]
    assert len(labels) == 6 and max(labels) < BOTTOM, "the axis has figures of its own below"


def test_versions_without_figures_have_no_plots(results: list[Result]) -> None:
    versions = versions_of([replace(result, score=None, stopped=True) for result in results], "a.svg")
    assert knee_of(versions) is None and version_plots(versions, None) == []
    text = several_page(versions, Image.new("RGB", (24, 16)), name="a.png")
    assert "Quality by shapes and size" not in text
    assert "The run was stopped" in text
    alone = several_page(versions[:1], Image.new("RGB", (24, 16)), name="a.png")
    assert "in 1 version<" in alone and "in 3 versions<" in text
