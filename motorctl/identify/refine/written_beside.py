"""A text in a new file beside the one that it will replace: whole there, or not at all."""

from __future__ import annotations

import os
from pathlib import Path

from motorctl.errors import UsageError


def written_beside(path: Path, text: str) -> Path:
    """Write a text into a new file beside `path`, and return that file.

    Raises UsageError where it cannot be written; nothing is left then.
    """
    written = path.with_name(f".{path.stem}-{os.getpid()}.yaml")
    try:
        with written.open("w", encoding="utf-8", newline="") as file:
            file.write(text)
            file.flush()
            os.fsync(file.fileno())
    except OSError as error:
        written.unlink(missing_ok=True)
        raise UsageError(f"{path}: cannot be written: {error.strerror}") from error
    return written


def put_in_place(written: Path, path: Path) -> Path:
    """Let a file that was written beside `path` stand there, and return the path.

    Raises UsageError where it cannot; nothing is left beside it then.
    """
    try:
        written.replace(path)
    except OSError as error:
        written.unlink(missing_ok=True)
        raise UsageError(f"{path}: cannot be written: {error.strerror}") from error
    return path
