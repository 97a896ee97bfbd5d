"""How far and how fast a count may go: the loop trips on it, `check` reckons with it, both by this.

Plain functions that the loop compiles into its tick.
"""

from __future__ import annotations

from motorctl.config.guard_keys import (
    COUNTER_PARTS,
    JUMP_COUNTS,
    JUMP_SPEED_RATIO,
    OVERSPEED_COUNTS,
    OVERSPEED_RATIO,
)


def too_fast_m_s(max_velocity_m_s: float, count_m: float, period_s: float) -> float:
    """Return the speed beyond which a sample counts as overspeed [m/s].

    Parameters
    ----------
    max_velocity_m_s
        Top speed [m/s].
    count_m
        Metres a count, above 0 [m].
    period_s
        Of the axis [s].
    """
    return OVERSPEED_RATIO * max_velocity_m_s + OVERSPEED_COUNTS * count_m / period_s


def longest_step_m(max_velocity_m_s: float, count_m: float, seconds: float) -> float:
    """Return the longest step of the count that may be motion [m].

    Parameters
    ----------
    max_velocity_m_s
        Top speed [m/s].
    count_m
        Metres a count, above 0 [m].
    seconds
        Since the count before [s].
    """
    return JUMP_SPEED_RATIO * max_velocity_m_s * seconds + JUMP_COUNTS * count_m


def ambiguous_counts(counter_span: int) -> int:
    """Return from how many counts on a step of a counter that wraps could be either way."""
    return counter_span // COUNTER_PARTS
