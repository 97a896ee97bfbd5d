"""Names of axes that a recording of others may have: they are shown, and name files."""

from __future__ import annotations

from collections.abc import Iterable

from motorctl.errors import DataError

LONGEST = 64
"""Of a name [characters]. Larger makes file names that some file systems refuse, smaller refuses
names that people use. Chosen by hand."""


def insist_on_names(source: str, names: Iterable[str]) -> None:
    """Refuse names that a terminal would obey, or that would lead a file elsewhere.

    Parameters
    ----------
    source
        Names the recording in the message.
    names
        Of its axes.

    Raises
    ------
    DataError
        Where one cannot be printed, is too long, or holds a path's separator.
    """
    for name in names:
        if not (name.isprintable() and 0 < len(name) <= LONGEST and not set(name) & {"/", "\\"}):
            raise DataError(
                f"{source}: axis {name!r}: should be 1 to {LONGEST} characters that can be shown, "
                "none of them / or \\: the name becomes part of file names"
            )
