"""Rows of a recording whose error a missing sample made, and none of the axis' models."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from motorctl.log import Recording
from motorctl.log.sample import SampleFlag

DISTURBED_S = 0.2
"""How long an error counts as that of samples that were missing before it [s]. Longer leaves
nothing of a run on a busy computer, shorter lets what a pause of it left count. Chosen by hand:
some twenty time constants 1/k1 of ordinary gains."""
LEAST_LEFT = 0.1
"""Part of the rows that must be left, or all count. More gives runs up that still tell, fewer
judges by moments. Chosen by hand."""
UNEVEN = 1.5
"""Distance of two rows, in periods, from which rows are missing between. Nearer to 1 trips over
rounded times, from 2 on a lost row passes. Chosen by hand."""
MISSED = int(SampleFlag.HELD | SampleFlag.SKIPPED)


def disturbed_rows(recording: Recording, name: str) -> NDArray[np.bool_]:
    """Return the rows in which an axis lacks a sample, or has lacked one shortly before.

    A driver that brought nothing new, periods that the loop skipped, and rows that were lost count
    alike. None where too little would be left.
    """
    flags, time_s = recording.axes[name].flags, recording.time_s
    missed = np.zeros(len(time_s), np.bool_)
    if flags is not None:
        missed |= flags & MISSED != 0
    missed[1:] |= np.diff(time_s) * recording.sample_rate_hz > UNEVEN
    last_s = np.maximum.accumulate(np.where(missed, time_s, -np.inf))
    disturbed: NDArray[np.bool_] = time_s - last_s <= DISTURBED_S
    if 1.0 - disturbed.mean() < LEAST_LEFT:
        return np.zeros(len(time_s), np.bool_)
    return disturbed
