"""The last rows of a running machine, column by column, in memory of a fixed size."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from motorctl.api.log import Extremes
from motorctl.api.samples import Samples

SPARE_SHARE = 0.25
"""How much more than is kept there is room for, so that rows are moved seldom. By hand."""
PIECE_ROWS = 1 << 16


class History:
    """Rows that were heard, the newest `kept_s` seconds; what the page draws of a machine.

    Parameters
    ----------
    first
        Samples of which it takes columns, units and what they say of the machine; no rows.
    kept_s
        How many seconds are kept.
    """

    def __init__(self, first: Samples, kept_s: float) -> None:
        self.metadata: Mapping[str, Any] = first.metadata
        self.sample_rate_hz = float(first.metadata["rate_hz"])
        self.units, self.columns, self.axes = first.units, first.columns, first.axes
        self.log_axes, self.run = first.log_axes, first.run
        self.notes: tuple[str, ...] = ()
        self._kept = round(kept_s * self.sample_rate_hz)
        room = round(self._kept * (1 + SPARE_SHARE))
        self._room = {name: np.empty(room, first[name].dtype) for name in first.columns}
        self._begin = self._end = 0
        self.dropped = 0
        """Rows before the first that is still here."""

    def takes(self, samples: Samples) -> bool:
        """Tell whether these rows are of the same run and have the same columns."""
        return samples.run == self.run and samples.columns == self.columns

    def add(self, samples: Samples) -> None:
        """Take rows in, and let the oldest go."""
        count = min(samples.rows, self._kept)
        room = len(self._room["tick"])
        if self._end + count > room:
            keep = min(self.rows, self._kept - count)
            for values in self._room.values():
                values[:keep] = values[self._end - keep : self._end].copy()
            self.dropped += self.rows - keep
            self._begin, self._end = 0, keep
        for name, values in self._room.items():
            values[self._end : self._end + count] = samples[name][samples.rows - count :]
        self.dropped += samples.rows - count
        self._end += count
        extra = self.rows - self._kept
        if extra > 0:
            self._begin += extra
            self.dropped += extra

    @property
    def rows(self) -> int:
        """How many are here."""
        return self._end - self._begin

    def part(self, name: str, first: int, last: int) -> NDArray[Any]:
        """Return the rows from `first` to before `last` of a column, as they are now."""
        begin = self._begin + max(first, 0)
        return self._room[name][begin : min(self._begin + last, self._end)]

    def extremes(self, name: str) -> Extremes:
        """Return the pieces; nothing is known of them beforehand."""
        begins = np.arange(0, self.rows, PIECE_ROWS)
        unknown = np.full(len(begins), np.nan)
        return Extremes(begins, unknown, unknown)
