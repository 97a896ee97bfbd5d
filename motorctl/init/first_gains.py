"""Gains that a loop may begin with, by its margins, while nothing of it has been measured."""

from __future__ import annotations

import math
from dataclasses import dataclass

from motorctl.config.analysis import LoopMargins, loop_margins
from motorctl.config.loop_cases import USUAL_GAIN_DB, USUAL_PHASE_DEG

FASTEST_K1_1_S = 250.0
"""k1 at most: that of the published gantry, whose loop crosses over at 80 Hz. Larger meets
resonances that nobody has told of, smaller leaves error that `motorctl tune` then takes away."""
SLOWEST_K1_1_S = 1.0
"""k1 at least: a loop that is slower holds no position. It bounds a search alone."""
CROSSOVER_RATIO = 2.0
"""ks / inertia over k1, as of the published gantry: the two of them are zero and crossover."""
INTEGRAL_RATIO = 50.0
"""k1 over gamma_d / ks, as of the published gantry: the fast adaptation costs a degree of phase."""
PHASE_DEG, GAIN = 45.0, 2.0
"""Margins that are kept at the inertia that was told: 45 degrees and 6 dB, the usual ones."""
LEAST_PHASE_DEG, LEAST_GAIN = USUAL_PHASE_DEG, 10.0 ** (USUAL_GAIN_DB / 20.0)
"""And at the bounds of the inertia, half and twice as much, with a command that is a period later
than the driver's exchange, as by an amplifier that lags: less than this `check` remarks on."""
NOISE_SHARE = 0.02
"""Of the full command: what the steps of the count may add to it, as rms. Larger makes motors sing,
smaller asks for finer encoders than machines have."""
STEPS = 12
"""Halvings of the range of k1: to a part in five hundred, and three digits of it are written."""


@dataclass(frozen=True)
class FirstGains:
    """Gains, their margins, and which of the limits they were taken to."""

    k1_1_s: float
    ks_v_s_m: float
    gamma_d: float
    margins: LoopMargins
    bound_by: str


def first_gains(
    inertia_v_s2_m: float,
    bounds_v_s2_m: tuple[float, float],
    viscous_v_s_m: float,
    resolution_m: float,
    max_voltage_v: float,
    period_s: float,
    delay_s: float,
) -> FirstGains:
    """Return the fastest gains of the published shape that keep the margins.

    Parameters
    ----------
    inertia_v_s2_m, bounds_v_s2_m
        theta1 [V s^2/m], and between which values it may lie.
    viscous_v_s_m
        theta2 [V s/m].
    resolution_m
        Metres a count [m].
    max_voltage_v
        Full command [V].
    period_s
        Period of the axis [s].
    delay_s
        How late a command acts, beside the hold [s].
    """

    def gains(k1: float) -> tuple[float, float, float]:
        k1 = _rounded(k1)
        ks = _rounded(CROSSOVER_RATIO * k1 * inertia_v_s2_m)
        return k1, ks, _rounded(ks * k1 / INTEGRAL_RATIO)

    def margins(k1: float, inertia: float, later_s: float = 0.0) -> LoopMargins:
        own = gains(k1)
        return loop_margins(
            inertia,
            viscous_v_s_m,
            k1_1_s=own[0],
            ks_v_s_m=own[1],
            gamma_d=own[2],
            period_s=period_s,
            delay_s=delay_s + later_s,
        )

    def keeps(k1: float) -> bool:
        if not _keeps(margins(k1, inertia_v_s2_m), PHASE_DEG, GAIN):
            return False
        return all(
            _keeps(margins(k1, bound, period_s), LEAST_PHASE_DEG, LEAST_GAIN)
            for bound in bounds_v_s2_m
        )

    noise_v = resolution_m / period_s / math.sqrt(6.0)  # for a ks of 1
    quietest = NOISE_SHARE * max_voltage_v / (noise_v * CROSSOVER_RATIO * inertia_v_s2_m)
    highest, bound_by = FASTEST_K1_1_S, "that of the published gantry: resonances are not known yet"
    if quietest < highest:
        highest = max(quietest, SLOWEST_K1_1_S)
        bound_by = f"the steps of the count add {NOISE_SHARE:.0%} of the full command"
    if not keeps(highest):
        bound_by = "rate and delay leave no more phase"
        low, high = SLOWEST_K1_1_S / 10.0, highest
        for _ in range(STEPS):
            middle = math.sqrt(low * high)
            low, high = (middle, high) if keeps(middle) else (low, middle)
        highest = low
    return FirstGains(*gains(highest), margins(highest, inertia_v_s2_m), bound_by)


def _keeps(margins: LoopMargins, phase_deg: float, gain: float) -> bool:
    return (
        margins.stable
        and (margins.phase_margin_deg or 0.0) >= phase_deg
        and (margins.gain_margin or math.inf) >= gain
        and 1.0 / (margins.gain_reduction or 1e-9) >= gain
    )


def _rounded(value: float) -> float:
    return float(f"{value:.3g}")
