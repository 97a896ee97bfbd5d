"""Gains that a loop may begin with, by its margins, while nothing of it has been measured."""

from __future__ import annotations

import math
from dataclasses import dataclass

from motorctl.config.analysis import LoopMargins, loop_margins
from motorctl.config.loop_cases import USUAL_GAIN_DB, USUAL_PHASE_DEG
from motorctl.errors import UsageError

FASTEST_K1_1_S = 250.0
"""k1 at most: that of the published gantry, whose loop crosses over at 80 Hz. Larger meets
resonances that nobody has told of, smaller leaves error that `motorctl tune` then takes away."""
SLOWEST_K1_1_S = 1.0
"""k1 at least: a loop that is slower holds no position. It bounds a search alone."""
CROSSOVER_RATIO = 2.0
"""ks / inertia over k1, as of the published gantry: the two of them are zero and crossover."""
INTEGRAL_RATIO = 50.0
"""k1 over gamma_d / ks, as of the published gantry: the fast adaptation costs a degree of phase."""
SLOWER_THAN_CROSSOVER = 2.0
"""How much slower than the crossover that adaptation is at least, which matters where viscous
friction resists more than the inertia: 63 degrees are left. Larger learns later, smaller swings."""
TOLD_PHASE_DEG = 45.0
"""Phase that is kept at the inertia that was told, more than is usual at least: half as much again,
as nothing has been measured. Larger makes slower loops, smaller lets what nobody told of ring. At
the bounds of the inertia, with a command that is a period later than the driver's exchange, as by
an amplifier that lags, and of the gain everywhere, it is what `check` remarks on less than."""
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

    @property
    def margins_in_words(self) -> str:
        """At the inertia that was told."""
        phase, gain = self.margins.phase_margin_deg, self.margins.gain_margin
        told = [
            "any phase margin" if phase is None else f"phase margin {phase:.0f} degrees",
            "any gain margin" if gain is None else f"gain margin {20.0 * math.log10(gain):.0f} dB",
        ]
        return ", ".join(told)


@dataclass(frozen=True)
class _Case:
    """A loop whose margins are kept, and how much phase."""

    words: str
    inertia_v_s2_m: float
    later_s: float
    phase_deg: float


def first_gains(
    inertia_v_s2_m: float,
    bounds_v_s2_m: tuple[float, float],
    viscous_v_s_m: float,
    resolution_m: float,
    max_voltage_v: float,
    period_s: float,
    delay_s: float,
    axis: str,
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
    axis
        What a refusal names it.

    Raises
    ------
    UsageError
        Where rate and delay let no loop keep its margins.
    """

    def gains(k1: float) -> tuple[float, float, float]:
        k1 = _rounded(k1)
        ks = _rounded(CROSSOVER_RATIO * k1 * inertia_v_s2_m)
        # of a loop that friction holds the crossover is at k1 ks / viscous
        slower = max(INTEGRAL_RATIO, SLOWER_THAN_CROSSOVER * viscous_v_s_m / ks)
        return k1, ks, _rounded(ks * k1 / slower)

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

    cases = [_Case("the inertia as told", inertia_v_s2_m, 0.0, TOLD_PHASE_DEG)] + [
        _Case(f"inertia at its {end} bound", bound, period_s, USUAL_PHASE_DEG)
        for end, bound in zip(("lower", "upper"), bounds_v_s2_m, strict=True)
    ]

    def lacks(k1: float) -> str | None:
        for case in cases:
            short = _short(margins(k1, case.inertia_v_s2_m, case.later_s), case.phase_deg)
            if short is not None:
                delay_ms = 1e3 * (delay_s + case.later_s)
                return (
                    f"{short} with {case.words} ({case.inertia_v_s2_m:.3g} V*s^2/m) and "
                    f"{delay_ms:g} ms of delay"
                )
        return None

    noise_v = resolution_m / period_s / math.sqrt(6.0)  # for a ks of 1
    quietest = NOISE_SHARE * max_voltage_v / (noise_v * CROSSOVER_RATIO * inertia_v_s2_m)
    highest, bound_by = FASTEST_K1_1_S, "that of the published gantry: resonances are not known yet"
    if quietest < highest:
        highest = max(quietest, SLOWEST_K1_1_S)
        bound_by = f"the steps of the count add {NOISE_SHARE:.0%} of the full command"
    if (short := lacks(highest)) is not None:
        low, high = SLOWEST_K1_1_S / 10.0, highest
        if (none := lacks(low)) is not None:
            raise UsageError(
                f"axis {axis}: no loop holds it at {1.0 / period_s:g} Hz: even with k1 {low:g} 1/s "
                f"{none}; give a higher --rate, or another driver"
            )
        for _ in range(STEPS):
            middle = math.sqrt(low * high)
            lacking = lacks(middle)
            if lacking is None:
                low = middle
            else:
                high, short = middle, lacking
        highest, bound_by = low, f"then {short}"
    return FirstGains(*gains(highest), margins(highest, inertia_v_s2_m), bound_by)


def _short(margins: LoopMargins, least_phase_deg: float) -> str | None:
    """Return which margin is less than it should be, in words; None: none is."""
    least_gain = 10.0 ** (USUAL_GAIN_DB / 20.0)
    if not margins.stable:
        return "the loop is unstable"
    if margins.phase_margin_deg is not None and margins.phase_margin_deg < least_phase_deg:
        return f"the phase margin is less than {least_phase_deg:g} degrees"
    if margins.gain_margin is not None and margins.gain_margin < least_gain:
        return f"the gain margin is less than {USUAL_GAIN_DB:g} dB"
    if margins.gain_reduction is not None and 1.0 / margins.gain_reduction < least_gain:
        return f"the gain may shrink by less than {USUAL_GAIN_DB:g} dB"
    return None


def _rounded(value: float) -> float:
    return float(f"{value:.3g}")
