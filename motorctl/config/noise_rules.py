"""A limit of the encoder's noise that an axis in order trips, or that other guards precede."""

from __future__ import annotations

import math
from collections.abc import Iterator
from statistics import NormalDist

from motorctl.config.axis_keys import Encoder, Limits
from motorctl.config.count_limits import ambiguous_counts, longest_step_m, too_fast_m_s
from motorctl.config.guard_keys import OVERSPEED_TICKS, EncoderNoise
from motorctl.config.validation import Finding

COUNTS_AT_REST = 2
"""An encoder between two counts flickers by so many in its second difference."""
LONGEST_FILTER_S = 60.0
"""Of the noise's mean square [s]. Longer, and noise of twice its limit has to last for more than a
quarter of it, longer than axes rest; shorter forbids limits near the noise of an axis in order.
Chosen by hand."""
SELDOM = 5.0
"""Standard deviations beyond which one sample in 1.7 million of Gaussian noise lies: another guard
may be tripped by noise at the limit as seldom in a tick. Of white noise, steps have sqrt(2) times
its standard deviation, second differences sqrt(6) times, which is rms_m: so steps have rms_m /
sqrt(3), positions rms_m / sqrt(6). A guard that takes n samples in a row beyond its limit, which do
not hang together, is tripped as seldom by one in p^(1/n). One that takes n more beyond than within
walks up and down at random, and gets so far in r^n, where r is the share beyond over that within.
Larger refuses limits that are never preceded, smaller accepts noise that is mostly told as
something else. Chosen by hand, the rest is arithmetic."""


def check_noise(
    noise: EncoderNoise, limits: Limits, encoder: Encoder, period_s: float, fullest_m_s2: float
) -> Iterator[Finding]:
    """Check that noise can reach its limit before other guards trip, and no motion can.

    fullest_m_s2 is what the full voltage can accelerate.
    """
    where = ("guards", "encoder_noise", "rms_m")
    least = COUNTS_AT_REST * encoder.resolution_m + fullest_m_s2 * period_s**2
    most, before = _preceded(limits, encoder, period_s)
    if noise.rms_m <= least:
        yield (
            where,
            f"found {noise.rms_m:g}, should be above {COUNTS_AT_REST} encoder counts and what "
            f"{fullest_m_s2:g} m/s^2 move in a period of {period_s:g} s: {least:.3g} m; "
            "below, an axis in order would trip it",
        )
    elif noise.rms_m > most:
        should = (
            f"should be at most {_rounded_down(most):g}"
            if _rounded_down(most) > least
            else "here no limit would do, the guard should be removed"
        )
        yield (
            where,
            f"found {noise.rms_m:g}, can hardly ever trip: noise of so much is told as {before} "
            f"before; {should}",
        )
    where = ("guards", "encoder_noise", "filter_time_s")
    if noise.filter_time_s < period_s:
        message = f"found {noise.filter_time_s:g}, should be at least a period, {period_s:g} s"
        yield where, message
    elif noise.filter_time_s > LONGEST_FILTER_S:
        lasts_s = noise.filter_time_s * math.log(4.0 / 3.0)
        yield (
            where,
            f"found {noise.filter_time_s:g}, can hardly ever trip: noise of twice rms_m would have "
            f"to last for {lasts_s:.3g} s of rest; should be at most {LONGEST_FILTER_S:g} s",
        )


def _preceded(limits: Limits, encoder: Encoder, period_s: float) -> tuple[float, str]:
    """Return above which rms_m other guards precede this one [m], and how the first one does."""
    count_m, fastest_m_s = encoder.resolution_m, limits.max_velocity_m_s
    quarter_m = ambiguous_counts(2**encoder.counter_bits) * count_m
    jump_m = min(longest_step_m(fastest_m_s, count_m, period_s), quarter_m)
    fast_m = too_fast_m_s(fastest_m_s, count_m, period_s) * period_s
    error = limits.following_error
    behind = round(error.filter_time_s / period_s) + 1
    # Of steps in a row, every other one shares no position with the one before.
    apart = (OVERSPEED_TICKS + 1) // 2
    return min(
        (
            math.sqrt(3.0) * jump_m / _deviations(1),
            f"a jump of the encoder, a step of {jump_m:.3g} m,",
        ),
        (
            math.sqrt(3.0) * fast_m / _deviations(apart),
            f"overspeed, {OVERSPEED_TICKS} steps in a row beyond {fast_m:.3g} m,",
        ),
        (
            math.sqrt(6.0) * error.minimum_m / _deviations_on_balance(behind),
            f"a following error, {behind} more beyond {error.minimum_m:g} m than within,",
        ),
    )


def _deviations(in_a_row: int) -> float:
    """Return how many standard deviations so many samples are beyond as seldom as one is SELDOM."""
    return _beyond_in(math.erfc(SELDOM / math.sqrt(2.0)) ** (1.0 / in_a_row))


def _deviations_on_balance(more: int) -> float:
    """Return beyond how many so many more samples are than within, as seldom."""
    ratio = math.erfc(SELDOM / math.sqrt(2.0)) ** (1.0 / more)
    return _beyond_in(ratio / (1.0 + ratio))


def _beyond_in(share: float) -> float:
    """Return beyond how many standard deviations a share of Gaussian samples lies."""
    return max(-NormalDist().inv_cdf(0.5 * share), 1e-9)


def _rounded_down(value: float) -> float:
    """Return a number of three digits that is no larger."""
    unit = 10.0 ** (math.floor(math.log10(value)) - 2)
    return math.floor(value / unit) * unit
