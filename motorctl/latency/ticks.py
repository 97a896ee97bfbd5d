"""The ticks of a log: how late they began, how long they took, whether every one is there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from motorctl.latency.durations import Array, Durations
from motorctl.latency.loop_run import LoopRun
from motorctl.log.opened_parquet import OpenedParquet
from motorctl.log.sample import SampleFlag

PARTS = ("turnaround", "read", "compute", "write")
BATCH_ROWS = 65536


@dataclass
class TickTimes:
    """What a log tells of its ticks; durations are of the window in which the axes moved."""

    lateness: Durations
    parts: dict[str, Durations] = field(default_factory=lambda: {p: Durations() for p in PARTS})
    rows: int = 0
    periods_missing: int = 0
    """Periods without a row, from tick 0 to the last row."""
    periods_flagged: int = 0
    """Of them, how many stand right before a row that says so."""
    out_of_order: int = 0
    last_tick: int = -1
    window_skipped: int = 0

    def every_tick_is_there(self, run: LoopRun) -> bool:
        """Tell whether each period has its row, or was skipped by the loop and counted as such."""
        return (
            run.rows_lost == 0
            and self.out_of_order == 0
            and self.last_tick == run.ended_at_tick
            and self.periods_missing == self.periods_flagged == run.skipped_periods
        )

    @property
    def skipped_share(self) -> float:
        """The share of the window's periods that were skipped, 0 to 1."""
        return self.window_skipped / max(self.window_skipped + self.lateness.total, 1)


def read_ticks(run: LoopRun, axis: str, limits_s: Sequence[float]) -> TickTimes:
    """Go through a log in constant memory. `axis` is any axis of it."""
    times = TickTimes(Durations(limits_s))
    columns = ["tick", "time_s", "lateness_s", f"{axis}.flags", *(f"{p}_s" for p in PARTS)]
    with OpenedParquet(run.log) as file:
        for batch in file.batches(BATCH_ROWS, columns):
            values = {name: batch.column(name).to_numpy() for name in columns}
            _take(times, values, axis, run)
    return times


def _take(times: TickTimes, values: dict[str, Array], axis: str, run: LoopRun) -> None:
    tick = values["tick"].astype(np.int64)
    skipped = np.diff(tick, prepend=times.last_tick) - 1
    flagged = (values[f"{axis}.flags"].astype(np.int64) & SampleFlag.SKIPPED) != 0
    times.rows += len(tick)
    times.last_tick = int(tick[-1])
    times.out_of_order += int(np.count_nonzero(skipped < 0))
    times.periods_missing += int(skipped.sum())
    times.periods_flagged += int(skipped[flagged].sum())
    inside = (tick >= run.first_tick) & (tick <= run.last_tick)
    time_s = values["time_s"][inside]
    times.window_skipped += int(skipped[inside].sum())
    times.lateness.add(values["lateness_s"][inside], time_s=time_s)
    for part in PARTS:
        times.parts[part].add(values[f"{part}_s"][inside], time_s=time_s)
