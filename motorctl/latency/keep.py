"""Keep a latency measurement in a folder: the picture and the document."""

from __future__ import annotations

import json
from pathlib import Path

from motorctl.errors import UsageError
from motorctl.latency.plot import draw
from motorctl.latency.result import Latency


def keep_latency(latency: Latency, folder: Path) -> None:
    """Write latency.png and latency.json; raises UsageError where that is not possible."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        draw(latency, folder / "latency.png")
        document = json.dumps(latency.document(), indent=2)
        (folder / "latency.json").write_text(document + "\n")
    except OSError as error:
        raise UsageError(f"{folder}: cannot be written to: {error.strerror}") from error
