"""A sensor that is slower than the log: each position stands for several rows, and is old in most.

Left in, the position is late by half of that time against the command, which reads as a lag of the
machine. So the rows with a new position are taken, and between them what the command was on the
whole. Sensor and log have clocks of their own: the place of a new position among the rows slips.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from motorctl.identify.columns.measured import SHORTEST_SAMPLES, Measured

Array = NDArray[np.float64]

FEWEST_CHANGES = 50
"""New positions from which it is asked. More misses short recordings, fewer may find a slow axis'
counts in step by chance. Chosen by hand."""
IN_STEP = 0.98
"""Part of the new positions that come at least SOONEST of the usual distance after the one before.
Smaller takes a coarse encoder for a slow one, larger misses it beside a few late rows. Chosen by
hand: the counts of a coarse encoder come at every distance from a single row on."""
SOONEST = 0.65
"""Part of the usual distance of new positions at which one may come, where two clocks slip or the
logger is late. Larger misses sensors beside a logger that is not in step with them, smaller takes
half a distance for one. Chosen by hand: a robot's logger of ten rows has 0.7."""

UNLIKE = 1.5
"""Most of the steps over the least, from which they are a sensor's: single counts are alike, at a
steady speed in step with the rows. Larger misses slow sensors of few counts a step, smaller takes
such counts for one. Arithmetic: between one count and two."""


def without_held(data: Measured) -> tuple[Measured, str | None]:
    """Return an axis at its sensor's own rate, and a note, where the log is faster than that."""
    recorded = data.usable[1:] & data.usable[:-1]  # in a hole the position is filled in
    new = np.flatnonzero(recorded & (np.diff(data.position) != 0.0)) + 1
    if len(new) < FEWEST_CHANGES:
        return data, None
    apart = np.diff(new)
    every = int(np.bincount(apart).argmax())
    if every < 2 or np.mean(apart >= SOONEST * every) < IN_STEP:
        return data, None
    steps = np.abs(np.diff(data.position))[new - 1]
    if np.percentile(steps, 95.0) < UNLIKE * steps.min():
        return data, None
    in_time = np.concatenate([[True], apart >= 0.5 * every])  # sooner, it would end a stretch
    rows = _rows_of_sensor(new[in_time], every, len(data.position))
    if len(rows) - 1 < SHORTEST_SAMPLES:
        return data, None
    rate_hz = data.sample_rate_hz * (len(rows) - 1) / float(rows[-1] - rows[0])
    return _at(data, rows, rate_hz), (
        f"the position changes only at every {every}th row: its sensor gives a new one "
        f"{rate_hz:.4g} times a second, and the log repeats it. These rows were taken, with the "
        "mean command between them"
    )


def _rows_of_sensor(new: NDArray[np.int64], every: int, count: int) -> NDArray[np.int64]:
    """Return where the sensor gave a position, whether or not it was another one, and an end.

    Between two new ones at several distances it gave the old one, as at rest.
    """
    begin, end = new[0] % every, new[-1] + (count - new[-1]) // every * every
    told = np.unique(np.concatenate([[begin], new, [end]]))
    times = np.maximum(np.rint(np.diff(told) / every), 1.0)
    counted = np.concatenate([[0.0], np.cumsum(times)])
    places = np.interp(np.arange(counted[-1] + 1.0), counted, told)
    return np.asarray(np.rint(places), np.int64)


def _at(data: Measured, rows: NDArray[np.int64], rate_hz: float) -> Measured:
    """Return an axis at these rows but the last; the command of each acts until the next one."""
    from_row, end = rows[:-1], rows[-1]
    lengths = np.diff(rows)

    def at(column: Array | None) -> Array | None:
        return None if column is None else column[from_row]

    def every_of(column: NDArray[np.bool_]) -> NDArray[np.bool_]:
        return np.logical_and.reduceat(column[:end], from_row)

    took_s = data.time_s[rows[1:] - 1] - data.time_s[from_row]
    whole = took_s < lengths * data.period_s
    saturated = data.saturated
    return replace(
        data,
        sample_rate_hz=rate_hz,
        time_s=data.time_s[from_row],
        position=data.position[from_row],
        command=np.add.reduceat(data.command[:end], from_row) / lengths,
        usable=every_of(data.usable) & whole,
        reference=at(data.reference),
        reference_velocity=at(data.reference_velocity),
        saturated=None if saturated is None else ~every_of(~saturated),
        others={name: _at(other, rows, rate_hz) for name, other in data.others.items()},
    )
