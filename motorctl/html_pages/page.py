"""A package's template becomes a file that can be mailed."""

from __future__ import annotations

import base64
from dataclasses import dataclass
from pathlib import Path

from jinja2 import ChoiceLoader, Environment, PackageLoader, StrictUndefined

from motorctl.errors import UsageError
from motorctl.version import VERSION


@dataclass(frozen=True)
class Figure:
    """A picture inside a page, and the words below it."""

    data: str
    """The PNG file in base64."""
    caption: str
    title: str = ""


def figure(file: Path, caption: str = "", title: str = "") -> Figure:
    """Return the picture of a PNG file.

    Parameters
    ----------
    file
        The picture.
    caption
        Words below it; empty: none.
    title
        Words above it; empty: none.

    Returns
    -------
    Figure
        The picture itself, in base64, with its words.

    Raises
    ------
    OSError
        Where the file cannot be read.
    """
    return Figure(base64.b64encode(file.read_bytes()).decode(), caption, title)


def write_page(page: Path, package: str, template: str, **values: object) -> None:
    """Fill a template and write it, with everything in it that it shows.

    Parameters
    ----------
    page
        The file to write.
    package, template
        The package that holds the template, and its file name there. The template extends
        ``base.html`` and imports what it needs from ``parts.html``, both in this package.
    **values
        What the template names. Text is escaped; so is every file name in a link.

    Raises
    ------
    UsageError
        Where the page cannot be written.
    """
    environment = Environment(
        loader=ChoiceLoader([PackageLoader(name, ".") for name in (package, __package__ or "")]),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    html = environment.get_template(template).render(version=VERSION, **values)
    try:
        page.write_text(html, encoding="utf-8")
    except OSError as error:
        raise UsageError(f"{page}: the page cannot be written: {error.strerror}") from error
