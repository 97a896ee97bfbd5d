"""Whether a recording with long holes is one of tests with pauses between them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from motorctl.errors import DataError
from motorctl.log.table import Table
from motorctl.log.uneven_times import longest_step, usual_step

Array = NDArray[np.float64]

LONG_STRETCH = 100
"""Rows without a hole from which they are a recording of their own, and not samples that come with
events. Larger refuses short tests with pauses between them, smaller takes samples that come with
events for a time base. Chosen by hand: as many as an axis needs to be identified."""
MOSTLY_LONG = 0.5
"""Part of the rows that stand in long stretches, from which the holes between them are pauses
between tests, however long. Larger refuses tests that were recorded one after the other, smaller
takes samples that come with events for a time base. Chosen by hand: more than the others."""
ENOUGH_ROWS = 2000
"""Rows in long stretches that do, however many others there are. Larger refuses a long test behind
many short ones, smaller takes chance stretches of samples that come with events. Chosen by hand:
twenty of the shortest."""
PAUSED_TIMES = 50
"""How many times longer than the recording its pauses may be. Larger takes memory, smaller refuses
short tests with long pauses between them. Chosen by hand."""


def require_stretches(table: Table, name: str, time_s: Array, missing: int) -> None:
    """Raise DataError where too little stands between the holes, or they are too long to fill.

    Parameters
    ----------
    table
        The file, for messages.
    name, time_s
        Name and values of its column of times; [s], shape (N,).
    missing
        How many samples the holes would have.
    """
    rows, in_long = len(time_s), _rows_in_long_stretches(time_s)
    if in_long < min(MOSTLY_LONG * rows, ENOUGH_ROWS):
        why = (
            f"more samples are missing than there are: only {in_long} of {rows} rows stand in "
            f"stretches of at least {LONG_STRETCH} without a hole, and {100.0 * MOSTLY_LONG:g} % "
            f"are needed, or {ENOUGH_ROWS}: record longer stretches"
        )
    elif missing > PAUSED_TIMES * rows:
        why = (
            f"{missing} samples are missing, {missing / rows:.3g} times the {rows} that there are "
            f"(limit {PAUSED_TIMES}): cut out one stretch of the recording"
        )
    else:
        return
    steps = np.diff(time_s)
    k = int(np.argmax(steps)) + 1
    raise DataError(
        f"{table.path}: {table.row(k)}: column '{name}' steps by {steps[k - 1]:.6g} s, usually by "
        f"{usual_step(time_s):.6g} s, and {why}, or describe it in YAML with sample_rate_hz where "
        "only the times are inexact"
    )


def _rows_in_long_stretches(time_s: Array) -> int:
    """Return how many rows stand in stretches of `LONG_STRETCH` rows or more without a hole."""
    holes = np.flatnonzero(np.diff(time_s) > longest_step(time_s)) + 1
    lengths = np.diff(np.concatenate(([0], holes, [len(time_s)])))
    return int(lengths[lengths >= LONG_STRETCH].sum())
