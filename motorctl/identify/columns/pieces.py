"""Parts of the signals: pieces that stand for a long recording, and what lies outside a time."""

from __future__ import annotations

import math
from dataclasses import replace

from motorctl.identify.columns.signals import FEWEST_ROWS, Signals
from motorctl.identify.columns.stretches import TRIM_PERIODS

PIECE_S = 3.0
"""Length of the pieces that stand for a long recording [s]. Larger sees fewer places, smaller loses
more rows to trimming. Chosen by hand."""
PIECE_TRIMS = 6
"""They are at least so many times what is dropped at one end: two of six parts are lost. Larger
sees fewer places, smaller loses more. Arithmetic."""


def without(signals: Signals, begin_s: float, end_s: float) -> Signals:
    """Return the rows that lie not between two times."""
    kept = []
    for s, used in zip(signals.stretches, signals.kept, strict=True):
        time_s = s.time_s[:: signals.decimation]
        kept.append(used & ~((time_s >= begin_s) & (time_s < end_s)))
    return replace(signals, kept=tuple(kept), _gains={})


def shortened(signals: Signals, longest_s: float) -> Signals:
    """Return pieces of a long recording, spread evenly over it, that last about `longest_s`."""
    total_s = sum(len(s.x) for s in signals.stretches) * signals.period_s
    every = int(total_s / longest_s)
    if every < 2:
        return signals
    trim = math.ceil(TRIM_PERIODS / signals.band_hz / signals.row_period_s)
    length = max(round(PIECE_S / signals.row_period_s), PIECE_TRIMS * trim)
    d = signals.decimation
    stretches, kept = [], []
    count = 0
    for s, used in zip(signals.stretches, signals.kept, strict=True):
        for first in range(0, max(len(used) - length, 0) + 1, length):
            count += 1
            if count % every:
                continue
            rows = slice(first * d, (first + length) * d)  # all of what is shorter
            stretches.append(s.part(rows))
            inner = used[first : first + length].copy()
            inner[:trim] = False
            inner[len(inner) - trim :] = False
            kept.append(inner[: -(-len(stretches[-1].x) // d)])
    if sum(int(k.sum()) for k in kept) < FEWEST_ROWS:  # it comes slowly, or hardly ever moves
        return signals
    return replace(signals.with_stretches(tuple(stretches)), kept=tuple(kept))
