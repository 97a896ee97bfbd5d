"""Say in words what went wrong, whether it was foreseen or not."""

from __future__ import annotations

from motorctl.errors import MotorctlError


def in_words(error: Exception) -> str:
    """Return an error's message; of one that was not foreseen its type, too."""
    if isinstance(error, MotorctlError):
        return str(error)
    text = str(error)
    return f"{type(error).__name__}: {text}" if text else type(error).__name__
