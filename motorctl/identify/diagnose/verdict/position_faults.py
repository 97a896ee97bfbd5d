"""What a position column shows that no motion of an axis is: standstill, jumps, coarse steps."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from motorctl.identify.columns.filters import second_difference
from motorctl.identify.columns.measured import Measured, resolution_of
from motorctl.identify.columns.signals import Signals
from motorctl.identify.columns.stretches import smoothed

Array = NDArray[np.float64]

STANDS_S = 1.0
"""Shortest time for which a position that stands still to the last count is looked at [s]. Larger
misses encoders that were stuck shortly, smaller asks rests between moves. Chosen by hand."""
FEWEST_SAMPLES = 20
"""Fewest samples of it, at low rates. Larger misses short ones, smaller judges a swing by a few
samples. Chosen by hand."""
AS_WIDE = 0.6
"""Spread of the command while the position stands still, over its spread in motion, from which the
axis should have moved. Larger misses stuck encoders of calm axes, smaller tells it of joints that
rest while others move. Chosen by hand: joints of real arms rest with at most 0.51, with an encoder
that is stuck they have 0.65 to 1.2."""
AS_SLOW = 0.5
"""Time between the command's swings there, over that in motion, at least: what swings faster than
the axis can follow need not move it. Larger misses stuck encoders, smaller suspects the end of a
sweep. Chosen by hand: half as slow."""
ASIDE = 0.5
"""How far from its mean a swing of the command must reach, in its standard deviations. Larger
counts wide swings alone, smaller counts noise. Chosen by hand."""
SMOOTHED_S = 0.02
"""Time over which the command is smoothed before its swings are counted [s]. Larger misses quick
swings, smaller counts noise. Chosen by hand."""

AROUND = 4
"""Steps before and after one of the position to which it is compared. More misses jumps next to
fast motion, fewer takes its beginning for one. Chosen by hand."""
JUMPS = 5.0
"""A step over the largest of those around it, from which it is a jump. Larger misses jumps in
motion, smaller takes hard starts for them. Chosen by hand."""
MOST_OF_IT = 0.5
"""Part of the squared second differences that jumps make, from which they are the reason why
nothing explains the acceleration. Larger misses that reason, smaller gives it where another is the
true one. Chosen by hand: more than all else."""
DROWNED = 0.3
"""Part of the squared acceleration that the steps make, from which it may be the steps' own.
Larger takes coarse positions for wrong units, smaller excuses wrong units. Chosen by hand:
positions in such steps have 0.6 to 0.9."""
WHOLE = 0.02
"""Mean distance of the position's steps from whole ones, in steps, up to which it comes in them;
any other position has 0.25. Larger takes a fine position for a coarse one, smaller misses steps
where a text file's last digits are off. Arithmetic, with room for rounding chosen by hand."""


def without_stuck(data: Measured) -> tuple[Measured, str | None]:
    """Take out the rows of an encoder that stood still while the command swung as in motion.

    One that freezes in full motion is known by that alone (`check_columns`); one that is stuck from
    slow motion or from a rest on is known by a command that goes on as before.

    Parameters
    ----------
    data
        The axis as measured.

    Returns
    -------
    Measured
        Without the rows in which the encoder, or the axis, was stuck.
    str or None
        A note that says so.
    """
    parts = list(_still(data))
    moving = data.usable.copy()
    for part in parts:
        moving[part] = False
    if not parts or not moving.any():
        return data, None
    usual = float(np.std(data.command[moving]))
    runs = [data.command[rows] for rows in replace(data, usable=moving).stretches(FEWEST_SAMPLES)]
    moving_swings = sum(swings(run, data.period_s) for run in runs)
    if usual == 0.0 or moving_swings == 0:
        return data, None
    between_s = sum(len(run) for run in runs) * data.period_s / moving_swings
    usable, told = data.usable.copy(), []
    for part in parts:
        command = data.command[part]
        spread, count = float(np.std(command)), swings(command, data.period_s)
        lasts_s = len(command) * data.period_s
        if spread < AS_WIDE * usual or count == 0 or lasts_s < AS_SLOW * between_s * count:
            continue
        usable[part] = False
        told.append((float(data.time_s[part.start]), lasts_s, spread))
    if not told:
        return data, None
    at_s, lasts_s, spread = told[0]
    more = f" (and {len(told) - 1} times more)" if len(told) > 1 else ""
    return replace(data, usable=usable), (
        f"the position stands still to the last count from {at_s:.4g} s on, for {lasts_s:.3g} s"
        f"{more}, while the command swings by {spread:.3g} {data.command_unit} rms, in motion "
        f"by {usual:.3g}: the encoder or its line was stuck, or something held the axis; these "
        "rows were left out"
    )


def _still(data: Measured) -> Iterator[slice]:
    """Yield the rows in which the position stays the same to the last digit."""
    shortest = max(FEWEST_SAMPLES, round(STANDS_S * data.sample_rate_hz))
    for rows in data.stretches(shortest):
        same = np.concatenate([[False], np.diff(data.position[rows]) == 0.0, [False]])
        starts = np.flatnonzero(~same[:-1] & same[1:]) + rows.start
        stops = np.flatnonzero(same[:-1] & ~same[1:]) + rows.start + 1
        for start, stop in zip(starts, stops, strict=True):
            if stop - start >= shortest:
                yield slice(int(start), int(stop))


def swings(command: Array, period_s: float) -> int:
    """Count how often a command passes from one side of its mean to the other."""
    smooth = uniform_filter1d(command, max(1, round(SMOOTHED_S / period_s)), mode="nearest")
    aside = smooth - smooth.mean()
    side = np.sign(aside) * (np.abs(aside) > ASIDE * aside.std())
    return int(np.count_nonzero(np.diff(side[side != 0.0])))


def jumps_told(data: Measured) -> str | None:
    """Return that the position jumps, of an axis whose motion explains nothing, or None.

    Jumps between neighbouring rows make most of its acceleration: rows are missing there, or their
    times are not those at which they were recorded.
    """
    jumps, of_jumps, of_all = 0, 0.0, 0.0
    first_s = largest = beside = 0.0
    for rows in data.stretches(4 * AROUND):
        x = data.position[rows]
        step, change = np.abs(np.diff(x)), np.diff(x, 2) ** 2
        near = sliding_window_view(step, AROUND).max(axis=1)
        around = np.maximum(near[: -AROUND - 1], near[AROUND + 1 :])
        inner = step[AROUND:-AROUND]
        count = data.resolution or resolution_of(x)
        found = np.flatnonzero(inner > JUMPS * (around + count))
        of_all += float(change.sum())
        of_jumps += float(change[np.unique([found + AROUND - 1, found + AROUND])].sum())
        if len(found) and not jumps:
            first_s = float(data.time_s[rows][found[0] + AROUND + 1])
        jumps += len(found)
        if len(found) and float(inner[found].max()) > largest:
            widest = found[np.argmax(inner[found])]
            largest, beside = float(inner[widest]), float(around[widest])
    if not jumps or of_jumps < MOST_OF_IT * of_all:
        return None
    unit = data.position_unit
    return (
        f"the position jumps {jumps} times between neighbouring rows, first at {first_s:.4g} s, by "
        f"up to {largest:.3g} {unit} where it moves by {beside:.2g} {unit} a row beside it: these "
        f"jumps make {100.0 * of_jumps / of_all:.0f} % of its acceleration (limit "
        f"{100.0 * MOST_OF_IT:.0f} %). Rows are missing there, or their times are not those at "
        "which they were recorded: give the column of times, or cut the recording at these places"
    )


def rounding_sse(plain: Signals) -> float:
    """Return the squared acceleration that rounding to the position's steps makes in the rows.

    It is that of the stairs about straight lines from the middle of one step to the middle of the
    next. Of a slow axis the steps come so seldom that it lies within the band, where the noise at
    high frequency tells nothing of it; steps that come with every sample are white noise.
    """
    if step_of(plain.data) <= 0.0:
        return 0.0
    power = 0.0
    for s, kept in zip(plain.stretches, plain.kept, strict=True):
        edges = np.concatenate([[0], np.flatnonzero(np.diff(s.position)) + 1, [len(s.position)]])
        middles = 0.5 * (edges[:-1] + edges[1:] - 1)
        between = np.interp(np.arange(len(s.position)), middles, s.position[edges[:-1]])
        stairs = smoothed(s.position - between, plain.band_hz, plain.period_s)
        made = second_difference(stairs, plain.period_s)[:: plain.decimation][kept]
        power += float(made @ made)
    return power


def drowned_in_steps(signals: Signals) -> bool:
    """Return whether the acceleration in the widest band is that of the position's steps."""
    left = signals.acceleration()
    return rounding_sse(signals) > DROWNED * float(left @ left)


def steps_told(data: Measured, ratio: float, limit: float) -> str:
    """Return which steps of the position drown the motion, and which would not; nothing where none.

    Parameters
    ----------
    data
        The axis as measured.
    ratio, limit
        Power of its acceleration over that of its steps, and the least that is needed.
    """
    step = step_of(data)
    if step <= 0.0:
        return ""
    clear = max(ratio - 1.0, 0.0) / (limit - 1.0)
    needed = f"; steps of at most {step * clear:.2g} are needed" if clear > 0.0 else ""
    return f" (it comes in steps of {step:.3g} {data.position_unit}{needed})"


def step_of(data: Measured) -> float:
    """Return one step of a position that comes in whole ones, 0 where it does not."""
    if data.resolution:
        return data.resolution
    position = data.position[data.usable]
    step = resolution_of(position)
    if step <= 0.0:
        return 0.0
    steps = np.diff(position) / step
    return step if float(np.mean(np.abs(steps - np.rint(steps)))) < WHOLE else 0.0
