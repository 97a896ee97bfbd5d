"""Columns that were recorded apart and stand in one file row by row, most cells blank.

So write PlotJuggler, and an outer join of tables: a row has the time of one message, and the values
that came with it.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np
from numpy.typing import NDArray

from motorctl.log.description import Description
from motorctl.log.table import Array

FEWEST_VALUES = 16
"""Of each motion; fewer are no recording. A command that has fewer was written when it changed, and
holds to the end. Larger refuses short ones, smaller takes an empty column for one of its own times.
As many as the time base needs."""
FEWEST_COMMANDS = 2
"""Values of a command that was written when it changed. Fewer never drove anything. Arithmetic."""
UNEVEN = 3.0
"""Longest time between two values of a command over the usual one, from which it was written when
it changed. Larger cuts recordings off behind the last change, smaller takes a stream that broke off
for one that holds. Chosen by hand."""
TOGETHER = 0.5
"""Part of the values of the sparser of position and command that may stand in a row with the
other. Where more do, they were recorded together, and blanks are damage. Larger takes a damaged
column for one of its own times, smaller refuses streams that often share a time. Chosen by hand."""


def brought_together(
    columns: Mapping[str, Array], description: Description
) -> tuple[dict[str, Array], tuple[str, ...]]:
    """Return columns in the rows of the first axis' motion, where position and command stand apart.

    A command holds from the row where it stands; of motions and references straight lines lead from
    one value to the next. Rows before every column has begun and behind the end of one are left
    out.

    Parameters
    ----------
    columns
        Every column that the description names, (N,) each; a blank is NaN.
    description
        Which of them is what.

    Returns
    -------
    columns : dict of str to ndarray
        The same columns, (M,) each; those that came in where they were recorded together.
    notes : tuple of str
        What was done.
    """
    clock = description.time
    axes = description.axes.values()
    apart = [name for name, axis in description.axes.items() if _apart(columns, axis.columns)]
    streams = dict.fromkeys(name for axis in axes for name in axis.columns.values())
    held = {axis.command.column for axis in axes}
    count = {name: np.count_nonzero(_given(columns[name])) for name in streams}
    enough = all(
        n >= (FEWEST_COMMANDS if name in held else FEWEST_VALUES) for name, n in count.items()
    )
    if clock is None or not apart or not enough:
        return dict(columns), ()
    first = description.axes[apart[0]]
    lead, led = first.motion.column, first.command.column
    time = columns[clock.column]
    at = np.flatnonzero(_given(columns[lead]))
    begin, end = _common(time, [(_given(columns[name]), name in held) for name in streams])
    at = at[(time[at] >= begin) & (time[at] <= end)]
    out = {name: values[at] for name, values in columns.items()}
    for name in streams:
        values = columns[name]
        rows = np.flatnonzero(_given(values))
        if name in held:
            before = np.searchsorted(rows, at, side="right") - 1
            out[name] = values[rows[np.maximum(before, 0)]]
        else:
            out[name] = np.interp(time[at], time[rows], values[rows])
    note = (
        f"column '{lead}' stands in {np.count_nonzero(_given(columns[lead]))} of {len(time)} rows, "
        f"the command of axis {apart[0]} in {count[led]} others: commands are taken as they were "
        f"held when the {len(at)} positions were recorded"
    )
    return out, (note,)


def _given(values: Array) -> NDArray[np.bool_]:
    return ~np.isnan(values)


def _apart(columns: Mapping[str, Array], of_axis: Mapping[str, str]) -> bool:
    """Return whether an axis' motion and command hardly ever stand in one row."""
    motion = _given(columns[of_axis.get("position") or of_axis["velocity"]])
    command = _given(columns[of_axis["command"]])
    fewer = min(np.count_nonzero(motion), np.count_nonzero(command))
    shared = np.count_nonzero(motion & command)
    return bool(shared < TOGETHER * fewer)


def _common(time: Array, streams: Iterable[tuple[NDArray[np.bool_], bool]]) -> tuple[float, float]:
    """Return when the last of all streams begins, and when the first of them ends.

    Of each: in which rows it stands, and whether it holds until it is written again.
    One of few values, or of uneven ones, was written when it changed, and has no end.
    """
    begins, ends = [], []
    for given, holds in streams:
        times = time[given]
        begins.append(float(times[0]))
        steps = np.diff(times)
        usual = float(np.median(steps))
        if len(times) >= FEWEST_VALUES and not (holds and steps.max() > UNEVEN * usual):
            ends.append(float(times[-1]) + usual)
    return max(begins), min(ends, default=np.inf)
