"""A sensor that is slower than the log: each position stands for several rows, and is old in most.

Left in, the position is late by half of that time against the command, which reads as a lag of the
machine. So the rows with a new position are taken, and between them what the command was on the
whole.
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
"""Part of the new positions that come at the same place in the step. Smaller takes a coarse
encoder for a slow one, larger misses it beside a few late rows. Chosen by hand: the counts of a
coarse encoder come at every place alike."""

UNLIKE = 1.5
"""Most of the steps over the least, from which they are a sensor's: single counts are alike, at a
steady speed in step with the rows. Larger misses slow sensors of few counts a step, smaller takes
such counts for one. Arithmetic: between one count and two."""


def without_held(data: Measured) -> tuple[Measured, str | None]:
    """Return an axis at its sensor's own rate, and a note, where the log is faster than that."""
    new = np.flatnonzero(np.diff(data.position) != 0.0) + 1
    if len(new) < FEWEST_CHANGES:
        return data, None
    every = int(np.bincount(np.diff(new)).argmax())
    if every < 2:
        return data, None
    places = np.bincount(new % every, minlength=every)
    first = int(places.argmax())
    count = (len(data.position) - first) // every
    if places[first] < IN_STEP * len(new) or count < SHORTEST_SAMPLES:
        return data, None
    steps = np.abs(np.diff(data.position))[new - 1]
    if np.percentile(steps, 95.0) < UNLIKE * steps.min():
        return data, None
    return _at_every(data, first, every, count), (
        f"the position changes only at every {every}th row: its sensor gives a new one "
        f"{data.sample_rate_hz / every:.4g} times a second, and the log repeats it. These rows "
        "were taken, with the mean command between them"
    )


def _at_every(data: Measured, first: int, every: int, count: int) -> Measured:
    """Return an axis at each `every`-th row; the command acts until the next one."""
    rows = slice(first, first + count * every, every)

    def together(column: NDArray[np.generic]) -> NDArray[np.generic]:
        return column[first : first + count * every].reshape(count, every)

    def at(column: Array | None) -> Array | None:
        return None if column is None else column[rows]

    time_s = together(data.time_s)
    whole = np.ptp(time_s, axis=1) < every * data.period_s
    return replace(
        data,
        sample_rate_hz=data.sample_rate_hz / every,
        time_s=data.time_s[rows],
        position=data.position[rows],
        command=together(data.command).mean(axis=1),
        usable=together(data.usable).all(axis=1) & whole,
        reference=at(data.reference),
        reference_velocity=at(data.reference_velocity),
        saturated=None if data.saturated is None else np.any(together(data.saturated), axis=1),
        others={name: _at_every(other, first, every, count) for name, other in data.others.items()},
    )
