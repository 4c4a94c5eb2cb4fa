"""Pages in a real browser, without a network."""

from __future__ import annotations

import shutil
import time
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest

BROWSERS = ("chromium", "chromium-browser", "google-chrome")
CHROMIUM = next((found for name in BROWSERS if (found := shutil.which(name))), None)
MISSING = "" if CHROMIUM else "there is no chromium"
if find_spec("playwright") is None:
    MISSING = "playwright is not installed"
SLOW = 300e3
"""Milliseconds that a busy machine may take."""
PHONE = 400
"""Width of a small screen, pixels."""
DRAWN = """[...document.querySelectorAll('div.plot')].map((plot) => [
    plot.id,
    (plot._fullData || []).reduce((count, trace) => count + (trace._length || (trace.z || []).length), 0),
])"""
"""Names of the plots, and how many points plotly has drawn in each."""


@contextmanager
def launched() -> Iterator[Any]:
    """A browser; the test is skipped where there is none."""
    if MISSING:
        pytest.skip(MISSING)
    from playwright.sync_api import sync_playwright

    with sync_playwright() as driver:
        arguments = ["--no-sandbox", "--enable-unsafe-swiftshader"]
        browser = driver.chromium.launch(executable_path=CHROMIUM, args=arguments)
        yield browser
        browser.close()


class Opened:
    """A page in a browser, and what it complained of or asked for."""

    def __init__(self, browser: Any, file: Path, page: str) -> None:
        file.write_text(page, encoding="utf-8")
        self.tab = browser.new_context(viewport={"width": 1200, "height": 900}, offline=True).new_page()
        self.tab.set_default_timeout(SLOW)
        self.said: list[str] = []
        self.asked: list[str] = []
        self.tab.on("console", lambda message: self.said.append(message.text))
        self.tab.on("pageerror", lambda error: self.said.append(str(error)))
        self.tab.on("dialog", lambda dialog: (self.said.append(dialog.message), dialog.dismiss()))
        self.tab.on("request", lambda request: self.asked.append(request.url))
        self.tab.goto(file.as_uri())

    def run(self, script: str) -> Any:
        """The value of a script, once all plots are drawn."""
        if self.tab.query_selector(".plot"):
            self.tab.wait_for_selector("html[data-drawn]", state="attached")
        return self.tab.evaluate(script)

    def becomes(self, condition: str) -> bool:
        """Whether a condition holds before long; the page's policy lets no test wait inside it."""
        end = time.monotonic() + SLOW / 1e3
        while time.monotonic() < end:
            if self.run(condition):
                return True
            self.tab.wait_for_timeout(50)
        return False

    def is_whole(self) -> None:
        """All plots have data, without an error or a request, and the page is not wider than a phone's screen."""
        drawn = dict(self.run(DRAWN))
        assert all(count > 0 for count in drawn.values()), drawn
        assert self.said == []
        assert [url for url in self.asked if not url.startswith(("file:", "data:", "blob:"))] == []
        self.tab.set_viewport_size({"width": PHONE, "height": 900})
        self.tab.wait_for_timeout(500)  # plots follow
        assert self.run("document.documentElement.scrollWidth") <= PHONE
