"""A browser for these tests, which `make browser` runs: Chromium, without a window. CHROMIUM is its path where it is not found
by itself."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from standin import Standin

FIGURES: list[str] = []
FOUND = ("chromium", "chromium-browser", "google-chrome")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    for item in items:
        if Path(__file__).parent in item.path.parents:
            item.add_marker(pytest.mark.browser)


def pytest_terminal_summary(terminalreporter: Any) -> None:
    for line in FIGURES:
        terminalreporter.write_line(line)


@pytest.fixture
def figure() -> Callable[[str], None]:
    """Says what was measured at the end of the session; nothing is decided by it."""
    return FIGURES.append


@pytest.fixture(scope="session")
def chromium() -> Iterator[Any]:
    from playwright.sync_api import sync_playwright

    path = os.environ.get("CHROMIUM") or next((p for name in FOUND if (p := shutil.which(name))), None)
    assert path is not None, (
        f"browser: found none of {', '.join(FOUND)}. Next: install one, or set CHROMIUM to its path"
    )
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=path, args=["--no-sandbox"])
        yield browser
        browser.close()


@pytest.fixture
def standin() -> Iterator[Standin]:
    with Standin() as server:
        yield server


class Opened:
    """A page of a browser, with everything that it asked for and complained about."""

    def __init__(self, page: Any) -> None:
        self.page = page
        self.asked: list[str] = []
        self.wrong: list[str] = []
        page.on("request", lambda request: self.asked.append(request.url))
        page.on("pageerror", lambda error: self.wrong.append(str(error)))
        page.on("console", lambda line: self.wrong.append(line.text) if line.type in ("error", "warning") else None)

    def text(self, where: str) -> str:
        return str(self.page.locator(where).inner_text())


@pytest.fixture
def opened(chromium: Any) -> Iterator[Callable[..., Opened]]:
    """Opens an address in a fresh browser context; `width`, `height` and `dark` of its window."""
    contexts = []

    def open_page(address: str, width: int = 1200, height: int = 900, dark: bool = False, script: str = "") -> Opened:
        context = chromium.new_context(
            viewport={"width": width, "height": height}, color_scheme="dark" if dark else "light"
        )
        contexts.append(context)
        context.set_default_timeout(10_000)
        if script:
            context.add_init_script(script)
        page = Opened(context.new_page())
        page.page.goto(address)
        return page

    yield open_page
    for context in contexts:
        context.close()


@pytest.fixture
def expect(chromium: Any) -> Any:
    """Playwright's assertions, which wait until what they say is so; without it these tests are still collected."""
    from playwright.sync_api import expect

    return expect
