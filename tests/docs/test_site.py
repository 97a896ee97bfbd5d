"""The site that `make docs` builds: whole, loads nothing from elsewhere, opens from a folder."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from html.parser import HTMLParser
from pathlib import Path
from typing import Any
from urllib.parse import unquote, urlsplit

import pytest
from scope_browser import BROWSERS

import motorctl

ROOT = Path(__file__).parents[2]
PAGES = ROOT / "docs"
LOADING = {
    ("script", "src"),
    ("img", "src"),
    ("iframe", "src"),
    ("source", "src"),
    ("link", "href"),
    ("object", "data"),
}
"""Tags whose address is loaded when the page is opened; that of a link is not."""
ONLY_NAMED = {"canonical", "search", "index", "next", "prev", "author", "copyright"}
"""Links in a page's head that a browser does not load."""
NARROW, WIDE = {"width": 390, "height": 800}, {"width": 1400, "height": 1000}

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Build the site as `make docs` does."""
    recipe = re.search(r"^docs:.*\n\t(.+)$", (ROOT / "Makefile").read_text(), re.M)
    assert recipe is not None
    _, *arguments = recipe[1].split()
    assert "--fail-on-warning" in arguments
    folder = tmp_path_factory.mktemp("docs")
    places = {"out/site-cache": str(folder / "cache"), "out/site": str(folder / "site")}
    words = [places.get(word, word) for word in arguments]
    built = subprocess.run(
        [sys.executable, "-m", "sphinx", *words],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    assert built.returncode == 0, built.stderr
    return folder / "site"


class Addresses(HTMLParser):
    """What a page loads, what it links to, and the names of its places."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.loaded: list[str] = []
        self.linked: list[str] = []
        self.places: set[str] = set()
        self.feed(text)

    def handle_starttag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        given = {name: value or "" for name, value in attributes}
        self.places.add(given.get("id", ""))
        relations = set(given.get("rel", "").split())
        for name, value in given.items():
            if (tag, name) in LOADING and not relations & ONLY_NAMED:
                self.loaded.append(value)
            if (tag, name) == ("a", "href"):
                self.linked.append(value)


@pytest.fixture(scope="module")
def pages(site: Path) -> dict[Path, Addresses]:
    return {path: Addresses(path.read_text()) for path in site.rglob("*.html")}


def test_every_page_is_in_the_site(pages: dict[Path, Addresses], site: Path) -> None:
    there = {str(page.relative_to(site).with_suffix("")) for page in pages}
    written = {str(page.relative_to(PAGES).with_suffix("")) for page in PAGES.rglob("*.md")}
    assert written <= there


def test_what_a_page_would_load_is_told_from_what_it_links_to() -> None:
    page = Addresses(
        '<link rel="stylesheet" href="https://fonts.example/a.css"><link rel="next" href="b.html">'
        '<script src="//cdn.example/c.js"></script><a href="https://example.org" id="d">e</a>'
    )
    assert page.loaded == ["https://fonts.example/a.css", "//cdn.example/c.js"]
    assert (page.linked, "d" in page.places) == (["https://example.org"], True)


def test_pages_load_nothing_from_elsewhere(pages: dict[Path, Addresses], site: Path) -> None:
    for path, page in pages.items():
        foreign = [a for a in page.loaded if urlsplit(a).netloc or urlsplit(a).scheme[:4] == "http"]
        assert not foreign, path
    for sheet in site.rglob("*.css"):
        text = re.sub(r"/\*.*?\*/", "", sheet.read_text(), flags=re.S)
        assert not re.search(r"url\(\s*['\"]?(https?:)?//|@import\s+(url\()?['\"]?https?:", text)


def test_every_link_within_the_site_leads_to_a_page_and_a_place(
    pages: dict[Path, Addresses],
) -> None:
    for path, page in pages.items():
        for link in page.linked:
            parts = urlsplit(link)
            if parts.scheme or not (parts.path or parts.fragment):
                continue
            target = (path.parent / unquote(parts.path)).resolve() if parts.path else path
            assert target.is_file(), f"{path.name}: {link}"
            if parts.fragment and target in pages:
                assert unquote(parts.fragment) in pages[target].places, f"{path.name}: {link}"


def test_every_public_name_is_told_with_its_docstring(site: Path) -> None:
    page = Addresses((site / "reference" / "api.html").read_text())
    assert not [name for name in motorctl.__all__ if f"motorctl.{name}" not in page.places]


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    api = pytest.importorskip("playwright.sync_api", reason="no playwright drives the browser")
    found = next((path for name in BROWSERS if (path := shutil.which(name))), None)
    if found is None:
        pytest.skip(f"no browser is installed: none of {', '.join(BROWSERS)}")
    with api.sync_playwright() as playwright:
        started = playwright.chromium.launch(executable_path=found, args=["--no-sandbox"])
        yield started
        started.close()


@pytest.mark.parametrize(
    "size", [NARROW, pytest.param(WIDE, marks=pytest.mark.long)], ids=["narrow", "wide"]
)
def test_opened_from_a_folder_no_page_asks_for_anything_or_is_wider_than_the_screen(
    browser: Any, pages: dict[Path, Addresses], size: dict[str, int]
) -> None:
    page = browser.new_page(viewport=size)
    asked: list[str] = []
    page.on("request", lambda request: asked.append(request.url))
    for path in pages:
        page.goto(path.as_uri())
        wide = page.evaluate("document.documentElement.scrollWidth")
        assert wide <= size["width"], path
    page.close()
    assert asked
    assert not [address for address in asked if urlsplit(address).scheme not in {"file", "data"}]


def test_the_search_works_from_a_folder(browser: Any, site: Path) -> None:
    page = browser.new_page(viewport=WIDE)
    page.goto(f"{(site / 'search.html').as_uri()}?q=presliding")
    page.wait_for_selector("#search-results ul.search li a")
    found = page.locator("#search-results ul.search li a").all_inner_texts()
    page.close()
    assert "Every effect > presliding" in found
