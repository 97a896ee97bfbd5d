"""Results as notebooks show them: tables in HTML, and as pandas' frames."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from html import escape
from typing import TYPE_CHECKING, Any

from motorctl.extras import require
from motorctl.printable import printable

if TYPE_CHECKING:
    import pandas as pd


def html_table(headings: Sequence[str], rows: Iterable[Sequence[object]], title: str = "") -> str:
    """Return a table in HTML; nothing where it has no rows.

    Parameters
    ----------
    headings
        Of the columns.
    rows
        The cells of each row; text is escaped.
    title
        Stands above it.
    """
    lines = ["".join(f"<td>{escaped(cell)}</td>" for cell in row) for row in rows]
    if not lines:
        return ""
    caption = f"<caption>{escaped(title)}</caption>" if title else ""
    head = "".join(f"<th>{escaped(heading)}</th>" for heading in headings)
    body = "".join(f"<tr>{line}</tr>" for line in lines)
    return f"<table>{caption}<thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"


def html_lines(lines: Iterable[str], heading: str = "") -> str:
    """Return sentences as paragraphs in HTML, below a heading where there is one."""
    first = f"<p><b>{escaped(heading)}</b></p>" if heading else ""
    return first + "".join(f"<p>{escaped(line)}</p>" for line in lines)


def html_code(text: str) -> str:
    """Return a text in HTML as it stands, line by line."""
    return f"<pre>{escaped(text)}</pre>" if text else ""


def frame_of_rows(rows: Iterable[Mapping[str, object]], columns: Sequence[str]) -> pd.DataFrame:
    """Return a pandas DataFrame of these rows; a row may lack some of the columns.

    Raises UsageError where pandas is not installed.
    """
    frame: pd.DataFrame = pandas().DataFrame(list(rows), columns=list(columns))
    return frame


def pandas() -> Any:
    """Return pandas. Raises UsageError, telling how to install it, where it is not there."""
    require("to_pandas", "notebook", "pandas")
    import pandas as module

    return module


def escaped(value: object) -> str:
    """Return a value as text in HTML, without what a browser would obey."""
    return escape(printable(str(value)))
