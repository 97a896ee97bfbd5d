"""A summary of a recording's timing, gathered batch by batch."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

PERCENTILES = {"p50_s": 50.0, "p99_s": 99.0, "p999_s": 99.9}
SHORTEST_S = 1e-8
LONGEST_S = 10.0
BINS_PER_DECADE = 100
"""A percentile is then known to about 2 %."""


class DurationSummary:
    """Percentiles and the worst case of a duration that is measured once a tick."""

    def __init__(self) -> None:
        decades = np.log10(LONGEST_S / SHORTEST_S)
        self._edges = np.geomspace(SHORTEST_S, LONGEST_S, round(decades * BINS_PER_DECADE) + 1)
        self._counts = np.zeros(len(self._edges) + 1, np.int64)
        self._worst = -np.inf
        self._worst_at_s = np.nan

    def add(self, time_s: Array, duration_s: Array) -> None:
        """Take further ticks into account; arrays of equal length."""
        bins = np.searchsorted(self._edges, duration_s, side="right")
        self._counts += np.bincount(bins, minlength=len(self._counts))
        k = int(np.argmax(duration_s))
        if duration_s[k] > self._worst:
            self._worst, self._worst_at_s = float(duration_s[k]), float(time_s[k])

    def result(self) -> dict[str, float] | None:
        """Return percentiles (to about 2 %), the maximum and its time; None without ticks."""
        total = int(self._counts.sum())
        if total == 0:
            return None
        upper = np.concatenate(([0.0], self._edges[1:], [self._worst]))
        cumulative = np.cumsum(self._counts)
        found: dict[str, float] = {}
        for name, percentile in PERCENTILES.items():
            k = int(np.searchsorted(cumulative, np.ceil(total * percentile / 100)))
            found[name] = float(min(upper[k], self._worst))
        return found | {"max_s": self._worst, "max_at_s": self._worst_at_s}


class TimingSummary:
    """Lateness, turnaround and skipped periods of a recording."""

    def __init__(self) -> None:
        self._lateness = DurationSummary()
        self._turnaround = DurationSummary()
        self._first_tick = 0
        self._last_tick = 0
        self.rows = 0

    def add(
        self, tick: NDArray[np.int64], time_s: Array, lateness_s: Array, turnaround_s: Array
    ) -> None:
        """Take further ticks into account; arrays of equal length, at least one long."""
        if self.rows == 0:
            self._first_tick = int(tick[0])
        self._last_tick = int(tick[-1])
        self.rows += len(tick)
        self._lateness.add(time_s, lateness_s)
        self._turnaround.add(time_s, turnaround_s)

    def result(self) -> dict[str, Any]:
        """Return the summary as it stands in a log's metadata under the key `timing`."""
        spanned = self._last_tick - self._first_tick + 1
        return {
            "lateness": self._lateness.result(),
            "turnaround": self._turnaround.result(),
            "ticks_missing": max(spanned - self.rows, 0) if self.rows else 0,
        }
