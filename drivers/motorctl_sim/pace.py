"""How many periods passed between two reads on the wall clock."""

from __future__ import annotations


class Pace:
    """Count whole periods from the times of reads, as hardware does that samples by its own clock.

    Reads come late, never early: the earliest ones show the phase of the reader's clock. A read
    that is late by less than a period finds the sample that was taken on time; a skipped period
    counts.
    """

    MAX_PERIODS = 1000
    """Bound on the work of one read. Two axes compute a period in about 1 % of its length, so
    making up for a pause costs about 1 % of the pause; what is beyond the bound is dropped."""
    EARLY = 0.02
    """Share of a period by which a read may come before its time, by rounding."""
    FOLLOW = 1 / 1024
    """How fast the phase gives way to reads that come later and later."""

    def __init__(self, period_s: float) -> None:
        self._period_ns = period_s * 1e9
        self._last_ns: float | None = None

    def restart(self) -> None:
        """Forget the phase: the next read starts the clock."""
        self._last_ns = None

    def periods(self, now_ns: int) -> int:
        """Return the whole periods since the last call: at least one, at most MAX_PERIODS."""
        if self._last_ns is None:
            self._last_ns = float(now_ns)
            return 0
        elapsed = (now_ns - self._last_ns) / self._period_ns
        periods = max(1, int(elapsed + self.EARLY))
        if periods > self.MAX_PERIODS:
            self._last_ns = float(now_ns)
            return self.MAX_PERIODS
        phase = elapsed - periods
        if phase < 0.0:
            self._last_ns = float(now_ns)
        else:
            self._last_ns += (periods + self.FOLLOW * phase) * self._period_ns
        return periods
