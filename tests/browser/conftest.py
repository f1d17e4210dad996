"""A real browser, headless, for all tests of a worker; where there is none they are skipped."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

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
LONGEST_WAIT = 10_000
"""For anything on a page [ms]."""


def installed_browser() -> str | None:
    """The system's Chromium; None: Playwright's own, if there is one. ``WARPSPLAT_BROWSER`` overrides it."""
    given = os.environ.get("WARPSPLAT_BROWSER")
    return given or next(filter(None, map(shutil.which, NAMES)), None)


@pytest.fixture(scope="session")
def browser() -> Iterator[Browser]:
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


@pytest.fixture
def complaints() -> Complaints:
    return Complaints()


@pytest.fixture
def tab(browser: Browser, complaints: Complaints) -> Iterator[Page]:
    """An empty page that reaches nothing but files, and whose test fails where it complains of anything."""
    context = browser.new_context(viewport={"width": 1280, "height": 900})
    context.set_default_timeout(LONGEST_WAIT)

    def local_only(route: Route) -> None:
        if route.request.url.startswith(("file:", "data:", "blob:")):
            route.continue_()
        else:
            complaints.append(f"asked for {route.request.url}")
            route.abort()

    context.route("**/*", local_only)
    page = context.new_page()
    page.on("pageerror", lambda error: complaints.append(str(error)))
    page.on("console", lambda line: complaints.append(line.text) if line.type != "log" else None)
    yield page
    context.close()
    assert not complaints
