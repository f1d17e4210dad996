"""The report of a run, operated like a user."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest
from PIL import Image

import warpsplat
from tests.pages.browser.conftest import Complaints, fits_a_phone, wait_until

if TYPE_CHECKING:
    from playwright.sync_api import Dialog, Page


@pytest.fixture(scope="session")
def report_file(halves: np.ndarray, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("report") / "report.html"
    result = warpsplat.vectorize(halves, 12, iterations=12, subject="photo", device="cpu", threads=1)
    shown = Image.fromarray(halves)
    warpsplat.report(
        result, shown, path, command="warpsplat vectorize 'a b.png'", name="a b.png", device="cpu"
    )
    return path


@pytest.fixture
def report(tab: Page, report_file: Path) -> Page:
    tab.goto(report_file.as_uri())
    tab.locator(".option").first.wait_for()
    return tab


def test_the_slider_is_dragged_and_moved_by_keys(report: Page) -> None:
    stage, handle = report.locator(".viewer-stage"), report.get_by_role("slider")
    box = stage.bounding_box()
    assert box
    report.mouse.move(box["x"] + box["width"] / 2, box["y"] + 20)
    report.mouse.down()
    report.mouse.move(box["x"] + box["width"] / 4, box["y"] + 20, steps=3)
    report.mouse.up()
    report.locator('[role=slider][aria-valuenow="25"]').wait_for()
    handle.press("Home")
    assert handle.get_attribute("aria-valuenow") == "0"
    handle.press("Shift+ArrowRight")
    assert handle.get_attribute("aria-valuenow") == "10"
    # Left of the divider is the original, right of it the file.
    shown = report.locator(".viewer-side[data-side=right] img:not([hidden])")
    assert shown.get_attribute("data-name") == "svg"
    assert shown.evaluate("image => image.decode().then(() => image.naturalWidth)") == 48


def test_both_pictures_are_zoomed_and_panned_together(report: Page) -> None:
    def places() -> list[str]:
        return report.eval_on_selector_all(
            ".viewer-plane", "planes => planes.map(p => getComputedStyle(p).transform)"
        )

    fitted = places()
    assert len(set(fitted)) == 1
    box = report.locator(".viewer-stage").bounding_box()
    assert box
    report.mouse.move(box["x"] + 60, box["y"] + 60)
    report.mouse.wheel(0, -400)
    report.wait_for_function("v => document.querySelector('.zoomed')")
    zoomed = places()
    assert len(set(zoomed)) == 1 and zoomed != fitted
    report.mouse.down()
    report.mouse.move(box["x"] + 20, box["y"] + 40, steps=3)
    report.mouse.up()
    wait_until(report, lambda: places() != zoomed)
    assert len(set(places())) == 1
    report.locator(".viewer-stage").press("0")
    assert places() == fitted
    report.get_by_role("button", name="1:1").click()
    assert report.locator(".viewer-zoom").text_content() == "100 %"


def test_shapes_are_marked_in_the_picture_and_in_the_list(report: Page) -> None:
    options = report.locator(".option")
    assert options.count() == 12
    options.nth(1).hover()
    wait_until(report, lambda: report.locator(".viewer-overlay .edge").count() == 1)
    told = report.locator("#detail").text_content() or ""
    assert re.search(r"of 12 from the back · fill #\w{6}.* · without it [\d.]+ dB (less|more)", told)
    report.mouse.move(0, 0)
    wait_until(report, lambda: report.locator(".viewer-overlay .edge").count() == 0)
    # Pointing at a shape marks its entry.
    inside = report.evaluate(
        """() => {
            const box = document.querySelector(".viewer-stage").getBoundingClientRect();
            for (let y = box.top + 10; y < box.bottom; y += 8)
            for (let x = box.left + 10; x < box.right; x += 8) {
                const shape = document.elementFromPoint(x, y)?.dataset.shape;
                if (shape !== undefined) return [x, y, shape];
            }
        }"""
    )
    report.mouse.move(*inside[:2])
    report.locator(f".option.hot[data-shape='{inside[2]}']").wait_for()


def test_the_list_is_sorted_and_operated_by_keys(report: Page) -> None:
    numbers = report.locator(".option .number:nth-child(2)")
    report.select_option("#order", "back")
    assert numbers.all_text_contents() == [str(i) for i in range(1, 13)]
    report.select_option("#order", "front")
    assert sorted(map(int, numbers.all_text_contents())) == list(range(1, 13))
    report.locator("#list").press("ArrowDown")
    report.locator("#list").press("ArrowDown")
    assert report.locator("#list").get_attribute("aria-activedescendant") == "shape-10"
    report.locator("#list").press("Escape")
    assert report.locator('[aria-selected="true"]').count() == 0


def test_a_layer_is_switched_off(report: Page) -> None:
    def shown() -> list[int]:
        """Return the middle row of the file's picture."""
        return report.evaluate(
            """async () => {
                const image = document.querySelector(".viewer-side[data-side=right] img[data-name=svg]");
                await image.decode();
                const canvas = new OffscreenCanvas(48, 32).getContext("2d");
                canvas.drawImage(image, 0, 0, 48, 32);
                return [...canvas.getImageData(0, 16, 48, 1).data];
            }"""
        )

    whole = shown()
    boxes = report.locator("#layers input")
    for i in range(boxes.count()):
        boxes.nth(i).uncheck()
    report.wait_for_function("document.querySelectorAll('.option.off').length === 12")
    assert set(shown()) == {0}
    for i in range(boxes.count()):
        boxes.nth(i).check()
    assert shown() == whole


def test_error_map_download_and_command(report: Page, report_file: Path) -> None:
    assert report.locator("#legend").is_hidden()
    report.select_option("select[data-side=right]", "error")
    assert report.locator("#legend").is_visible()
    with report.expect_download() as download:
        report.locator("#download").click()
    assert download.value.suggested_filename == "a b.svg"
    assert Path(download.value.path()).read_text().startswith("<svg")
    assert report.locator("#command").text_content() == "warpsplat vectorize 'a b.png'"
    assert fits_a_phone(report)


HOSTILE = (
    '<svg xmlns="http://www.w3.org/2000/svg" width="48" height="32" viewBox="0 0 48 32" onload="alert(1)">'
    "<title>&lt;/script>&lt;img src=x onerror=alert(2)></title>"
    '<g id="&lt;b>&quot;"><path d="M0 0H48V20H0Z" fill="#a33" onclick="alert(3)"/></g>'
    '<g id="two"><path d="M0 20H48V32H0Z" fill="#3a3"/><path d="M2 2h6v6h-6z"/></g></svg>'
)


def test_a_hostile_file_stays_a_picture(tab: Page, tmp_path: Path, complaints: Complaints) -> None:
    complaints.expected = "Executing inline event handler violates"  # the browser reports that it refused
    image = np.full((32, 48, 3), 90, np.uint8)
    path = tmp_path / "hostile.html"
    name = "</script><script>alert(4)</script>"
    warpsplat.report(HOSTILE, image, path, name=name, command='"><img src=x onerror=alert(5)>', device="cpu")
    said: list[str] = []

    def hear(dialog: Dialog) -> None:
        said.append(dialog.message)
        dialog.dismiss()

    tab.on("dialog", hear)
    tab.goto(path.as_uri())
    tab.locator(".option").first.wait_for()
    assert tab.locator("h1").text_content() == name
    assert tab.locator("#layers label").all_text_contents() == ['<b>"', "two"]
    tab.locator("#layers input").first.uncheck()
    tab.select_option("#order", "front")
    tab.locator("#list").press("ArrowDown")
    tab.locator("#list").press("Enter")
    tab.locator(".zoomed").wait_for()  # to the small square
    for shown in tab.locator("img[data-name=svg]").all():  # drawn: its scripts would have run
        assert shown.evaluate("image => image.decode().then(() => image.naturalWidth)") == 48
    assert not said
