"""A headless Chromium of the system for tests of pages; nothing is downloaded."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import pytest

NAMES = ("chromium", "chromium-browser", "google-chrome", "chrome")
FLAGS = (
    "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-background-networking",
    "--disable-component-update", "--disable-sync",
)  # fmt: skip
CHECKS = Path(__file__).with_name("page_checks.js")
DESKTOP, PHONE = (1280, 900), (390, 844)


@dataclass
class Seen:
    """A page that is open, and what the browser said while it was."""

    page: object
    said: list[str] = field(default_factory=list)
    asked: list[str] = field(default_factory=list)

    def draw_all(self) -> None:
        """Show every panel and detail, scroll past everything, wait until all plots are drawn."""
        self.page.evaluate("checks.drawAll()")
        self.page.wait_for_function(
            "[...document.querySelectorAll('.plot')].every((plot) => plot.dataset.drawn)", timeout=20_000
        )


@contextmanager
def browser_running() -> Iterator[object]:
    """Skips the test where there is no browser."""
    path = next((found for name in NAMES if (found := shutil.which(name))), None)
    if path is None:
        pytest.skip(f"no Chromium is installed (looked for {', '.join(NAMES)})")
    api = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    with api.sync_playwright() as started:
        browser = started.chromium.launch(executable_path=path, args=list(FLAGS))
        try:
            yield browser
        finally:
            browser.close()


@contextmanager
def opened(browser: object, path: Path, size: tuple[int, int] = DESKTOP, **options: object) -> Iterator[Seen]:
    """A page in a fresh profile, with everything that it says or asks for."""
    context = browser.new_context(viewport={"width": size[0], "height": size[1]}, **options)
    try:
        seen = Seen(context.new_page())
        seen.page.on("console", lambda message: seen.said.append(f"{message.type}: {message.text}"))
        seen.page.on("pageerror", lambda error: seen.said.append(f"error: {error}"))
        seen.page.on(
            "dialog", lambda dialog: (seen.said.append(f"dialog: {dialog.message}"), dialog.dismiss())
        )
        seen.page.on("request", lambda request: seen.asked.append(request.url))
        seen.page.add_init_script(path=CHECKS)
        seen.page.goto(path.as_uri())
        yield seen
    finally:
        context.close()
