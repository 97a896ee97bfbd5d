"""Positions that begin anew, after a turn or at the end of what the drive's counter holds."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

TURN_RAD = 2.0 * math.pi
WRAPS = 0.75
"""Part of a turn, or of the travel, that a position jumps by where it begins anew; the rest is what
the axis moved meanwhile. Larger misses it in fast motion, smaller takes damaged values for it.
Arithmetic: as far from a whole turn as `MOVES` is from none."""
MOVES = 0.25
"""The part that every other step stays below. Larger unwraps noise of an angle that jumps
everywhere, smaller leaves fast motion as it is. Arithmetic."""
ROUNDING = 1e-3
"""Part of a turn by which such an angle may reach beyond one. Larger takes an axis that turns
further for one, smaller misses angles that were rounded. Chosen by hand."""
FEWEST = 2
"""Jumps from which a period that is not a turn is believed. Larger misses slow axes, one may be a
position that was set anew. Chosen by hand."""
GOES_ON = 0.8
"""Part of the motion about the jumps that has to go on through them. Larger misses an axis that
turns round there, smaller takes a loose contact for a counter. Chosen by hand."""
DIGITS = 3
"""A counter's period is a number of so few digits where the jumps allow one. Larger takes what the
axis moved meanwhile for a part of it, smaller rounds too much. Chosen by hand."""


def counted_on(position: Array, turn: float | None) -> tuple[Array, int, float | None]:
    """Return a position that goes on where it began anew, how often it did, and after how much.

    Parameters
    ----------
    position
        Of one row after the other, (N,), finite.
    turn
        One turn in the position's unit; None: a length.

    Returns
    -------
    position : ndarray
        The same, (N,), where it never left one turn and jumped by about a turn between neighbouring
        rows, but nowhere by half of one, or where it jumps from one end of its travel to the other
        while the motion goes on; else as it came in.
    jumps : int
        How often it began anew; 0 where nothing was done.
    period : float or None
        What it began anew after; None: nothing, or a turn.
    """
    steps = np.diff(position)
    if turn is not None and np.ptp(position) <= (1.0 + ROUNDING) * turn:
        jumps = _jumps(steps, turn)
        if jumps.any():
            return _gone_on(position, steps, jumps, turn), int(np.count_nonzero(jumps)), None
    jumps = _jumps(steps, float(np.ptp(position)))
    if np.count_nonzero(jumps) < FEWEST or not _motion_goes_on(steps, jumps):
        return position, 0, None
    period = _period(position, steps, jumps)
    return _gone_on(position, steps, jumps, period), int(np.count_nonzero(jumps)), period


def _jumps(steps: Array, whole: float) -> NDArray[np.bool_]:
    """Return which steps jump by about the whole, (N - 1,); none where others are large, too."""
    jumps = np.abs(steps) > WRAPS * whole
    if np.abs(steps[~jumps]).max(initial=0.0) > MOVES * whole:
        return np.zeros_like(jumps)
    return jumps


def _gone_on(position: Array, steps: Array, jumps: NDArray[np.bool_], period: float) -> Array:
    return position - period * np.concatenate([[0.0], np.cumsum(np.sign(steps) * jumps)])


def _about(steps: Array, jumps: NDArray[np.bool_]) -> tuple[Array, Array]:
    """Return the steps before and after each jump, against it; 0 where there is none."""
    moved = np.concatenate([[0.0], np.where(jumps, 0.0, steps), [0.0]])
    at = np.flatnonzero(jumps)
    against = -np.sign(steps[at])
    return against * moved[at], against * moved[at + 2]


def _motion_goes_on(steps: Array, jumps: NDArray[np.bool_]) -> bool:
    """Tell whether the axis moves one way before and after a jump the other way."""
    both = np.minimum(*_about(steps, jumps))
    return bool(np.sum(both[both > 0.0]) > GOES_ON * np.sum(np.abs(both)))


def _period(position: Array, steps: Array, jumps: NDArray[np.bool_]) -> float:
    """Return what the counter holds: the jumps with what the axis moved meanwhile, rounded."""
    before, after = _about(steps, jumps)
    each = np.abs(steps[jumps]) + 0.5 * (before + after)
    told = float(np.median(each))
    unsure = max(float(np.median(np.abs(before - after))), float(np.median(np.abs(each - told))))
    least = max(float(np.ptp(position)), told - unsure)
    for digits in range(1, DIGITS + 1):
        rounded = float(f"{told:.{digits - 1}e}")
        if least <= rounded <= told + unsure:
            return rounded
    return max(told, float(np.ptp(position)))
