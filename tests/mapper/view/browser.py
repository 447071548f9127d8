"""A real Chromium without a window, for pages that must work in one."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

CHROMIUM = Path("/usr/bin/chromium")
# WebGL 2 without a graphics card
FLAGS = ["--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist"]


@pytest.fixture(scope="session")
def chromium() -> Iterator[Any]:
    """A `playwright` browser; skips where there is no playwright or no Chromium."""
    api = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    if not CHROMIUM.is_file():
        pytest.skip(f"no Chromium at {CHROMIUM}")
    with api.sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=str(CHROMIUM), args=FLAGS)
        yield browser
        browser.close()


class Tab:
    """A page opened from disk, and everything that it complained of or asked for."""

    def __init__(self, browser: Any, file: Path, width: int = 1100, height: int = 640, **more: Any) -> None:
        self.complaints: list[str] = []
        self.requests: list[str] = []
        self.context = browser.new_context(viewport={"width": width, "height": height}, **more)
        self.page = self.context.new_page()
        self.page.on(
            "console", lambda message: self.complaints.append(message.text) if message.type == "error" else None
        )
        self.page.on("pageerror", lambda error: self.complaints.append(str(error)))
        self.page.on("request", lambda request: self.requests.append(request.url))
        self.page.goto(file.resolve().as_uri())
        self.page.wait_for_selector("html[data-ready]", state="attached", timeout=30_000)

    def listed(self) -> list[str]:
        """Ids in the list, in order."""
        return self.page.locator("#list .row").evaluate_all("rows => rows.map(row => row.dataset.id)")

    def text(self, selector: str) -> str:
        return self.page.locator(selector).inner_text()

    def settle(self) -> None:
        """Until a flight of the camera is over."""
        self.page.wait_for_timeout(700)

    def close(self) -> None:
        self.context.close()
