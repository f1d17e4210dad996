"""A real browser, headless, for all tests of this folder; where there is none they are skipped."""

from __future__ import annotations

import contextlib
import os
import shutil
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page, Route, ViewportSize

ARGUMENTS = [
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-background-networking",
    "--no-first-run",
]
NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
LONGEST_WAIT = 20_000
"""For anything on a page [ms]."""


def installed_browser() -> str | None:
    """The system's Chromium; None: Playwright's own, if there is one. ``WARPSPLAT_BROWSER`` overrides it."""
    given = os.environ.get("WARPSPLAT_BROWSER")
    return given or next(filter(None, map(shutil.which, NAMES)), None)


@pytest.fixture(scope="package")
def browser() -> Iterator[Browser]:
    """As long as it is there, so is an event loop of its own: other folders' tests run some themselves."""
    api = pytest.importorskip("playwright.sync_api", reason="pip install playwright, for tests in a browser")
    with api.sync_playwright() as playwright:
        executable = installed_browser()
        if executable is None and not Path(playwright.chromium.executable_path).exists():
            pytest.skip("no browser: apt-get install chromium, or playwright install chromium")
        made = playwright.chromium.launch(executable_path=executable, args=ARGUMENTS)
        yield made
        made.close()


class Complaints(list[str]):
    """What went wrong on pages: errors, lines on the console, requests for what is not in the file."""

    expected: str | None = None
    """Part of lines that may be on the console, whenever the browser gets round to them."""

    def hear(self, line: str) -> None:
        """Note a line on the console."""
        if self.expected is None or self.expected not in line:
            self.append(line)


def wait_until(page: Page, is_so: Callable[[], bool]) -> None:
    """Let a page go on until something is so that it does not say itself."""
    end = time.monotonic() + LONGEST_WAIT / 1000
    while not is_so():
        assert time.monotonic() < end
        page.wait_for_timeout(20)


@pytest.fixture
def complaints() -> Complaints:
    return Complaints()


@contextlib.contextmanager
def opened(browser: Browser, complaints: Complaints) -> Iterator[Page]:
    """An empty page that must not complain of anything."""
    context = browser.new_context(viewport={"width": 1280, "height": 900})
    context.set_default_timeout(LONGEST_WAIT)
    page = context.new_page()
    page.on("pageerror", lambda error: complaints.append(str(error)))
    page.on("console", lambda line: complaints.hear(line.text) if line.type != "log" else None)
    yield page
    context.close()
    assert not complaints


@pytest.fixture
def tab(browser: Browser, complaints: Complaints) -> Iterator[Page]:
    """An empty page that reaches nothing but files, and whose test fails where it complains of anything."""

    def local_only(route: Route) -> None:
        if route.request.url.startswith(("file:", "data:", "blob:")):
            route.continue_()
        else:
            complaints.append(f"asked for {route.request.url}")
            route.abort()

    with opened(browser, complaints) as page:
        page.context.route("**/*", local_only)
        yield page


PHONE: ViewportSize = {"width": 390, "height": 844}


def fits_a_phone(page: Page) -> bool:
    """Whether a page on a phone's screen, where it is shown from now on, need not be moved sideways."""
    page.set_viewport_size(PHONE)
    width: int = page.evaluate("document.documentElement.scrollWidth")
    return width == PHONE["width"]


@pytest.fixture(scope="session")
def halves() -> np.ndarray:
    """Pixels of a dark and a bright half with grain, of the type uint8, shape (32, 48, 3)."""
    image = np.random.default_rng(0).integers(0, 60, (32, 48, 3)).astype(np.uint8)
    image[:, 24:] += 150
    return image
