"""What is there already is not written over, unless a person says so."""

from __future__ import annotations

from pathlib import Path

from motorctl.errors import UsageError


def refuse_what_is_there(path: Path, *, replace: bool) -> None:
    """Raise UsageError where a file is there already and must not be replaced."""
    if path.exists() and not replace:
        raise UsageError(f"{path}: is there already; --force replaces it")


def is_in_place(out: Path, source: str) -> bool:
    """Return whether a file is to be written over the one that it is made of.

    Whoever names one file as both has said so.
    """
    return out.exists() and Path(source).exists() and out.samefile(source)
