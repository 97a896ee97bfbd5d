"""Where an axis is at rest or sticks: there friction is no function of velocity."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d, minimum_filter1d

from motorctl.identify.columns.stretches import Stretch

Array = NDArray[np.float64]

REST_S = 0.06
"""Shortest standstill that counts as a rest [s]. Smaller takes the turning points of a move for
rests, larger keeps rests that say nothing. Chosen by hand."""
REST_EDGE_S = 0.03
"""What of a rest is kept at each end [s]: how friction lets go is seen there. Larger keeps rows
that say nothing, smaller hides the breakaway. Chosen by hand."""
STICK_S = 0.02
"""Time that an axis stays within what its encoder shows, to stick for sure [s]. Larger keeps rows
in which friction is whatever the command is, smaller takes slow motion for sticking. Chosen by
hand: machines of other hands stick for 8 to 80 ms at a reversal."""
SHORTEST_STICK_S = 5e-3
"""Shortest time that it sticks, beside what a turn takes there [s]. Larger keeps short sticks,
smaller takes turns for sticks. Chosen by hand, as for `STICK_S`."""
FEWEST_STUCK_SAMPLES = 4
"""Both in samples, at low rates. Fewer take a slow clock's repeats for sticking. Chosen by
hand."""
HELD = 0.2
"""Spread of the command while an axis sticks, over its rms in all, from which friction is seen to
hold it. Larger keeps sticks, smaller drops rests that tell a weight. Chosen by hand: between what
dry friction and what a weight held by a little of it show on machines of other hands."""
NEAR_S = 0.5
"""How long before and after a stick its motion is looked at [s]. Larger takes time, smaller takes
slow turns for sticks. Chosen by hand."""
TOLD_APART = 8e-3
"""Part of the top speed: an encoder that cannot tell slower motion from a rest within that time
shows no sticking. Larger drops slow motion behind coarse encoders, smaller keeps sticking. Chosen
by hand."""
COUNTS_PER_PERIOD = 1.0
"""Counts that a coarse encoder passes in a period of the band's end, below which its steps are no
motion that the rows could show. Larger drops slow motion, smaller takes an encoder's stairs for
forces. Chosen on six machines of other hands, of 0.5, 1 and 2: half a count leaves more
unexplained, two find no other effect."""
MOST_SLOW = 0.5
"""Part of a stretch that may be dropped for it. Larger leaves too little of slow recordings,
smaller keeps the stairs. Chosen by hand."""
REST_SPEED = 3.0
"""Speed, in multiples of the velocity noise's rms, below which the axis may be at rest. Larger
throws away slow motion, smaller takes noise for motion. Convention: three standard deviations."""
REST_RANGE = 14.0
"""Range of the position, in multiples of its noise's rms, that is rest as well: some four counts,
within which friction's bristles bend unseen. Larger throws away slow motion, smaller keeps rests.
Arithmetic: a count's rounding has an rms of 1/sqrt(12), so 14 / sqrt(12) = 4.04 counts; that it is
four was chosen by hand on the simulated campaign."""
REST_PART = 1e-3
"""Part of the top speed that creeping at rest stays below. Larger throws away slow motion, smaller
keeps rests whose position hunts. Chosen by hand."""


def at_rest(
    stretch: Stretch,
    row_period_s: float,
    decimation: int,
    velocity_noise: float,
    noise: float,
    margin_s: float,
    slowest: float,
) -> NDArray[np.bool_]:
    """Find the rows of rests, where friction is no function of velocity.

    Parameters
    ----------
    stretch
        The motion.
    row_period_s, decimation
        Time between rows [s], and the samples of one.
    velocity_noise, noise
        Rms of the noise of velocity and of position, in the position's unit (per second).
    margin_s
        As far as the rows' filter reaches [s].
    slowest
        Speed below which the encoder's counts come too seldom for the rows to show motion.

    Returns
    -------
    ndarray
        Which rows are dropped, (m,).
    """
    x, v = stretch.x[::decimation], stretch.v[::decimation]
    top = float(np.percentile(np.abs(stretch.v), 99.0))
    within = min(REST_RANGE * noise, REST_PART * top * REST_S)
    still = np.abs(v) < REST_SPEED * velocity_noise
    still |= _stays(x, within, max(3, round(REST_S / row_period_s)))
    return _inside_of_rests(still, row_period_s) | sticks(
        stretch, row_period_s, decimation, noise, margin_s, slowest
    )


def sticks(
    stretch: Stretch,
    row_period_s: float,
    decimation: int,
    noise: float,
    margin_s: float,
    slowest: float,
) -> NDArray[np.bool_]:
    """Find the rows in which the axis sticks: there friction is whatever the command asks of it.

    An encoder that is too coarse to tell that shows stairs instead of slow motion: where its counts
    come too seldom, the rows are dropped as well.

    Parameters
    ----------
    stretch, row_period_s, decimation, noise, slowest
        As of `at_rest`.
    margin_s
        What is dropped on each side of it [s]: as far as the rows' filter reaches.

    Returns
    -------
    ndarray
        Which rows are dropped, (m,).
    """
    period_s = row_period_s / decimation
    within = REST_RANGE * noise
    if within > TOLD_APART * np.percentile(np.abs(stretch.v), 99.0) * STICK_S:
        stuck = np.abs(stretch.v) < slowest
        if np.mean(stuck) > MOST_SLOW:
            stuck = np.zeros_like(stuck)
    else:
        size = max(FEWEST_STUCK_SAMPLES, round(STICK_S / period_s))
        stuck = _reaching(_stays(stretch.x, within, size), size)
        stuck |= _held(stretch.x, stretch.command, within, period_s)
    return _reaching(stuck, 1 + 2 * round(margin_s / period_s))[::decimation]


def _reaching(found: NDArray[np.bool_], size: int) -> NDArray[np.bool_]:
    """Return what lies within so many samples around what was found."""
    return np.asarray(maximum_filter1d(found.astype(np.int8), size) > 0)


def _held(x: Array, command: Array, within: float, period_s: float) -> NDArray[np.bool_]:
    """Find where friction holds an axis in its place, against a command that changes, (N,).

    It stays there for longer than a turn would take it: at a steady acceleration it takes twice as
    long to go four times as far, so of the time T within a way of the place, and the time T' within
    four times that, 2 T - T' was spent in the place, whatever the accelerations were with which the
    axis came and went.
    """
    shortest = max(FEWEST_STUCK_SAMPLES, round(SHORTEST_STICK_S / period_s))
    near = max(round(NEAR_S / period_s), 1)
    rms = float(np.sqrt(np.mean(command**2)))
    found = np.zeros(len(x), dtype=np.bool_)
    edges = np.diff(np.concatenate([[0], _stays(x, within, shortest), [0]]).astype(np.int8))
    begun, left = np.flatnonzero(edges > 0).tolist(), np.flatnonzero(edges < 0).tolist()
    for start, stop in zip(begun, left, strict=True):
        place = float(np.median(x[start:stop]))
        before = np.abs(x[max(start - near, 0) : start][::-1] - place)
        after = np.abs(x[stop : stop + near] - place)
        way = 0.5 * within
        first, last = (
            edge + sign * (2 * _until(side, way) - _until(side, 4.0 * way))
            for edge, sign, side in ((start, -1, before), (stop, 1, after))
        )
        first = max(first, 0)
        if last - first >= shortest and _spread(command[first:last]) > HELD * rms:
            found[first:last] = True
    return found


def _spread(command: Array) -> float:
    low, high = np.percentile(command, (5.0, 95.0))
    return float(high - low)


def _until(away: Array, way: float) -> int:
    """Return how many samples are within a way before the first one beyond it."""
    beyond = away > way
    return int(np.argmax(beyond)) if beyond.any() else len(away)


def _stays(x: Array, within: float, size: int) -> NDArray[np.bool_]:
    """Return where the position stays within a range, hunting included, for so many samples."""
    highest: Array = maximum_filter1d(x, size)
    lowest: Array = minimum_filter1d(x, size)
    return np.asarray(highest - lowest < within)


def _inside_of_rests(still: NDArray[np.bool_], period_s: float) -> NDArray[np.bool_]:
    """Find the inside of long rests, where friction is no function of velocity."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], still, [False]]).astype(np.int8)))
    result = np.zeros(len(still), dtype=np.bool_)
    keep = round(REST_EDGE_S / period_s)
    for start, stop in zip(edges[::2], edges[1::2], strict=True):
        if (stop - start) * period_s > REST_S + 2 * REST_EDGE_S:
            result[start + keep : stop - keep] = True
    return result
