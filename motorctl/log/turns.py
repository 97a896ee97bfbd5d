"""Positions that begin anew, after a turn or at the end of what the drive's counter holds."""

from __future__ import annotations

import math
from typing import NamedTuple

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
BEYOND = 0.02
"""Part of a period by which a position may reach beyond one. Larger takes an axis that turns
further for one, smaller misses sensors that read a little beyond, and noise. Chosen by hand."""
NEAR_TURN = 0.06
"""Part of a turn that a jump, with what the axis moved meanwhile, may lack or have more than one.
Larger takes a motion over most of a turn and back within a sample for one, smaller misses sensors
that are blind for a part of the turn. Chosen by hand."""
FEWEST = 2
"""Jumps from which a period that is not a turn is believed. Larger misses slow axes, one may be a
position that was set anew. Chosen by hand."""
GOES_ON = 0.8
"""Part of the motion about the jumps that has to go on through them. Larger misses an axis that
turns round there, smaller takes a loose contact for a counter. Chosen by hand."""
UNSURE = 0.02
"""Part of a period up to which it may be unsure. Larger lets the position drift by what the period
is wrong by, at each jump; smaller misses axes that accelerate. Chosen by hand."""
COUNTS_OFF, PART_OFF = 2.0, 1e-3
"""Counts, and part of it, by which jumps may lack a power of two. Larger takes other travels for a
counter's, smaller misses slow axes, whose steps are of one count or none, and noise. Arithmetic."""
DIGITS = 3
"""A counter's period is a number of so few digits where the jumps allow one. Larger takes what the
axis moved meanwhile for a part of it, smaller rounds too much. Chosen by hand."""
FEWEST_BITS, MOST_BITS = 10, 32
"""Of a counter. Fewer take short travels for one, more has none. Chosen by hand."""
STEADY = 1e-4
"""Part of a period that is always unsure, as steps are rounded. Larger rounds too much, smaller
misses the number that it is. Chosen by hand."""
FLOATS = 1e-6
"""Part of a period by which a position may reach beyond it as numbers are rounded. Arithmetic."""
CENTRED = 0.02
"""Part of a period that the middle of a travel may lie off 0, for it to be the same both ways.
Chosen by hand."""


class Jumps(NamedTuple):
    """Where a position jumps by about a turn, or from one end of its travel to the other."""

    rows: NDArray[np.intp]
    """The row behind each jump, (J,)."""
    after: float
    """What it jumps by with what the axis moved meanwhile, the jumps' median."""
    unsure: float
    """How far that may be off."""
    of_turn: bool
    both_ways: bool


def jumps_of(position: Array, turn: float | None) -> Jumps | None:
    """Return where a position may begin anew; None: nowhere, or other steps are large, too.

    Parameters
    ----------
    position
        Of one row after the other, (N,), finite.
    turn
        One turn in the position's unit; None: a length.
    """
    if len(position) < FEWEST:
        return None
    steps = np.diff(position)
    span = float(np.ptp(position))
    if turn is not None and span <= (1.0 + BEYOND) * turn:
        at = _large(steps, turn)
        if at.any():
            found = _told(steps, at, of_turn=True)
            if abs(found.after - turn) <= max(NEAR_TURN * turn, found.unsure):
                return found
    at = _large(steps, span)
    if np.count_nonzero(at) < FEWEST or not _motion_goes_on(steps, at):
        return None
    return _told(steps, at, of_turn=False)


def period_of(position: Array, jumps: Jumps, turn: float | None, counts: bool) -> float:
    """Return what a position begins anew after: the number that a counter may have.

    Parameters
    ----------
    position
        Of one row after the other, (N,), finite.
    jumps
        Where it jumps.
    turn
        One turn in the position's unit; None: a length.
    counts
        Whether its unit is the count of an encoder.
    """
    if jumps.of_turn:
        assert turn is not None
        return turn
    if (power := power_of_two(position, jumps, counts)) is not None:
        return power
    whole = counts and bool(np.all(position == np.rint(position)))
    unsure = max(jumps.unsure, STEADY * jumps.after)
    least = max(float(np.ptp(position)) * (1.0 - FLOATS) + whole, jumps.after - unsure)
    most = max(least, jumps.after + unsure)
    told = max(jumps.after, least)
    tried = [_rounded(told, 1), _rounded(told, 2)]
    if turn is not None:
        tried.append(turn * round(told / turn))
    if not counts:
        tried += _decimal_powers(told)
    tried += [_rounded(told, digits) for digits in range(3, DIGITS + 1)]
    fits = (value for value in tried if least <= value <= most)
    return next(fits, float(round(told)) if whole else told)


def power_of_two(position: Array, jumps: Jumps, counts: bool) -> float | None:
    """Return the power of two after which counts begin anew; None: it is none, or not sure."""
    if not counts or jumps.after <= 0.0 or not is_sure(jumps):
        return None
    bits = round(math.log2(jumps.after))
    power = 2.0**bits
    near = abs(power - jumps.after) <= max(COUNTS_OFF, PART_OFF * power, jumps.unsure)
    holds = float(np.ptp(position)) < (1.0 + BEYOND) * power
    return power if near and holds and FEWEST_BITS <= bits <= MOST_BITS else None


def is_sure(jumps: Jumps) -> bool:
    """Return whether the jumps tell well what the position begins anew after."""
    return jumps.unsure <= UNSURE * jumps.after


def is_of_a_bus(position: Array, period: float) -> bool:
    """Return whether a position goes as far below 0 as above, after a number of two digits."""
    middle = 0.5 * (float(position.max()) + float(position.min()))
    return abs(middle) <= CENTRED * period and period == _rounded(period, 2)


def counted_on(position: Array, period: float, wraps: float = WRAPS) -> tuple[Array, int]:
    """Return a position that goes on where it jumps by a period, and how often it does.

    A step of less than `wraps` of a period is a motion.
    """
    if len(position) < FEWEST:
        return position, 0
    steps = np.diff(position)
    whole = np.where(np.abs(steps) > wraps * period, np.rint(steps / period), 0.0)
    on = position - period * np.concatenate([[0.0], np.cumsum(whole)])
    return on, int(np.count_nonzero(whole))


def _large(steps: Array, whole: float) -> NDArray[np.bool_]:
    """Return which steps jump by about the whole, (N - 1,); none where others are large, too."""
    jumps = np.abs(steps) > WRAPS * whole
    if np.abs(steps[~jumps]).max(initial=0.0) > MOVES * whole:
        return np.zeros_like(jumps)
    return jumps


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


def _both_ways(steps: Array, jumps: NDArray[np.bool_]) -> bool:
    """Tell whether it does so through the jumps up, and through those down."""
    return all(_motion_goes_on(steps, jumps & way) for way in (steps > 0.0, steps < 0.0))


def _told(steps: Array, jumps: NDArray[np.bool_], of_turn: bool) -> Jumps:
    before, after = _about(steps, jumps)
    each = np.abs(steps[jumps]) + 0.5 * (before + after)
    told = float(np.median(each))
    unsure = max(float(np.median(np.abs(before - after))), float(np.median(np.abs(each - told))))
    return Jumps(np.flatnonzero(jumps) + 1, told, unsure, of_turn, _both_ways(steps, jumps))


def _rounded(value: float, digits: int) -> float:
    return float(f"{value:.{digits - 1}e}")


def _decimal_powers(near: float) -> list[float]:
    """Return powers of two, of a counter whose count is a power of ten, nearest first."""
    tens = (2.0**bits for bits in range(FEWEST_BITS, MOST_BITS + 1))
    scaled = [power * 10.0 ** round(math.log10(near / power)) for power in tens]
    return sorted(scaled, key=lambda value: abs(value - near))
