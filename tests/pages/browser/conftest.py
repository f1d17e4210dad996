"""A real headless browser for the tests of this folder, which are skipped if there is none."""

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
    from playwright.sync_api import Browser, Page, Route

ARGUMENTS = [
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-background-networking",
    "--no-first-run",
]
NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
LONGEST_WAIT = 20_000
"""Longest wait for anything on a page [ms]."""


@pytest.fixture(scope="package")
def browser() -> Iterator[Browser]:
    """The system's Chromium, else Playwright's own; ``WARPSPLAT_BROWSER`` overrides it.

    Its scope is this package, since it keeps an event loop running, which would disturb other tests.
    """
    api = pytest.importorskip("playwright.sync_api", reason="pip install playwright, for tests in a browser")
    with api.sync_playwright() as playwright:
        path = os.environ.get("WARPSPLAT_BROWSER") or next(filter(None, map(shutil.which, NAMES)), None)
        if path is None and not Path(playwright.chromium.executable_path).exists():
            pytest.skip("no browser: apt-get install chromium, or playwright install chromium")
        made = playwright.chromium.launch(executable_path=path, args=ARGUMENTS)
        yield made
        made.close()


class Complaints(list[str]):
    """What went wrong on pages: errors, messages of the console, requests for other than the file."""

    expected: str | None = None
    """Part of messages that are ignored."""

    def add(self, text: str) -> None:
        if self.expected is None or self.expected not in text:
            self.append(text)


def wait_until(page: Page, condition: Callable[[], bool]) -> None:
    """Let a page run until ``condition()`` is true."""
    end = time.monotonic() + LONGEST_WAIT / 1000
    while not condition():
        assert time.monotonic() < end
        page.wait_for_timeout(20)


@pytest.fixture
def complaints() -> Complaints:
    return Complaints()


@contextlib.contextmanager
def opened(browser: Browser, complaints: Complaints) -> Iterator[Page]:
    """Yield an empty page, and check that there were no complaints."""
    context = browser.new_context(viewport={"width": 1280, "height": 900})
    context.set_default_timeout(LONGEST_WAIT)
    page = context.new_page()
    page.on("pageerror", lambda error: complaints.append(str(error)))
    page.on("console", lambda line: complaints.add(line.text) if line.type != "log" else None)
    yield page
    context.close()
    assert not complaints


@pytest.fixture
def tab(browser: Browser, complaints: Complaints) -> Iterator[Page]:
    """An empty page that can load files only."""

    def local_only(route: Route) -> None:
        if route.request.url.startswith(("file:", "data:", "blob:")):
            route.continue_()
        else:
            complaints.append(f"asked for {route.request.url}")
            route.abort()

    with opened(browser, complaints) as page:
        page.context.route("**/*", local_only)
        yield page


def fits_a_phone(page: Page) -> bool:
    """Show a page on a phone's screen from now on, and return whether it needs no horizontal scrolling."""
    page.set_viewport_size({"width": 390, "height": 844})
    width: int = page.evaluate("document.documentElement.scrollWidth")
    return width == 390


@pytest.fixture(scope="session")
def halves() -> np.ndarray:
    """A dark and a bright half with grain, uint8, shape (32, 48, 3)."""
    image = np.random.default_rng(0).integers(0, 60, (32, 48, 3)).astype(np.uint8)
    image[:, 24:] += 150
    return image
