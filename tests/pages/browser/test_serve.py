"""The page of ``warpsplat serve``, operated like a user."""

from __future__ import annotations

import io
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest
from PIL import Image

import warpsplat
from tests.pages.browser.conftest import Complaints, fits_a_phone, opened, wait_until
from tests.pages.serve.helpers import Visitor, picture, until
from warpsplat.fit.settings import PRESETS
from warpsplat.pages.serve.form import FIELDS
from warpsplat.run.options import preset_names

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Locator, Page

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


def drop(page: Page, data: bytes, name: str) -> None:
    """Drop a file on the page."""
    script = """([bytes, name]) => {
        const held = new DataTransfer();
        held.items.add(new File([new Uint8Array(bytes)], name, { type: "image/png" }));
        return held;
    }"""
    page.dispatch_event("body", "drop", {"dataTransfer": page.evaluate_handle(script, [list(data), name])})
    page.wait_for_selector("#work:not([hidden])")


def start(page: Page, curves: int, effort: str = "Balanced") -> None:
    page.select_option("#subject", "photo")
    page.fill("#curves", str(curves))
    page.locator("#form").get_by_text(effort, exact=True).click()
    page.get_by_role("button", name="Vectorize").click()


def done(page: Page, title: str, state: str = "done") -> Locator:
    """Wait for the end of a run, and return its card."""
    selector = f'.run[data-state="{state}"][aria-label$=" · {title}"]'
    page.wait_for_selector(selector)
    return page.locator(selector)


def shown(page: Page, side: str) -> str:
    """Return the picture on a side of the slider, without the number of its run."""
    name = page.locator(f'.viewer-side[data-side="{side}"] {SHOWN}').get_attribute("alt")
    return (name or "").rpartition(" · ")[2]


def disc() -> bytes:
    """Return an image file of a dark disc on white."""
    y, x = np.mgrid[:48, :64]
    pixels = np.where((x - 32) ** 2 + (y - 24) ** 2 < 300, 40, 255).astype(np.uint8)
    buffer = io.BytesIO()
    Image.fromarray(pixels).convert("RGB").save(buffer, "PNG")
    return buffer.getvalue()


@pytest.mark.skipif(not preset_names(), reason="the extension batch has them")
def test_from_a_drop_to_all_files(visit: Page, tmp_path: Path) -> None:
    """An image is vectorized as soon as it is there, and again with each change."""
    page = visit
    drop(page, disc(), "disc.png")
    first = done(page, "automatic")
    wait_until(page, lambda: shown(page, "right") == "automatic")
    assert shown(page, "left") == "Original"
    assert page.evaluate("document.activeElement.id") == "preset"
    page.select_option("#preset", "laser-cut")
    assert page.input_value("#detail") == "0.35" and page.input_value("#subject") == "drawing"
    assert page.locator("#preset-hint").inner_text() == "Also: separate, stack cutout, units mm"
    assert page.get_by_role("radio", name="Everywhere").is_checked()
    assert page.get_by_role("radio", name="No", exact=True).is_disabled()
    card = done(page, "laser-cut")
    wait_until(page, lambda: shown(page, "right") == "laser-cut")
    assert first.count() == 1
    starts = {"SVG": "<svg", "PNG": "\x89PNG", "EPS": "%!PS", "Report": "<!doctype html>"}
    further = {"PDF": "%PDF", "DXF": "  0\nSECTION"}
    for label, begins in {**starts, **further}.items():
        button = card.get_by_role("button", name=f"Save {label}" if label == "SVG" else label)
        if button.is_disabled():
            assert label in further and ": pip install " in button.inner_text()
            continue
        with page.expect_download() as saving:
            button.click()
        ending = "html" if label == "Report" else label.lower()
        assert saving.value.suggested_filename == f"disc.{ending}"
        saving.value.save_as(tmp_path / ending)
        assert (tmp_path / ending).read_bytes().replace(b"\r", b"").decode("latin-1").startswith(begins)
    made = warpsplat.vectorize(disc(), preset="laser-cut", device="cpu", threads=1)
    assert (tmp_path / "svg").read_text() == made.svg
    command = card.get_by_role("button", name="Copy command").get_attribute("title")
    assert command == "warpsplat vectorize disc.png --preset laser-cut -o disc.svg"


def test_a_run_that_ends_before_its_number_is_known(visit: Page) -> None:
    """It is shown as well: the answer that names a run may come after the news of its end."""
    page = visit
    answers = []
    page.route("**/runs", lambda route: answers.append((route, route.fetch())))
    drop(page, disc(), "disc.png")
    done(page, "automatic")
    assert shown(page, "right") == "Original"
    route, answer = answers.pop()
    route.fulfill(response=answer)
    wait_until(page, lambda: shown(page, "right") == "automatic")


def test_fields_become_settings(visit: Page) -> None:
    page = visit
    give(page, picture())
    page.get_by_text("More", exact=True).click()
    page.select_option("#shape", "circle")
    page.fill("#detail", "0.4")
    page.fill("#background", "white")
    page.fill("#max-bytes", "2KB")
    start(page, 4, "Draft")
    title = "photograph, draft, shapes 4, detail 0.4, largest file 2KB, background colour white, circle"
    command = done(page, title).get_by_role("button", name="Copy command").get_attribute("title")
    assert command == (
        "warpsplat vectorize 'my photo.png' --quality draft --curves 4 --subject photo --shape circle"
        " --max-bytes 2000 --detail 0.4 --background '#ffffff' -o 'my photo.svg'"
    )


def test_two_settings_of_an_image_are_compared_and_one_is_saved(visit: Page, tmp_path: Path) -> None:
    page = visit
    give(page, picture())
    start(page, 4)
    one = done(page, "photograph, shapes 4")
    page.get_by_role("button", name="Vectorize").click()  # which changes nothing: there is that run
    start(page, 8)
    other = done(page, "photograph, shapes 8")
    assert one.count() == other.count() == 1
    wait_until(page, lambda: shown(page, "right") == "photograph, shapes 8")
    assert shown(page, "left") == "Original"
    one.get_by_role("button", name="Left").click()
    assert shown(page, "left") == "photograph, shapes 4"
    assert shown(page, "right") == "photograph, shapes 8"
    for side in ("left", "right"):  # loaded, and as wide as the image
        image = page.locator(f'.viewer-side[data-side="{side}"] {SHOWN}')
        assert image.evaluate("image => image.decode().then(() => image.naturalWidth)") == 40
    with page.expect_download() as saving:
        one.get_by_role("button", name="Save SVG").click()
    saving.value.save_as(tmp_path / "saved.svg")
    assert saving.value.suggested_filename == "my photo.svg"
    made = warpsplat.vectorize(picture(), 4, subject="photo", device="cpu", threads=1)
    assert (tmp_path / "saved.svg").read_text() == made.svg
    count = page.locator(".run").count()
    other.get_by_role("button", name="Remove").click()
    page.wait_for_selector(f".run:nth-child({count})", state="detached")
    wait_until(page, lambda: shown(page, "right") == "Original")
    assert fits_a_phone(page)


def test_a_run_is_live_survives_a_reload_and_is_replaced_by_a_change(visit: Page, visitor: Visitor) -> None:
    page = visit
    give(page, picture())
    start(page, 6, "High")
    page.wait_for_selector(".run .thumb img[src^='blob:']")
    wait_until(page, lambda: shown(page, "right") == "photograph, high, shapes 6")
    wait_until(page, lambda: " shapes · " in page.locator(".run .state").first.inner_text())
    page.reload()
    page.wait_for_selector('.run[data-state="running"]')
    assert page.input_value("#curves") == "6" and page.get_by_role("radio", name="High").is_checked()
    page.fill("#curves", "5")
    page.keyboard.press("Enter")
    page.wait_for_selector('.run[aria-label$=" shapes 6"]', state="detached")
    wait_until(page, lambda: shown(page, "right") == "photograph, high, shapes 5")
    page.keyboard.press("Escape")
    card = done(page, "photograph, high, shapes 5", "stopped")
    assert "Stopped: the best so far." in card.locator(".why").inner_text()
    (run,) = (run for run in visitor.store.state()["runs"] if run["state"] == "stopped")
    assert 1 <= len(warpsplat.load_svg(visitor.store.run(run["id"]).svg.decode())) <= 8
    page.close()
    until(lambda: not visitor.store.is_attended())


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
    page.get_by_text("More", exact=True).click()
    page.get_by_text("Strokes", exact=True).click()
    page.wait_for_selector("#refused:not([hidden])")
    assert error.inner_text() == "subject drawing and open cannot be combined; open needs subject photo"
    wait_until(page, lambda: len(complaints) >= 2)
    assert [int(text.rpartition("status of ")[2][:3]) for text in complaints] == [415, 400]
    complaints.clear()


UNNAMED_OR_UNSEEN = """() => {
    // What has the focus, if it has no name or nothing shows the focus.
    const it = document.activeElement;
    const name = it.ariaLabel || it.labels?.[0]?.textContent || it.textContent || it.title;
    const isSeen = (each) => each && getComputedStyle(each).opacity !== "0" && !each.matches(".unseen");
    const ringed = [it, it.nextElementSibling, it.parentElement].filter(isSeen).flatMap((each) => [
        getComputedStyle(each).outlineStyle, getComputedStyle(each, "::after").outlineStyle,
    ]);
    return name?.trim() && ringed.some((style) => style !== "none") ? "" : it.outerHTML;
}"""

FAINT = """() => {
    // Texts whose contrast with what is behind them is below 4.5.
    const canvas = new OffscreenCanvas(1, 1).getContext("2d", { willReadFrequently: true });
    const color = (text) => {
        canvas.clearRect(0, 0, 1, 1);
        canvas.fillStyle = text;
        canvas.fillRect(0, 0, 1, 1);
        return [...canvas.getImageData(0, 0, 1, 1).data];
    };
    const linear = (value) => (value <= 10 ? value / 255 / 12.92 : ((value / 255 + 0.055) / 1.055) ** 2.4);
    const light = ([r, g, b]) => 0.2126 * linear(r) + 0.7152 * linear(g) + 0.0722 * linear(b);
    const behind = (each) => {
        const found = color(getComputedStyle(each).backgroundColor);
        return found[3] === 255 || !each.parentElement ? found : behind(each.parentElement);
    };
    return [...document.querySelectorAll("main *, header *, footer *")].filter((each) => {
        if (!each.checkVisibility() || each.disabled || each.closest(".viewer-stage")) return false;
        if (![...each.childNodes].some((child) => child.nodeType === 3 && child.data.trim())) return false;
        const [one, other] = [light(color(getComputedStyle(each).color)), light(behind(each))];
        return (Math.max(one, other) + 0.05) / (Math.min(one, other) + 0.05) < 4.5;
    }).map((each) => each.outerHTML);
}"""

SMALL = """() => {
    // What is too small for a finger.
    const all = "button, select, input:not(.unseen, [type=radio]), .choices span, summary";
    return [...document.querySelectorAll(all)]
        .filter((each) => each.checkVisibility() && each.getBoundingClientRect().height < 32)
        .map((each) => each.outerHTML);
}"""


def test_it_is_operated_by_keys_and_read_in_the_dark(visit: Page) -> None:
    page = visit
    give(page, picture())
    start(page, 4)
    done(page, "photograph, shapes 4")
    page.get_by_text("More", exact=True).click()
    page.locator("h1").click()
    places = set()
    for _ in range(100):
        page.keyboard.press("Tab")
        if page.evaluate("document.activeElement === document.body"):
            break
        assert page.evaluate(UNNAMED_OR_UNSEEN) == ""
        places.add(page.evaluate("document.activeElement.name || document.activeElement.textContent"))
    assert {*FIELDS, "Vectorize", "Save SVG", "Report"} <= places
    for scheme in ("light", "dark"):
        page.emulate_media(color_scheme=scheme, reduced_motion="reduce")
        assert page.evaluate(FAINT) == []
    assert fits_a_phone(page) and page.evaluate(SMALL) == []
