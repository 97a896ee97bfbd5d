"""Which page stands where in the site's navigation; the pages themselves stay plain Markdown."""

from __future__ import annotations

from pathlib import Path

from sphinx.application import Sphinx

CHAPTERS = {
    "Start here": ["tutorial", "running"],
    "Your machine": [
        *("init", "three_machines", "homing", "buses", "drivers/your_own", "dual_drive"),
        *("service", "recording"),
    ],
    "Less error": [
        *("find_causes", "experiments", "own_effect", "models", "tuning", "response", "learning"),
        *("foreign_recording", "fleet"),
    ],
    "Look at it": ["troubleshooting", "flight_recorder", "scope", "neighbours", "python"],
    "Look it up": [
        *("reference/keys", "reference/commands", "reference/log_columns", "reference/effects"),
        *("reference/api", "guards", "states"),
    ],
    "Why, and how well": [
        *("law", "diagnosis", "real_machines", "campaign", "architecture", "decisions/README"),
    ],
}
"""Below the first page. A page that stands nowhere comes under "More"."""
BELOW = {
    "buses": [
        f"drivers/{name}" for name in ("can", "canopen", "serial", "modbus", "gantry_device")
    ],
    "decisions/README": ["decisions/0*"],
}
"""Pages that stand below another one; a star stands for all of these names."""


def toctree(pages: list[str], base: str, caption: str = "") -> str:
    """Return pages as the directive that Sphinx makes the navigation of.

    Parameters
    ----------
    pages
        Their names, from the folder of all pages.
    base
        The page that it stands on.
    caption
        The heading above them; empty: none.
    """
    options = [":hidden:", ":glob:", *([f":caption: {caption}"] if caption else [])]
    folder = str(Path(base).parent)
    names = [page.removeprefix(f"{folder}/") if folder != "." else page for page in pages]
    return "\n".join(["", "```{toctree}", *options, "", *names, "```", ""])


def unnamed(found: set[str]) -> list[str]:
    """Return the pages that have no place yet.

    Parameters
    ----------
    found
        Every page that there is.
    """
    named = {page for pages in (*CHAPTERS.values(), *BELOW.values()) for page in pages}
    return sorted(p for p in found - named - {"index"} if not p.startswith("decisions/"))


def add_navigation(app: Sphinx, page: str, source: list[str]) -> None:
    """Put the navigation under the text of a page."""
    if page in BELOW:
        source[0] += toctree(BELOW[page], page)
    if page == "index":
        chapters = dict(CHAPTERS)
        if more := unnamed(app.env.found_docs):
            chapters["More"] = more
        for caption, pages in chapters.items():
            source[0] += toctree(pages, page, caption)


def setup(app: Sphinx) -> dict[str, bool]:
    """Register with Sphinx."""
    app.connect("source-read", add_navigation)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
