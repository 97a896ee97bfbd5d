"""How long a daemon takes until it records: the first start of all, and the next ones."""

from __future__ import annotations

import tempfile
import time
from pathlib import Path

from motorctl.latency.figure import Figure, Target
from motorctl.latency.progress import Progress
from motorctl_benchmarks.running_daemon import running_daemon

CONFIG = "published_gantry"
NEXT_STARTS = 2
READY_TARGET = Target("value", "<=", 15.0)
"""Who runs motorctl for the first time waits no longer than this [s]."""


def start_figures(progress: Progress) -> tuple[list[Figure], list[str]]:
    """Start a daemon with nothing compiled, then again; return figures and notes."""
    with tempfile.TemporaryDirectory(prefix="motorctl-") as name:
        folder = Path(name)
        took_s = []
        for k in range(1 + NEXT_STARTS):
            took_s.append(_start_s(folder))
            progress((k + 1) / (1 + NEXT_STARTS))
    first, usual = took_s[0], min(took_s[1:])
    figure = Figure(
        name="first_start",
        title="first start, until it records",
        value=first,
        unit="s",
        peer="the next start",
        peer_value=usual,
        ratio=usual / first,
        target=READY_TARGET,
    )
    note = f"Start: `motorctl run {CONFIG}` from the command to the first row on the disk, with an "
    return [figure], [note + f"empty cache, and the best of {NEXT_STARTS} with the same cache."]


def _start_s(folder: Path) -> float:
    began = time.monotonic()
    with running_daemon(CONFIG, folder, {"XDG_CACHE_HOME": str(folder / "cache")}):
        return time.monotonic() - began
