"""Which source is measured: the commit that is checked out."""

from __future__ import annotations

import subprocess
from importlib.metadata import version
from pathlib import Path


def commit_words() -> str:
    """Return the commit, and whether files differ from it; outside a checkout the version."""
    head = _git("rev-parse", "--short=7", "HEAD")
    if not head:
        return f"unknown, of version {version('motorctl')}"
    return f"{head} with changes" if _git("status", "--porcelain") else head


def _git(*arguments: str) -> str:
    """Return what git says of the folder in which this module lies; empty where it says nothing."""
    folder = Path(__file__).parent
    try:
        told = subprocess.run(
            ["git", "-C", str(folder), *arguments], capture_output=True, text=True, check=False
        )
    except OSError:
        return ""
    return told.stdout.strip() if told.returncode == 0 else ""
