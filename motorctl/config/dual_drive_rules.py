"""What a dual drive's numbers must be to the axis' other ones, each rule with its arithmetic."""

from __future__ import annotations

import math
from collections.abc import Iterator

from motorctl.config.analysis import LoopMargins, loop_margins
from motorctl.config.axis_keys import Encoder, Homing, Limits
from motorctl.config.dual_drive_keys import DualDrive, SkewLoop
from motorctl.config.guard_keys import Guards
from motorctl.config.validation import Finding
from motorctl.model import EffectList

COUNTS_AT_REST = 2
"""Two encoders, each between two counts, flicker by so many in their difference."""


def check_skew_guard(
    dual: DualDrive | None, guards: Guards, limits: Limits, encoder: Encoder | None
) -> Iterator[Finding]:
    """Check that a dual drive has a skew limit, and one that trips when it should."""
    guard = guards.skew
    if dual is None:
        if guard is not None:
            message = "can never trip: the axis has one drive; remove it, or add dual_drive"
            yield ("guards", "skew"), message
        return
    if guard is None:
        yield (
            ("guards", "skew"),
            "is missing; an axis with dual_drive needs it: skew: {limit_m: ...}, how far its ends "
            "may be apart",
        )
        return
    where = ("guards", "skew", "limit_m")
    if encoder and guard.limit_m <= COUNTS_AT_REST * encoder.resolution_m:
        least = COUNTS_AT_REST * encoder.resolution_m
        message = f"found {guard.limit_m:g}, should be above {COUNTS_AT_REST} encoder counts, "
        yield where, f"{message}{least:g} m: it would always trip at rest"
    low, high = limits.travel_m
    if low < high and 2.0 * guard.limit_m >= high - low:
        yield (
            where,
            f"found {guard.limit_m:g}, can never trip where one end is stuck in the middle of the "
            f"travel of {high - low:g} m: the other goes no further than half of it; should be "
            "less",
        )
    most = most_skew_m(dual.skew, limits)
    if guard.limit_m >= most:
        yield (
            where,
            f"found {guard.limit_m:g}, can never trip: motors that push against each other with "
            f"max_voltage_v {limits.max_voltage_v:g} V skew a beam of "
            f"{dual.skew.stiffness_v_m:g} V/m by {most:.3g} m; should be less",
        )


def check_dual_drive(
    dual: DualDrive, limits: Limits, homing: Homing | None, guards: Guards | None
) -> Iterator[Finding]:
    """Check the skew loop's voltage, and what homing needs of both ends."""
    skew = dual.skew
    if skew.max_voltage_v >= limits.max_voltage_v:
        yield (
            ("dual_drive", "skew", "max_voltage_v"),
            f"found {skew.max_voltage_v:g}, should be below limits.max_voltage_v "
            f"{limits.max_voltage_v:g} V: nothing would be left to move the beam",
        )
    if homing is None or homing.method == "absolute":
        return
    where = ("dual_drive", "max_out_of_square_m")
    apart = dual.max_out_of_square_m
    if apart is None:
        yield where, f"is missing; homing by {homing.method} needs it"
    elif guards and guards.skew and apart < guards.skew.limit_m:
        yield (
            where,
            f"found {apart:g}, should be at least guards.skew.limit_m {guards.skew.limit_m:g} m: a "
            "beam that stood within its limit could not be homed",
        )
    elif apart >= (travel := limits.travel_m[1] - limits.travel_m[0]) > 2.0 * _skew_limit_m(guards):
        message = f"found {apart:g}, can never trip: both ends are within the travel of "
        yield where, f"{message}{travel:g} m; should be less"
    elif apart > (most := most_skew_m(skew, limits)) > _skew_limit_m(guards):
        yield (
            where,
            f"found {apart:g}, can never trip on a beam that is askew: motors that push against "
            f"each other with max_voltage_v {limits.max_voltage_v:g} V skew one of "
            f"{skew.stiffness_v_m:g} V/m by {most:.3g} m; should be at most that",
        )


def most_skew_m(skew: SkewLoop, limits: Limits) -> float:
    """Return how far two motors that push against each other skew the beam [m]."""
    return limits.max_voltage_v / skew.stiffness_v_m if skew.stiffness_v_m else math.inf


def _skew_limit_m(guards: Guards | None) -> float:
    return guards.skew.limit_m if guards and guards.skew else 0.0


def skew_margins(
    skew: SkewLoop, model: EffectList, input_delay_s: float, period_s: float
) -> LoopMargins:
    """Return the margins of the sampled skew loop, behind the delay and the lag of the axis."""
    return loop_margins(
        skew.inertia_v_s2_m,
        skew.damping_v_s_m,
        k1_1_s=skew.k1_1_s,
        ks_v_s_m=skew.ks_v_s_m,
        gamma_d=skew.gamma_d,
        period_s=period_s,
        delay_s=input_delay_s + model.delay_s,
        lag_s=model.lag_s,
        stiffness=skew.stiffness_v_m,
    )


def check_skew_loop(
    skew: SkewLoop, model: EffectList, input_delay_s: float, rate_hz: float
) -> Iterator[Finding]:
    """Check that the skew loop's corners lie below the sampling, and that it is stable."""
    where = ("dual_drive", "skew")
    if skew.k1_1_s >= rate_hz:
        message = f"found {skew.k1_1_s:g}, should be below the rate of {rate_hz:g} 1/s"
        yield (*where, "k1_1_s"), message
        return
    margins = skew_margins(skew, model, input_delay_s, 1.0 / rate_hz)
    if not margins.stable:
        yield (
            where,
            f"the sampled skew loop is unstable: ks {skew.ks_v_s_m:g}, k1 {skew.k1_1_s:g}, gamma_d "
            f"{skew.gamma_d:g} around {skew.inertia_v_s2_m:g} V*s^2/m, {skew.damping_v_s_m:g} "
            f"V*s/m, {skew.stiffness_v_m:g} V/m at {rate_hz:g} Hz with {margins.delay_s:g} s of "
            "delay" + (f" and {margins.lag_s:g} s of lag" if margins.lag_s else ""),
        )
