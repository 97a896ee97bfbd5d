"""Leave out rows while every axis is off, and tell which."""

from __future__ import annotations

from collections import deque
from typing import Any

import numpy as np
from numpy.typing import NDArray

from motorctl.log.sample import AxisState

RECORDED_AFTER_S = 1.0
"""How an axis comes to rest after it was disabled is still recorded."""
MOST_PAUSES = 1000
"""A log tells of the last ones; how many there were, and how long, it tells of all."""


class PausesWhileOff:
    """Tells rows that are recorded from those that are left out; keeps account of the pauses."""

    def __init__(self) -> None:
        self.paused = False
        self._on_s: float | None = None
        """When an axis was last not off; until one is, when the recording began."""
        self._last: tuple[int, float] | None = None
        """Tick and time of the last row that was recorded."""
        self._pauses: deque[dict[str, float | int]] = deque(maxlen=MOST_PAUSES)
        self._count = 0
        self._seconds = 0.0

    def rows_to_record(
        self, ticks: NDArray[np.void], samples: NDArray[np.void]
    ) -> NDArray[np.bool_]:
        """Return which rows are recorded, shape (N,).

        Parameters
        ----------
        ticks
            Of TICK_SAMPLE, shape (N,), N at least 1.
        samples
            Of axis_sample, shape (N, axes).
        """
        times = ticks["time_s"]
        on = np.any(samples["state"] != AxisState.OFF, axis=1)
        if self._on_s is None:
            self._on_s = float(times[0])
        # The time of the last row with an axis that is not off, up to each row.
        seen = np.maximum.accumulate(np.where(on, times, self._on_s))
        self._on_s = float(seen[-1])
        recorded: NDArray[np.bool_] = on | (times - seen <= RECORDED_AFTER_S)
        self._account(ticks, recorded)
        self.paused = not recorded[-1]
        return recorded

    def take(self) -> dict[str, Any]:
        """Return what a log says of the pauses in it, and begin a new account."""
        told = {
            "pauses": {
                "while": "every axis off",
                "count": self._count,
                "seconds": self._seconds,
                "last": list(self._pauses),
            }
        }
        self._pauses.clear()
        self._count, self._seconds = 0, 0.0
        return told

    def _account(self, ticks: NDArray[np.void], recorded: NDArray[np.bool_]) -> None:
        # Where a row is recorded and the one before it was not, a pause ended.
        before = np.concatenate(([not self.paused], recorded[:-1]))
        for k in np.flatnonzero(recorded & ~before):
            if k and recorded[:k].any():
                last = int(np.flatnonzero(recorded[:k])[-1])
                self._last = (int(ticks["tick"][last]), float(ticks["time_s"][last]))
            if self._last is None:
                continue
            tick, time_s = int(ticks["tick"][k]), float(ticks["time_s"][k])
            self._count += 1
            self._seconds += time_s - self._last[1]
            self._pauses.append(
                {
                    "after_tick": self._last[0],
                    "before_tick": tick,
                    "from_s": self._last[1],
                    "to_s": time_s,
                }
            )
        if recorded.any():
            last = int(np.flatnonzero(recorded)[-1])
            self._last = (int(ticks["tick"][last]), float(ticks["time_s"][last]))
