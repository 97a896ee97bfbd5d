"""Durations of many wake-ups in constant memory: percentiles, the worst, how many beyond limits."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

BINS_PER_DECADE = 200
"""A percentile is then known to about 1 %."""
EDGES_S: Array = np.geomspace(1e-9, 10.0, 10 * BINS_PER_DECADE + 1)
PERCENTILES = {"p50_us": 50.0, "p99_us": 99.0, "p999_us": 99.9}
US = 1e6


class Durations:
    """Gathers durations batch by batch."""

    def __init__(self, limits_s: Sequence[float] = ()) -> None:
        """Begin with none; beyond each of the limits they are counted exactly."""
        self.total = 0
        self.counts = np.zeros(len(EDGES_S) + 1, np.int64)
        self.worst_s = -np.inf
        self.worst_at_s: float | None = None
        self._beyond = dict.fromkeys(limits_s, 0)

    def add(
        self,
        duration_s: Array,
        *,
        time_s: Array | None = None,
        counts: NDArray[np.int64] | None = None,
    ) -> None:
        """Take durations of shape (N,) with the times at which they were measured.

        counts tells how often each occurred; once unless given.
        """
        if len(duration_s) == 0:
            return
        often = np.ones(len(duration_s), np.int64) if counts is None else counts
        place = np.searchsorted(EDGES_S, duration_s, side="right")
        np.add.at(self.counts, place, often)
        self.total += int(often.sum())
        for limit in self._beyond:
            self._beyond[limit] += int(often[duration_s > limit].sum())
        k = int(np.argmax(duration_s))
        if duration_s[k] > self.worst_s:
            self.worst_s = float(duration_s[k])
            self.worst_at_s = None if time_s is None else float(time_s[k])

    def share_beyond(self, limit_s: float) -> float:
        """Return the share of durations above one of the limits, 0 to 1."""
        return self._beyond[limit_s] / self.total if self.total else 0.0

    def percentile_s(self, percentile: float) -> float:
        """Return a percentile, rounded up to the end of its bin."""
        if self.total == 0:
            return float("nan")
        rank = np.ceil(self.total * percentile / 100.0)
        k = int(np.searchsorted(np.cumsum(self.counts), rank))
        return min(float(EDGES_S[min(k, len(EDGES_S) - 1)]), self.worst_s)

    def between(self, edges_s: Array) -> NDArray[np.int64]:
        """Count into coarser bins: below the first edge, between edges, from the last edge on.

        Edges that are none of EDGES_S are moved to the next one.
        """
        cumulative = np.concatenate([[0], np.cumsum(self.counts)])
        ends = np.searchsorted(EDGES_S, edges_s * (1.0 - 1e-9)) + 1
        return np.diff(cumulative[ends], prepend=0, append=self.total)

    def document(self) -> dict[str, Any]:
        """Return percentiles and the worst in microseconds; null without any duration."""
        if self.total == 0:
            return dict.fromkeys([*PERCENTILES, "max_us", "max_at_s"])
        found: dict[str, Any] = {
            name: self.percentile_s(percentile) * US for name, percentile in PERCENTILES.items()
        }
        return found | {"max_us": self.worst_s * US, "max_at_s": self.worst_at_s}
