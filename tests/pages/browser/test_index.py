"""The list of a batch, and the page that compares several numbers of shapes."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest
from PIL import Image

from tests.cli.helpers import QUICK, run
from tests.pages.browser.conftest import fits_a_phone

if TYPE_CHECKING:
    from playwright.sync_api import Page
import warpsplat


def make_index(folder: Path) -> Path:
    """Run a batch on two images and another file."""
    grain = np.random.default_rng(0).integers(0, 80, (32, 32, 3)).astype(np.uint8)
    Image.fromarray(grain).save(folder / "b#?.png")
    Image.fromarray(grain // 3 + 150).save(folder / "a.png")
    (folder / "c<b>.png").write_bytes(b"no image")
    found = run(
        "batch", folder, "-o", folder / "out", "--report", folder / "pages", "-q", *QUICK, "--workers", 1
    )
    assert found == 5
    return folder / "pages" / "index.html"


@pytest.fixture(scope="session")
def index_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return make_index(tmp_path_factory.mktemp("index"))


@pytest.fixture
def index(tab: Page, index_file: Path) -> Page:
    tab.goto(index_file.as_uri())
    tab.locator("tbody tr").first.wait_for()
    return tab


def names(index: Page) -> list[str]:
    return index.locator(".called").all_text_contents()


def test_sorting_and_filtering(index: Page) -> None:
    assert names(index) == ["a.png", "b#?.png", "c<b>.png"]
    index.locator("th[data-key=psnr] button").click()
    figures = [float(text) for text in index.locator("td.number:nth-child(3)").all_text_contents() if text]
    assert len(figures) == 2 and figures == sorted(figures, reverse=True)
    assert names(index)[-1] == "c<b>.png"  # has no figure
    assert index.locator("th[data-key=psnr]").get_attribute("aria-sort") == "descending"
    index.select_option("#sort", "name")
    index.locator("#direction").press("Enter")
    assert names(index) == ["c<b>.png", "b#?.png", "a.png"]
    index.fill("#filter", "no image")
    assert "not an image" in (index.locator(".message").text_content() or "")
    index.fill("#filter", "")
    index.select_option("#status", "made")
    assert sorted(names(index)) == ["a.png", "b#?.png"]


def test_links_lead_to_reports_and_back(index: Page) -> None:
    thumbnail = index.locator(".pair img").first
    assert thumbnail.evaluate("image => image.decode().then(() => image.naturalWidth)") > 50
    index.locator(".called a", has_text="b#?.png").click()
    index.locator(".option").first.wait_for()
    assert index.locator("h1").text_content() == "b#?.png"
    index.locator(".back a").click()
    index.locator("tbody tr").first.wait_for()
    assert fits_a_phone(index)
    with index.expect_navigation():
        index.locator("tbody tr:nth-child(2) .small a").click()
    assert index.url.endswith("out/b%23%3F.svg")


@pytest.fixture(scope="session")
def several_file(halves: np.ndarray, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("several") / "page.html"
    settings = warpsplat.make_settings(iterations=12, subject="photo")
    results = warpsplat.vectorize_several(halves, [2, 5, 9], settings=settings, device="cpu", threads=1)
    warpsplat.report(results, Image.fromarray(halves), path, name="a <b>.png", command="warpsplat vectorize")
    return path


def test_any_two_are_compared_and_each_is_downloaded(tab: Page, several_file: Path, tmp_path: Path) -> None:
    tab.goto(several_file.as_uri())
    assert tab.locator("h1").inner_text() == "a <b>.png in 3 versions"
    sides = [tab.locator(f".viewer-side[data-side={side}] img:not([hidden])") for side in ("left", "right")]
    tab.wait_for_function("document.querySelectorAll('.version img')[2].naturalWidth === 48")
    assert [side.get_attribute("alt") for side in sides] == ["2 shapes", "9 shapes"]
    tab.get_by_role("button", name="5 shapes on the left").click()
    tab.locator("select[data-side=right]").select_option("Original")
    assert [side.get_attribute("alt") for side in sides] == ["5 shapes", "Original"]
    assert tab.locator("button[aria-pressed=true][data-side]").count() == 1
    with tab.expect_download() as waiting:
        tab.locator("[data-key=version-2] a").click()
    waiting.value.save_as(tmp_path / "nine.svg")
    assert (tmp_path / "nine.svg").read_text().count("<path") == 9
    assert fits_a_phone(tab)
    assert tab.locator(".plot").count() == 2 and tab.locator(".plot circle").count() == 6
