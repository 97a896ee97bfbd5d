"""What is there already is not written over, unless a person says so."""

from __future__ import annotations

from pathlib import Path

from motorctl.errors import UsageError


def refuse_what_is_there(path: Path, *, replace: bool) -> None:
    """Raise UsageError where a file is there already and must not be replaced."""
    if path.exists() and not replace:
        raise UsageError(f"{path}: is there already; --force replaces it")
