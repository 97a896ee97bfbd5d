"""Text of others as it may be shown: what a terminal would obey is written out instead."""

from __future__ import annotations

KEPT = "\n\t"
"""Control characters that may stay: those that only move on. By definition."""


def printable(text: str) -> str:
    """Return a text without characters that a terminal would obey, such as escape sequences.

    Parameters
    ----------
    text
        That may hold what somebody else wrote: a name in a log, a column, a message.

    Returns
    -------
    str
        The same, with every character that cannot be seen written as Python writes it.

    Examples
    --------
    >>> printable("x\\x1b[31m")
    'x\\\\x1b[31m'
    """
    return "".join(c if c.isprintable() or c in KEPT else ascii(c)[1:-1] for c in text)
