"""The page that compares several numbers of shapes, operated like a user."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest
from PIL import Image

import warpsplat
from tests.pages.browser.conftest import fits_a_phone

if TYPE_CHECKING:
    from playwright.sync_api import Page


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
