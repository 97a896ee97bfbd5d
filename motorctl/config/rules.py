"""What an axis' numbers must be to each other; each rule notes its problem with its arithmetic."""

from __future__ import annotations

import math
from collections.abc import Iterable

from motorctl.config.document import Document, KeyPath
from motorctl.config.machine import Gains
from motorctl.config.shape import AdaptationShape, EncoderShape, HomingShape, LimitsShape
from motorctl.config.validation import shown, suggest
from motorctl.control import max_input_delay_s
from motorctl.model import EffectList

COUNTS_AT_REST = 2
"""A following error of so many counts is quantisation."""


def check_range(document: Document, path: KeyPath) -> None:
    """Check that two numbers that stand at `path` are lower and upper, in this order."""
    found = document.at(path)
    if not isinstance(found, list) or len(found) != 2:
        return
    low, high = found
    if all(isinstance(end, int | float) for end in found) and not low < high:
        message = "the lower end should stand first, below the upper one"
        document.add(path, f"found {shown(found)}, {message}")


def check_limits(document: Document, path: KeyPath, limits: LimitsShape) -> None:
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
            document.add((*path, "stop", key), message)
    distance = stopping_distance_m(
        limits.max_velocity_m_s, limits.stop.acceleration_m_s2, limits.stop.jerk_m_s3
    )
    if distance > travel:
        message = f"stopping from {limits.max_velocity_m_s:g} m/s takes {distance:.3g} m"
        document.add((*path, "stop"), f"{message}, longer than the travel of {travel:g} m")
    error = limits.following_error
    if error.minimum_m >= travel:
        message = f"found {error.minimum_m:g}, should be less than the travel of {travel:g} m"
        document.add((*path, "following_error", "minimum_m"), message)
    unseen = limits.max_velocity_m_s * error.filter_time_s
    if unseen >= travel:
        message = (
            f"found {error.filter_time_s:g}, within which the axis can cross {unseen:.3g} m "
            f"at {limits.max_velocity_m_s:g} m/s: its whole travel of {travel:g} m"
        )
        document.add((*path, "following_error", "filter_time_s"), message)


def stopping_distance_m(velocity: float, acceleration: float, jerk: float) -> float:
    """Give the way from full velocity to rest with limited acceleration and jerk."""
    if velocity * jerk >= acceleration**2:
        duration = velocity / acceleration + acceleration / jerk
    else:
        duration = 2.0 * math.sqrt(velocity / jerk)
    return velocity * duration / 2.0


def check_encoder(
    document: Document, axis: KeyPath, encoder: EncoderShape, limits: LimitsShape, rate_hz: float
) -> None:
    """Check that a tick's count can be unwrapped, and that the limits are coarser than counts."""
    step = limits.max_velocity_m_s / rate_hz / encoder.resolution_m
    largest = 2.0 ** (encoder.counter_bits - 2)
    if step > largest:
        needed = max(8, math.ceil(math.log2(step)) + 2) if math.isfinite(step) else 65
        document.add(
            (*axis, "encoder", "counter_bits"),
            f"found {encoder.counter_bits}, at {limits.max_velocity_m_s:g} m/s and {rate_hz:g} Hz "
            f"the count moves by {step:.6g} a tick, a quarter of the counter's range is "
            f"{largest:.6g}; needs {needed} bits, a lower speed or a higher rate",
        )
    least = COUNTS_AT_REST * encoder.resolution_m
    if limits.following_error.minimum_m <= least:
        document.add(
            (*axis, "limits", "following_error", "minimum_m"),
            f"found {limits.following_error.minimum_m:g}, should be above {COUNTS_AT_REST} "
            f"encoder counts, {least:g} m, or it trips at rest",
        )


def check_homing(
    document: Document,
    path: KeyPath,
    homing: HomingShape,
    limits: LimitsShape,
    encoder: EncoderShape | None,
) -> None:
    """Check that the method has what it needs, and that the zero can be found within the limits."""
    low, high = limits.travel_m
    travel = high - low
    if homing.method == "absolute":
        if encoder and travel > encoder.resolution_m * 2.0**encoder.counter_bits:
            span = encoder.resolution_m * 2.0**encoder.counter_bits
            message = f"found absolute, but the counter repeats every {span:g} m, less than the"
            document.add((*path, "method"), f"{message} travel of {travel:g} m")
        return
    needed = ["latch_velocity_m_s", "home_position_m", "timeout_s"]
    if homing.method != "index":
        needed.insert(0, "search_velocity_m_s")
    for key in needed:
        if getattr(homing, key) is None:
            document.add((*path, key), f"is missing; homing by {homing.method} needs it")
    for key in ("search_velocity_m_s", "latch_velocity_m_s"):
        velocity = getattr(homing, key)
        if velocity is not None and not 0.0 < abs(velocity) <= limits.max_velocity_m_s:
            fastest = limits.max_velocity_m_s
            message = f"found {velocity:g}, should not be 0 and at most {fastest:g} m/s"
            document.add((*path, key), f"{message} either way")
    home = homing.home_position_m
    if home is not None and low < high and not low <= home <= high:
        message = f"found {home:g}, should lie within travel_m: {low:g} to {high:g} m"
        document.add((*path, "home_position_m"), message)
    velocity = homing.search_velocity_m_s if homing.method != "index" else None
    if velocity and homing.timeout_s and travel > abs(velocity) * homing.timeout_s:
        document.add(
            (*path, "timeout_s"),
            f"found {homing.timeout_s:g}, should be above {travel / abs(velocity):.3g} s: "
            f"the search crosses {travel:g} m at {abs(velocity):g} m/s",
        )


def check_adaptation(
    document: Document, path: KeyPath, adaptation: AdaptationShape, rate_hz: float
) -> None:
    """Check filter, forgetting and delay against the sampling."""
    nyquist = math.pi * rate_hz
    if adaptation.filter_rad_s >= nyquist:
        document.add(
            (*path, "filter_rad_s"),
            f"found {adaptation.filter_rad_s:g}, should be below the Nyquist frequency, "
            f"pi x {rate_hz:g} Hz = {nyquist:.6g} rad/s",
        )
    if adaptation.forgetting_1_s >= adaptation.filter_rad_s:
        document.add(
            (*path, "forgetting_1_s"),
            f"found {adaptation.forgetting_1_s:g}, should be far below filter_rad_s "
            f"{adaptation.filter_rad_s:g}: data would be forgotten before it is through the filter",
        )
    longest = max_input_delay_s(1.0 / rate_hz)
    if adaptation.input_delay_s > longest:
        message = f"found {adaptation.input_delay_s:g}, should be at most {longest:.6g} s"
        document.add((*path, "input_delay_s"), f"{message} at {rate_hz:g} Hz")


def check_timing(
    document: Document, path: KeyPath, model: EffectList, input_delay_s: float, rate_hz: float
) -> None:
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
    document.add(
        (*path, slowest.name),
        f"found {' + '.join(parts)}, lag and delay should together be at most {longest:.6g} s at "
        f"{rate_hz:g} Hz",
    )


def check_other_axes(
    document: Document, axis: str, model: EffectList, known: Iterable[str]
) -> None:
    """Check that the axes that effects name exist and are others than their own."""
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
            path: KeyPath = ("axes", axis, "model", effect.name)
            document.add((*path, *_place_of(document.at(path), other)), message)


def _place_of(part: object, value: str) -> KeyPath:
    """Give where in an effect's keys a word stands."""
    for key, found in part.items() if isinstance(part, dict) else ():
        if found == value:
            return (key,)
        if isinstance(found, list) and value in found:
            return (key, found.index(value))
    return ()


def check_gains(document: Document, path: KeyPath, gains: Gains, rate_hz: float) -> bool:
    """Check that the gains' corners lie below the sampling; tells whether they do."""
    before = len(document.problems)
    if gains.k1_1_s >= rate_hz:
        message = f"found {gains.k1_1_s:g}, k1 should be below the rate of {rate_hz:g} 1/s"
        document.add((*path, "k1_1_s"), message)
    corner = gains.gamma_d / gains.ks_v_s_m
    if corner >= rate_hz:
        document.add(
            (*path, "gamma_d"),
            f"found {gains.gamma_d:g}, gamma_d / ks = {corner:.6g} 1/s should be below the rate "
            f"of {rate_hz:g} 1/s, so gamma_d below {rate_hz * gains.ks_v_s_m:.6g}",
        )
    return len(document.problems) == before
