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
    return _written_out(text, KEPT)


def one_line(text: str) -> str:
    """Return a text as `printable` does, without line ends: it cannot begin a line of its own.

    Examples
    --------
    >>> one_line("x\\nmotorctl: all is well")
    'x\\\\nmotorctl: all is well'
    """
    return _written_out(text, "")


def _written_out(text: str, kept: str) -> str:
    if text.isprintable():
        return text  # as JSON documents of any length are
    return "".join(c if c.isprintable() or c in kept else ascii(c)[1:-1] for c in text)
