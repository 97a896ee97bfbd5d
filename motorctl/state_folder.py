"""Where motorctl keeps what it has to know again: learned parameters, last runs, chosen code."""

from __future__ import annotations

import os
from pathlib import Path


def state_folder() -> Path:
    """Return the folder; of a service that which systemd made for it."""
    if directory := os.environ.get("STATE_DIRECTORY"):  # set by systemd
        return Path(directory.split(":")[0])
    base = os.environ.get("XDG_STATE_HOME")
    return (Path(base) if base else Path.home() / ".local" / "state") / "motorctl"
