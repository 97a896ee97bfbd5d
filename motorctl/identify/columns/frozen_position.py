"""A position that freezes in full motion: no brake stops an axis from one sample to the next."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from motorctl.errors import DataError
from motorctl.identify.columns.measured import SHORTEST_S, SHORTEST_SAMPLES, Measured

Array = NDArray[np.float64]

STUCK_S = 0.1
"""Shortest time that a position stands still after moving fast in the sample before, to count as
that of a stuck encoder [s]. Larger misses short freezes, smaller takes hard stops for one. Chosen
by hand."""
STUCK_SAMPLES = 10
"""Fewest samples of it, at low rates. Smaller takes a slow clock's repeats for a stuck encoder.
Chosen by hand."""
SPEED_S = 0.003
"""Time over which the speed before it is told [s]. Larger takes real braking for a freeze, smaller
sees few counts. Chosen by hand."""
BRAKING = 5.0
"""Acceleration that such a standstill would mean, over the hardest that the axis shows otherwise.
Larger misses encoders that stick in slow motion, smaller takes hard stops for one. Chosen by
hand."""
LONG_STUCK_S = 1.0
"""Time from which a position that stands still to the last count is more than a rest between moves
[s]. Larger misses encoders that stick late in a recording, smaller takes rests after a hard stop
for one. Chosen by hand."""
BRAKING_LONG = 2.0
"""The same factor where it stands still so long. Larger misses encoders that stick in slow motion;
smaller takes rests for them: sound machines come to one with a quarter. Measured on machines of
other hands, which stick with 3 to 20."""
ONE_STEP = 0.9
"""Part of the way before a standstill that may lie in one sample: more is a jump of the position,
not motion that ends. Larger takes jumps for motion, smaller misses encoders that stick while the
axis speeds up. Chosen by hand: half of it where the speed is steady."""


class _Freeze(NamedTuple):
    """A standstill that no brake makes: rows of the recording, and the speed before [1/s]."""

    first: int
    last: int
    """The first and the last row of the same position."""
    begin: int
    """Where the stretch begins that it is in."""
    speed: float


def without_stale_start(data: Measured) -> tuple[Measured, str | None]:
    """Take out the few first rows of an axis that stands still as soon as they are over.

    Their values are old ones, as where a recorder begins before the first new one has come; a motor
    stands while its command is below its friction. What freezes later, by as much as a standstill
    has to last, is told by `check_encoder`.

    Parameters
    ----------
    data
        The axis as measured.

    Returns
    -------
    Measured
        Without these rows.
    str or None
        A note that says so.
    """
    freeze = next(_freezes(data), None)
    if freeze is None or data.usable[: freeze.begin].any():
        return data, None
    stale = freeze.first - freeze.begin
    if stale >= _shortest(data):
        return data, None
    usable = data.usable.copy()
    usable[: freeze.first] = False
    still_s = (freeze.last - freeze.first) * data.period_s
    return replace(data, usable=usable), (
        f"the first {stale} rows are left out: they tell of a motion at {freeze.speed:.3g} "
        f"{data.position_unit}/s, and from the next sample on the axis stands still for "
        f"{still_s:.3g} s, which no brake does: they are values from before the recording"
    )


def check_encoder(data: Measured) -> None:
    """Raise DataError where the position freezes in full motion, with what to cut out."""
    freeze = next(_freezes(data), None)
    if freeze is None:
        return
    at_s = float(data.time_s[freeze.first])
    raise DataError(
        f"{data.place}: the position freezes at {at_s:.4g} s: it moved at "
        f"{freeze.speed:.3g} {data.position_unit}/s and stands still from one sample to the next, "
        f"for {(freeze.last - freeze.first) * data.period_s:.3g} s: the encoder or its line was "
        f"stuck; {_way_out(data, freeze)}"
    )


def _way_out(data: Measured, freeze: _Freeze) -> str:
    """Return which part beside a freeze is worth keeping, where one is."""
    time_s, used = data.time_s, np.flatnonzero(data.usable)
    before = float(time_s[used[0]]), float(time_s[freeze.first]) - data.period_s
    after = float(time_s[min(freeze.last + 1, used[-1])]), float(time_s[used[-1]])
    begin_s, end_s = max(before, after, key=lambda span: span[1] - span[0])
    least_s = max(SHORTEST_S, SHORTEST_SAMPLES * data.period_s)
    if end_s - begin_s < least_s:
        return (
            f"{end_s - begin_s:.2g} s beside it are too few to keep (at least {least_s:.2g} s are "
            "needed): record the motion anew"
        )
    return f"cut this part out (in a description: segments: {{fit: [{begin_s:.3f}, {end_s:.6f}]}})"


def _shortest(data: Measured) -> int:
    return max(STUCK_SAMPLES, round(STUCK_S * data.sample_rate_hz))


def _freezes(data: Measured) -> Iterator[_Freeze]:
    """Yield where the position freezes in full motion."""
    shortest = _shortest(data)
    for rows in data.stretches(2 * shortest):
        x = data.position[rows]
        steps = np.diff(x)
        if not steps.any():
            continue
        still = np.concatenate([[False], steps == 0.0, [False]])
        starts = np.flatnonzero(~still[:-1] & still[1:])
        lengths = np.flatnonzero(still[:-1] & ~still[1:]) - starts
        width = max(2, round(SPEED_S * data.sample_rate_hz))
        frozen = (lengths >= shortest) & (starts >= width)
        if not frozen.any():
            continue
        usual = _usual_change(x, width)
        for start, length in zip(starts[frozen], lengths[frozen], strict=True):
            way = abs(float(x[start] - x[start - width]))
            if np.abs(steps[start - width : start]).max() > ONE_STEP * way:
                continue
            long = length >= LONG_STUCK_S * data.sample_rate_hz
            if way > (BRAKING_LONG if long else BRAKING) * usual:
                first = rows.start + int(start)
                speed = way / width * data.sample_rate_hz
                yield _Freeze(first, first + int(length), rows.start, speed)


def _usual_change(x: Array, width: int) -> float:
    """Return the largest usual change of the way that is made in `width` samples."""
    way = x[width:] - x[:-width]
    change = np.abs(way[width:] - way[:-width])
    return float(np.percentile(change, 99.9)) if len(change) else 0.0
