"""Which frequencies a stretch of a column is made of."""

from __future__ import annotations

from typing import Any

import numpy as np

from motorctl.errors import UsageError
from motorctl.scope.planes import MOST_ROWS
from motorctl.scope.shown import GAP_PERIODS, Shown
from motorctl.scope.wire import Answer

LONGEST_SEGMENT = 1 << 15
"""Rows of a segment of Welch's method, at most: 6.6 s at 5 kHz, so lines 0.15 Hz apart. Longer
tells lines further apart, and the picture has more points than pixels. By hand."""
LEAST_ROWS = 64
AVERAGED = 4
"""A stretch is cut into so many segments, and overlapping ones between them. More make a smoother
line of fewer frequencies. By hand."""


def spectrum(shown: Shown, name: str, begin_s: float, end_s: float) -> Answer:
    """Return the amplitude spectrum of a column by Welch's method, with Hann's window.

    Parameters
    ----------
    shown
        The log.
    name
        Its column.
    begin_s, end_s
        From when to when [s] by the log's own clock. Where rows are missing in it, its longest
        stretch without a gap is taken, which the answer tells.

    Returns
    -------
    Answer
        `frequency_hz` and `amplitude`: of a sine at this frequency, its rms value. What is told has
        `note` where not all of the stretch was taken, or where it is too short.
    """
    from scipy.signal import welch  # half a second, which opening a log need not wait for

    if name not in shown.log.columns:
        raise UsageError(f"no column '{name}' in {shown.name}")
    first, last = shown.rows_between(begin_s, end_s)
    notes = []
    if last - first > MOST_ROWS:
        last = first + MOST_ROWS
        notes.append(f"the first {MOST_ROWS / shown.rate_hz():.4g} s of this view")
    time_s = shown.pyramid.rows("time_s", first, last)
    values = shown.pyramid.rows(name, first, last).astype(float)
    broken = np.diff(time_s) * shown.rate_hz() > GAP_PERIODS
    holes = np.concatenate(([0], np.flatnonzero(broken | ~np.isfinite(values[1:])) + 1))
    ends = np.append(holes[1:], len(values))
    longest = int(np.argmax(ends - holes))
    if len(holes) > 1:
        notes.append(f"the longest of {len(holes)} stretches without a gap")
    values = values[holes[longest] : ends[longest]]
    values = values[np.isfinite(values)]
    if len(values) < LEAST_ROWS:
        note = f"{len(values)} rows are too few for a spectrum: zoom out"
        return Answer({"note": note}, {"frequency_hz": np.empty(0), "amplitude": np.empty(0)})
    segment = min(LONGEST_SEGMENT, max(LEAST_ROWS, len(values) // AVERAGED))
    frequency_hz, power = welch(
        values, shown.rate_hz(), "hann", nperseg=segment, scaling="spectrum"
    )
    told: dict[str, Any] = {"note": "; ".join(notes)} if notes else {}
    told["resolution_hz"] = shown.rate_hz() / segment
    return Answer(told, {"frequency_hz": frequency_hz, "amplitude": np.sqrt(power)})
