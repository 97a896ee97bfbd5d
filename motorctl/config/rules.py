"""What an axis' numbers must be to each other; each rule says what is wrong with its arithmetic.

The rules take the machine's own models, and yield places below the axis' key.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from motorctl.config.axis_keys import (
    Adaptation,
    Encoder,
    Experiments,
    Gains,
    Homing,
    Limits,
)
from motorctl.config.count_limits import ambiguous_counts, too_fast_m_s
from motorctl.config.guard_keys import COUNTER_PARTS, LATE_READ_PERIODS
from motorctl.config.validation import Finding, shown, suggest
from motorctl.control import max_input_delay_s
from motorctl.located_yaml import KeyPath
from motorctl.model import EffectList

HIGHEST_FILTER = 0.45
"""Most that the frequency of a command filter may be, as a part of the rate: half of that is what a
sampled filter knows at all, and close to it a notch is wider than it says. By hand."""
COUNTS_AT_REST = 2
"""A following error of so many counts is quantisation."""
HOMING_CROSSINGS = 10
"""Of the travel, in which homing must be given up. Search, clearance and latch are three; fewer
leave no room for a slow stop, more let an axis search for a switch that is not there. By hand."""
SHORT_HOMING_S = 60.0
"""Time that homing may take whatever its speeds are [s]: an operator waits so long. By hand."""


def out_of_order(found: Any) -> str | None:
    """Return what is wrong where two numbers are not lower and upper, in this order."""
    if not isinstance(found, list) or len(found) != 2:
        return None
    low, high = found
    if all(isinstance(end, int | float) for end in found) and not low < high:
        return f"found {shown(found)}, the lower end should stand first, below the upper one"
    return None


def check_limits(limits: Limits) -> Iterator[Finding]:
    """Check soft limits, the stop ramp and the following error's limit against each other."""
    low, high = limits.travel_m
    if not low < high:
        return
    travel = high - low
    for key, value, limit_key, limit, unit in (
        ("acceleration_m_s2", limits.stop.acceleration_m_s2,
         "max_acceleration_m_s2", limits.max_acceleration_m_s2, "m/s^2"),
        ("jerk_m_s3", limits.stop.jerk_m_s3, "max_jerk_m_s3", limits.max_jerk_m_s3, "m/s^3"),
    ):  # fmt: skip
        if value > limit:
            message = f"found {value:g}, should be at most {limit_key}: {limit:g} {unit}"
            yield ("limits", "stop", key), message
    distance = stopping_distance_m(
        limits.max_velocity_m_s, limits.stop.acceleration_m_s2, limits.stop.jerk_m_s3
    )
    if distance > travel:
        message = f"stopping from {limits.max_velocity_m_s:g} m/s takes {distance:.3g} m"
        yield ("limits", "stop"), f"{message}, longer than the travel of {travel:g} m"
    yield from _check_following_error(limits, travel)


def _check_following_error(limits: Limits, travel: float) -> Iterator[Finding]:
    """Check that an axis that runs away can trip before an end of its travel."""
    error, fastest, half = limits.following_error, limits.max_velocity_m_s, 0.5 * travel
    if error.minimum_m >= half:
        message = (
            f"found {error.minimum_m:g}, from the middle of the travel of {travel:g} m it cannot "
            f"trip before an end, {half:g} m away; should be less"
        )
        yield ("limits", "following_error", "minimum_m"), message
    allowed = error.minimum_m + error.per_velocity_s * fastest
    if error.minimum_m < half and allowed >= travel:
        message = (
            f"found {error.per_velocity_s:g}, at {fastest:g} m/s an error of {error.minimum_m:g} m "
            f"+ {error.per_velocity_s:g} s x {fastest:g} m/s = {allowed:.3g} m would be allowed, "
            f"as much as the travel of {travel:g} m: in fast motion it can never trip; should be "
            "less"
        )
        yield ("limits", "following_error", "per_velocity_s"), message
    unseen = fastest * error.filter_time_s
    if unseen >= travel:
        message = (
            f"found {error.filter_time_s:g}, within which the axis can cross {unseen:.3g} m "
            f"at {fastest:g} m/s: its whole travel of {travel:g} m"
        )
        yield ("limits", "following_error", "filter_time_s"), message
    whole = allowed + unseen
    if error.minimum_m < half and max(allowed, unseen) < travel < whole:
        yield (
            ("limits", "following_error"),
            f"in fast motion it can never trip: at {fastest:g} m/s the error has to grow to "
            f"minimum_m {error.minimum_m:g} m + per_velocity_s {error.per_velocity_s:g} s x "
            f"{fastest:g} m/s = {allowed:.3g} m and on for filter_time_s {error.filter_time_s:g} "
            f"s, {unseen:.3g} m more, together {whole:.3g} m, and the travel is {travel:g} m; "
            "should be less",
        )


def stopping_distance_m(velocity: float, acceleration: float, jerk: float) -> float:
    """Return the way from full velocity to rest with limited acceleration and jerk."""
    if velocity * jerk >= acceleration**2:
        duration = velocity / acceleration + acceleration / jerk
    else:
        duration = 2.0 * math.sqrt(velocity / jerk)
    return velocity * duration / 2.0


def check_encoder(encoder: Encoder, limits: Limits, rate_hz: float) -> Iterator[Finding]:
    """Check that a tick's count can be unwrapped, and that the limits are coarser than counts.

    The step that is a jump has to be beyond what overspeed trips on, and beyond the top speed's in
    a read that comes late.
    """
    fastest, count_m = limits.max_velocity_m_s, encoder.resolution_m
    step = fastest / rate_hz / count_m
    too_fast = too_fast_m_s(fastest, count_m, 1.0 / rate_hz) / rate_hz / count_m
    late = LATE_READ_PERIODS * step
    jump = ambiguous_counts(2**encoder.counter_bits)
    most = max(too_fast + 1.0, late)  # the first whole count that is too fast
    if most >= jump:
        bits = math.floor(math.log2(most * COUNTER_PARTS)) + 1 if math.isfinite(most) else 65
        why = (
            f"guards.overspeed, beyond {too_fast:.6g}, can never trip"
            if too_fast + 1.0 >= jump
            else f"one that is read late, of up to {late:.6g}, would be told as one"
        )
        yield (
            ("encoder", "counter_bits"),
            f"found {encoder.counter_bits}, at {fastest:g} m/s and {rate_hz:g} Hz "
            f"the count moves by {step:.6g} a tick, and a step of a quarter of the counter's "
            f"range, {jump:.6g}, is a jump: {why}; needs {max(8, bits)} bits, a lower speed or a "
            "higher rate",
        )
    least = COUNTS_AT_REST * encoder.resolution_m
    if limits.following_error.minimum_m <= least:
        yield (
            ("limits", "following_error", "minimum_m"),
            f"found {limits.following_error.minimum_m:g}, should be above {COUNTS_AT_REST} "
            f"encoder counts, {least:g} m, or it trips at rest",
        )


def check_experiments(experiments: Experiments, limits: Limits) -> Iterator[Finding]:
    """Check that what experiments may use is a part of what the axis may."""
    travel, (low, high) = experiments.travel_m, limits.travel_m
    if travel is not None and not (low <= travel[0] < travel[1] <= high):
        yield (
            ("experiments", "travel_m"),
            f"found {shown(list(travel))}, should be within limits.travel_m {shown([low, high])}",
        )


def check_homing(homing: Homing, limits: Limits, encoder: Encoder | None) -> Iterator[Finding]:
    """Check that the method has what it needs, and that the zero can be found within the limits."""
    low, high = limits.travel_m
    travel = high - low
    if homing.method == "absolute":
        if encoder and travel > encoder.resolution_m * 2.0**encoder.counter_bits:
            span = encoder.resolution_m * 2.0**encoder.counter_bits
            message = f"found absolute, but the counter repeats every {span:g} m, less than the"
            yield ("homing", "method"), f"{message} travel of {travel:g} m"
        return
    needed = ["latch_velocity_m_s", "home_position_m", "timeout_s"]
    if homing.method != "index":
        needed.insert(0, "search_velocity_m_s")
    for key in needed:
        if getattr(homing, key) is None:
            yield ("homing", key), f"is missing; homing by {homing.method} needs it"
    for key in ("search_velocity_m_s", "latch_velocity_m_s"):
        velocity = getattr(homing, key)
        if velocity is not None and not 0.0 < abs(velocity) <= limits.max_velocity_m_s:
            fastest = limits.max_velocity_m_s
            message = f"found {velocity:g}, should not be 0 and at most {fastest:g} m/s"
            yield ("homing", key), f"{message} either way"
    home = homing.home_position_m
    if home is not None and low < high and not low <= home <= high:
        message = f"found {home:g}, should lie within travel_m: {low:g} to {high:g} m"
        yield ("homing", "home_position_m"), message
    velocity = homing.search_velocity_m_s if homing.method != "index" else None
    if velocity and homing.timeout_s and travel > abs(velocity) * homing.timeout_s:
        yield (
            ("homing", "timeout_s"),
            f"found {homing.timeout_s:g}, should be above {travel / abs(velocity):.3g} s: "
            f"the search crosses {travel:g} m at {abs(velocity):g} m/s",
        )
    speeds = [abs(v) for v in (velocity, homing.latch_velocity_m_s) if v]
    if homing.timeout_s and speeds and low < high:
        slowest = min(speeds)
        crossed_s = HOMING_CROSSINGS * travel / slowest
        most = max(SHORT_HOMING_S, crossed_s)
        if homing.timeout_s > most:
            yield (
                ("homing", "timeout_s"),
                f"found {homing.timeout_s:g}, homing would hardly ever be given up: {travel:g} m "
                f"at {slowest:g} m/s are crossed {HOMING_CROSSINGS} times in "
                f"{crossed_s:.3g} s; should be at most {most:.3g} s",
            )


def check_adaptation(adaptation: Adaptation, rate_hz: float) -> Iterator[Finding]:
    """Check filter, forgetting and delay against the sampling."""
    nyquist = math.pi * rate_hz
    if adaptation.filter_rad_s >= nyquist:
        yield (
            ("adaptation", "filter_rad_s"),
            f"found {adaptation.filter_rad_s:g}, should be below the Nyquist frequency, "
            f"pi x {rate_hz:g} Hz = {nyquist:.6g} rad/s",
        )
    if adaptation.forgetting_1_s >= adaptation.filter_rad_s:
        yield (
            ("adaptation", "forgetting_1_s"),
            f"found {adaptation.forgetting_1_s:g}, should be far below filter_rad_s "
            f"{adaptation.filter_rad_s:g}: data would be forgotten before it is through the filter",
        )
    longest = max_input_delay_s(1.0 / rate_hz)
    if adaptation.input_delay_s > longest:
        message = f"found {adaptation.input_delay_s:g}, should be at most {longest:.6g} s"
        yield ("adaptation", "input_delay_s"), f"{message} at {rate_hz:g} Hz"


def check_timing(model: EffectList, input_delay_s: float, rate_hz: float) -> Iterator[Finding]:
    """Check that past commands are kept for as long as the list's lag and delay last."""
    declared = [effect for effect in model.effects if effect.lag_s or effect.delay_s]
    longest = max_input_delay_s(1.0 / rate_hz)
    whole = input_delay_s + model.lag_s + model.delay_s
    if not declared or whole <= longest or input_delay_s > longest:
        return
    parts = [f"{effect.name} {effect.lag_s + effect.delay_s:g} s" for effect in declared]
    if input_delay_s:
        parts.append(f"adaptation.input_delay_s {input_delay_s:g} s")
    slowest = max(declared, key=lambda effect: effect.lag_s + effect.delay_s)
    yield (
        ("model", slowest.name),
        f"found {' + '.join(parts)}, lag and delay should together be at most {longest:.6g} s at "
        f"{rate_hz:g} Hz",
    )


def check_other_axes(
    axis: str, model: EffectList, keys: Mapping[str, Any], known: Iterable[str]
) -> Iterator[Finding]:
    """Check that the axes that effects name exist and are others than their own.

    keys: what the configuration says of the model, where the names stand.
    """
    names = list(known)
    for effect in model.effects:
        for other in effect.other_axes:
            if other == axis:
                message = "is the axis itself; should be another axis"
            elif other not in names:
                others = [name for name in names if name != axis]
                message = f"unknown axis '{other}'; {suggest(other, others)}"
            else:
                continue
            place = _place_of(keys.get(effect.name), other)
            yield ("model", effect.name, *place), message


def _place_of(part: object, value: str) -> KeyPath:
    """Return the place of a word in an effect's keys."""
    for key, found in part.items() if isinstance(part, dict) else ():
        if found == value:
            return (key,)
        if isinstance(found, list) and value in found:
            return (key, found.index(value))
    return ()


def check_gains(gains: Gains, rate_hz: float) -> Iterator[Finding]:
    """Check that the gains' corners lie below the sampling."""
    if gains.k1_1_s >= rate_hz:
        message = f"found {gains.k1_1_s:g}, k1 should be below the rate of {rate_hz:g} 1/s"
        yield ("gains", "k1_1_s"), message
    own = gains.command_filter
    if own is not None and own.frequency_hz > HIGHEST_FILTER * rate_hz:
        yield (
            ("gains", "command_filter", "frequency_hz"),
            f"found {own.frequency_hz:g}, should be at most {HIGHEST_FILTER:g} times the rate of "
            f"{rate_hz:g} 1/s: {HIGHEST_FILTER * rate_hz:g}",
        )
    corner = gains.gamma_d / gains.ks_v_s_m
    if corner >= rate_hz:
        yield (
            ("gains", "gamma_d"),
            f"found {gains.gamma_d:g}, gamma_d / ks = {corner:.6g} 1/s should be below the rate "
            f"of {rate_hz:g} 1/s, so gamma_d below {rate_hz * gains.ks_v_s_m:.6g}",
        )
