"""The motor's model of heat: one time constant, the command's square in the losses' place.

The loop runs it in each tick, and `check` over a program: both by what stands here.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

MOST_STEPS = 200_000
"""Steps in which one cycle of a program is warmed through at most; a cycle of more ticks than that
is looked at so much more coarsely. Fewer miss short peaks of long programs, more only take longer.
Chosen by hand: 40 s at 5 kHz."""


def heat_kept(time_constant_s: float, period_s: float) -> float:
    """Return the part of a motor's heat that is left after a period without a command."""
    return math.exp(-period_s / time_constant_s)


def warmed(heat_v2: float, command_v: float, kept: float) -> float:
    """Return the heat after a period with a command: its mean square over the time constant [V^2].

    Parameters
    ----------
    heat_v2
        The heat before [V^2].
    command_v
        What stood in this period [V].
    kept
        The part of the heat that is left after it, from `heat_kept`.
    """
    square = command_v * command_v
    return square + kept * (heat_v2 - square)


def hottest_v(
    command: Callable[[NDArray[np.float64]], NDArray[np.float64]],
    cycle_s: float,
    cycles: int,
    time_constant_s: float,
    period_s: float,
) -> float:
    """Return how hot a cold motor becomes in so many cycles, as the command that would keep it so.

    It warms from cycle to cycle, so that it is hottest within the last one.

    Parameters
    ----------
    command
        The command [V] at times within a cycle [s], (N,).
    cycle_s, cycles
        Duration of one [s], and how many there are.
    time_constant_s
        Of the motor's model [s].
    period_s
        Of the axis [s].
    """
    steps = round(min(max(cycle_s / period_s, 1.0), MOST_STEPS))
    volts = command(np.linspace(0.0, cycle_s, steps, endpoint=False)).tolist()
    kept = heat_kept(time_constant_s, cycle_s / steps)
    once = _heats(volts, 0.0, kept)[-1]
    # What one cycle leaves is a geometric series over those before the last.
    left = -math.expm1(-cycle_s / time_constant_s)
    before = once * -math.expm1(-(cycles - 1) * cycle_s / time_constant_s) / left
    return math.sqrt(max(_heats(volts, before, kept)))


def _heats(volts: list[float], heat_v2: float, kept: float) -> list[float]:
    heats = []
    for command_v in volts:
        heat_v2 = warmed(heat_v2, command_v, kept)
        heats.append(heat_v2)
    return heats
