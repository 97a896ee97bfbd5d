"""The reference instrument: cyclictest of rt-tests, run for the loop's CPU, priority and period."""

from __future__ import annotations

import json
import math
import shutil
import subprocess
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from motorctl.errors import RunError
from motorctl.latency.durations import Durations

INSTALL = "cyclictest is not installed; on Debian or Ubuntu: apt-get install rt-tests"
LONGEST_US = 100_000
"""Latencies from here on are only counted."""
SLACK_S = 30.0


@dataclass(frozen=True)
class Rival:
    """What cyclictest found, over all of its runs."""

    command: str
    version: str
    latency: Durations
    skipped: int
    """Periods that passed while a wake-up was late."""

    @property
    def skipped_share(self) -> float:
        """The share of all periods, 0 to 1."""
        return self.skipped / max(self.skipped + self.latency.total, 1)


def cyclictest_command(cpu: int, priority: int, interval_us: int) -> list[str] | None:
    """Return cyclictest's command but duration and output; None where it is not installed."""
    program = shutil.which("cyclictest")
    if program is None:
        return None
    return [
        program,
        "-m",
        f"-p{priority}",
        f"-a{cpu}",
        "-t1",
        f"-i{interval_us}",
        "-q",
        f"-h{LONGEST_US}",
    ]


def run_cyclictest(command: Sequence[str], duration_s: float) -> dict[str, Any]:
    """Run it for whole seconds and give its JSON document.

    Raises RunError, with what it said, where it fails.
    """
    seconds = max(1, math.ceil(duration_s))
    with tempfile.TemporaryDirectory(prefix="motorctl-") as folder:
        report = Path(folder) / "cyclictest.json"
        output = [f"-D{seconds}", "--histfile=/dev/null", f"--json={report}"]
        try:
            done = subprocess.run(
                [*command, *output],
                capture_output=True,
                text=True,
                timeout=seconds + SLACK_S,
                check=False,
            )
            if done.returncode == 0:
                document: dict[str, Any] = json.loads(report.read_text())
                return document
            said = (done.stderr.strip() or done.stdout.strip()).splitlines()
            why = said[0] if said else f"status {done.returncode}"
        except subprocess.TimeoutExpired:
            why = f"it did not end within {seconds + SLACK_S:g} s"
        except (OSError, ValueError) as error:
            why = str(error)
    raise RunError(f"cyclictest failed: {why}")


def rival_of(
    command: Sequence[str],
    documents: Sequence[dict[str, Any]],
    limits_s: Sequence[float],
    interval_us: int,
) -> Rival:
    """Join the documents of several runs. Latencies are whole microseconds, rounded down."""
    latency = Durations(limits_s)
    skipped = 0
    for document in documents:
        thread = document["thread"]["0"]
        bins = {int(us): int(count) for us, count in thread["histogram"].items()}
        beyond = int(thread["cycles"]) - sum(bins.values())
        if beyond:  # of these only the longest is known
            bins[LONGEST_US] = bins.get(LONGEST_US, 0) + beyond - 1
            bins[int(thread["max"])] = bins.get(int(thread["max"]), 0) + 1
        us = np.array(sorted(bins), float)
        counts = np.array([bins[int(value)] for value in us], np.int64)
        # A whole microsecond stands for what lies between it and the next.
        latency.add((us + 0.5) * 1e-6, counts=counts)
        skipped += int((us // interval_us * counts).sum())
    version = str(documents[0].get("rt_test_version:", "?")) if documents else "?"
    return Rival(" ".join(command), version, latency, skipped)
