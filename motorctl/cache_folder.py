"""Where motorctl keeps what it can make again: compiled kernels, and what their sources say."""

from __future__ import annotations

import os
from pathlib import Path


def cache_root() -> Path:
    """Return the folder for what can be made again.

    Returns
    -------
    Path
        That of systemd's CacheDirectory=, else the user's cache; it may not exist yet.
    """
    if directory := os.environ.get("CACHE_DIRECTORY"):
        return Path(directory.split(":")[0])
    base = os.environ.get("XDG_CACHE_HOME")
    return (Path(base) if base else Path.home() / ".cache") / "motorctl"
