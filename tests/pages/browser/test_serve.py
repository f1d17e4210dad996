"""The page of ``warpsplat serve``, operated like a user."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

import warpsplat
from tests.pages.browser.conftest import Complaints, fits_a_phone, opened, wait_until
from tests.pages.serve.helpers import Visitor, held, picture, until
from warpsplat.fit.settings import PRESETS

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page

SHOWN = "img:not([hidden])"


@pytest.fixture
def visitor(monkeypatch: pytest.MonkeyPatch) -> Iterator[Visitor]:
    """A server whose runs are short, except with the effort ``high``."""
    monkeypatch.setitem(PRESETS, "balanced", {"iterations": 12})
    monkeypatch.setitem(PRESETS, "high", {"iterations": 1_000_000})
    with Visitor() as made:
        yield made


@pytest.fixture
def visit(visitor: Visitor, browser: Browser, complaints: Complaints) -> Iterator[Page]:
    with opened(browser, complaints) as page:
        page.goto(visitor.server.address())
        yield page


def give(page: Page, data: bytes, name: str = "my photo.png") -> None:
    page.set_input_files("#drop input", {"name": name, "mimeType": "image/png", "buffer": data})
    page.wait_for_selector("#work:not([hidden])")


def start(page: Page, curves: int, effort: str = "Balanced") -> None:
    page.select_option("#subject", "photo")
    page.fill("#curves", str(curves))
    page.get_by_text(effort, exact=True).click()
    page.get_by_role("button", name="Vectorize").click()


def done(page: Page, number: int) -> None:
    page.wait_for_selector(f'.run[data-state="done"][aria-label^="{number} "]')


def test_fields_become_settings(visit: Page) -> None:
    page = visit
    give(page, picture())
    for each in page.locator("details.field").all():
        each.evaluate("details => details.open = true")
    page.select_option("#shape", "circle")
    page.fill("#detail", "0.4")
    page.fill("#background", "white")
    page.fill("#max-bytes", "2KB")
    start(page, 4, "Draft")
    done(page, 1)
    title = "1 · photo, 4 shapes, draft, circle, detail 0.4, at most 2KB, background white"
    assert page.locator(".run h3").all_inner_texts() == [title]


def test_two_settings_of_an_image_are_compared_and_one_is_saved(visit: Page, tmp_path: Path) -> None:
    page = visit
    give(page, picture())
    start(page, 4)
    done(page, 1)
    start(page, 8)
    done(page, 2)
    cards = page.locator(".run")
    assert cards.locator("h3").all_inner_texts() == ["2 · photo, 8 shapes", "1 · photo, 4 shapes"]
    right, left = (page.locator(f'.viewer-side[data-side="{side}"] {SHOWN}') for side in ("right", "left"))
    assert left.get_attribute("alt") == "Original"
    cards.nth(1).get_by_role("button", name="Left").click()
    assert left.get_attribute("alt") == "1 · photo, 4 shapes"
    assert right.get_attribute("alt") == "2 · photo, 8 shapes"
    for side in (left, right):  # loaded, and as wide as the image
        assert side.evaluate("image => image.decode().then(() => image.naturalWidth)") == 40
    with page.expect_download() as saving:
        cards.nth(1).get_by_role("link", name="Download").click()
    saving.value.save_as(tmp_path / "saved.svg")
    assert saving.value.suggested_filename == "my photo.svg"
    made = warpsplat.vectorize(picture(), 4, subject="photo", device="cpu", threads=1)
    assert (tmp_path / "saved.svg").read_text() == made.svg
    cards.nth(0).get_by_role("button", name="Remove").click()
    page.wait_for_selector(".run:nth-child(2)", state="detached")
    assert right.get_attribute("alt") == "Original"
    assert fits_a_phone(page)


def test_a_run_is_live_survives_a_reload_and_can_be_stopped(visit: Page, visitor: Visitor) -> None:
    page = visit
    give(page, picture())
    start(page, 6, "High")
    thumb = page.locator(".run .thumb img")
    page.wait_for_selector(".run .thumb img[src^='blob:']")
    first = thumb.get_attribute("src")
    page.wait_for_selector(f".run .thumb img:not([src='{first}'])")
    assert page.locator(f'.viewer-side[data-side="right"] {SHOWN}').get_attribute("alt") == (
        "1 · photo, 6 shapes, high"
    )
    assert " shapes · " in page.locator(".run .state").inner_text()
    page.reload()
    page.get_by_role("button", name="Stop here").click()
    page.wait_for_selector('.run[data-state="stopped"]')
    assert "Stopped: the best so far." in page.locator(".run .why").inner_text()
    svg = page.evaluate("() => fetch(document.querySelector('[data-do=download]').href).then(a => a.text())")
    assert 1 <= len(warpsplat.load_svg(svg)) <= 9
    session = page.evaluate("location.hash").partition("=")[2]
    page.close()
    until(lambda: held(visitor.store)["sessions"] and not visitor.store.is_attended(session))


def test_refusals_are_shown_where_they_belong(visit: Page, complaints: Complaints) -> None:
    page = visit
    assert fits_a_phone(page)
    page.set_input_files(
        "#drop input", {"name": "notes.txt", "mimeType": "text/plain", "buffer": b"no image"}
    )
    error = page.get_by_role("alert")
    expected = "notes.txt: not an image of a format that is read: "
    page.wait_for_selector("#error:not([hidden])")
    assert error.inner_text().startswith(expected)
    give(page, picture())
    assert page.locator("#error").is_hidden()
    page.select_option("#subject", "drawing")
    page.get_by_text("Strokes", exact=True).click()
    page.keyboard.press("Enter")
    page.wait_for_selector("#refused:not([hidden])")
    assert error.inner_text() == "subject drawing and open cannot be combined; open needs subject photo"
    assert not page.locator(".run").count()
    wait_until(page, lambda: len(complaints) >= 2)
    assert [int(text.rpartition("status of ")[2][:3]) for text in complaints] == [415, 400]
    complaints.clear()
