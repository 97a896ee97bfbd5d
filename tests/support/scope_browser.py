"""The scope's page in a real browser: Debian's chromium or another, driven by playwright."""

from __future__ import annotations

import asyncio
import shutil
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import pytest

BROWSERS = ("chromium", "chromium-browser", "google-chrome")
SETTLED = "body[data-settled=true]"
SIZE = {"width": 1200, "height": 860}
WAIT_MS = 60_000
COUNT_PIXELS = """(canvas, colour) => {
  const { data, width } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
  const rows = new Set(), columns = new Set();
  let count = 0;
  for (let k = 0; k < data.length; k += 4) {
    const off = [0, 1, 2].some((c) => Math.abs(data[k + c] - colour[c]) > 40);
    if (off || data[k + 3] < 128) continue;
    count += 1;
    rows.add(Math.floor(k / 4 / width));
    columns.add((k / 4) % width);
  }
  const span = (set) => [Math.min(...set), Math.max(...set)];
  return { count, rows: span(rows), columns: span(columns), height: canvas.height, width };
}"""


@contextmanager
def browser() -> Iterator[Any]:
    """Return a browser; skips, saying so, where there is none."""
    api = pytest.importorskip("playwright.sync_api", reason="no playwright drives the browser")
    pytest.importorskip("aiohttp", reason="the scope needs the extra [scope]")
    found = next((path for name in BROWSERS if (path := shutil.which(name))), None)
    if found is None:
        pytest.skip(f"no browser is installed: none of {', '.join(BROWSERS)}")
    with api.sync_playwright() as playwright:
        started = playwright.chromium.launch(executable_path=found, args=["--no-sandbox"])
        try:
            yield started
        finally:
            started.close()


@contextmanager
def served(paths: Sequence[Path] | Callable[[str], Path]) -> Iterator[str]:
    """Serve logs, or those of a fleet, as `motorctl scope` does; return the page's address."""
    from motorctl.scope.server import Logs, serve

    logs = paths if callable(paths) else Logs.of(paths)
    ready = threading.Event()
    told: list[Any] = []

    async def run() -> None:
        told.append(asyncio.get_running_loop())
        told.append(asyncio.current_task())

        def listening(url: str) -> None:
            told.append(url)
            ready.set()

        with suppress(asyncio.CancelledError):
            await serve(logs, "127.0.0.1", 0, listening)

    thread = threading.Thread(target=asyncio.run, args=(run(),))
    thread.start()
    try:
        assert ready.wait(30)
        yield told[2]
    finally:
        told[0].call_soon_threadsafe(told[1].cancel)
        thread.join()


class Page:
    """The scope's page as a test uses it."""

    def __init__(self, browser: Any, url: str, layout: str = "") -> None:
        self.page = browser.new_page(viewport=SIZE)
        self.page.set_default_timeout(WAIT_MS)
        self.errors: list[str] = []
        self.page.on("pageerror", lambda error: self.errors.append(str(error)))
        self.page.on("console", self._heard)
        self.page.goto(url + (f"#{layout}" if layout else ""))
        self.settle()

    def _heard(self, message: Any) -> None:
        if message.type == "error":
            self.errors.append(message.text)

    def settle(self) -> None:
        """Wait until what is in view is drawn."""
        self.page.wait_for_selector(SETTLED)

    def layout(self) -> dict[str, str]:
        """Return what the address tells."""
        _, _, told = self.page.url.partition("#")
        return dict(part.split("=", 1) for part in told.split("&"))

    def view(self) -> tuple[float, float]:
        """Return from when to when [s] the address tells."""
        layout = self.layout()
        return float(layout["from"]), float(layout["to"])

    def panel(self, name: str, nth: int = 0) -> Any:
        """Return a panel by its name, of the nth log."""
        return self.page.locator(f".panel[data-panel={name}]").nth(nth)

    def pixels(self, name: str, colour: str, nth: int = 0) -> dict[str, Any]:
        """Return how many pixels of a panel have a colour, and which rows and columns they span."""
        rgb = [int(colour[k : k + 2], 16) for k in (1, 3, 5)]
        canvas = self.panel(name, nth).locator("canvas")
        found: dict[str, Any] = canvas.evaluate(COUNT_PIXELS, rgb)
        return found

    def drag(self, name: str, begin: float, end: float, *keys: str) -> None:
        """Drag over a panel, between two shares of its width."""
        box = self.panel(name).locator(".u-over").bounding_box()
        y = box["y"] + box["height"] / 2
        for key in keys:
            self.page.keyboard.down(key)
        self.page.mouse.move(box["x"] + begin * box["width"], y)
        self.page.mouse.down()
        self.page.mouse.move(box["x"] + (begin + end) / 2 * box["width"], y)
        self.page.mouse.move(box["x"] + end * box["width"], y)
        self.page.mouse.up()
        for key in keys:
            self.page.keyboard.up(key)
        self.settle()

    def click(self, name: str, share: float, *keys: str) -> None:
        """Click on a panel at a share of its width."""
        over = self.panel(name).locator(".u-over")
        box = over.bounding_box()
        position = {"x": share * box["width"], "y": box["height"] / 2}
        over.click(position=position, modifiers=list(keys))
        self.settle()

    def press(self, key: str) -> None:
        """Press a key."""
        self.page.keyboard.press(key)
        self.settle()

    def close(self) -> None:
        """Close it; it must have had no error."""
        self.page.close()
        assert self.errors == []
