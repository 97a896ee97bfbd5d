"""An axis as it stands in a configuration: its keys, and a comment on what each rests on."""

from __future__ import annotations

import math
from typing import Any

from motorctl.init.axis_numbers import (
    COMMAND_SHARE,
    ROLLING_FRICTION,
    ROTARY_FRICTION,
    AxisNumbers,
    friction_slope_s_m,
)
from motorctl.init.dual_drive import dual_drive_keys
from motorctl.init.known import AxisKnown, driver_key
from motorctl.init.yaml_text import Path
from motorctl.model import Effect, basic_effects, known_effects
from motorctl.motion import Moves

PROGRAM_SHARE = 0.6
"""Of travel, speed and acceleration, for the first motion: far from every limit. By hand."""
DWELL_S = 0.3
"""Rest at both ends of the first motion [s], so that settling is seen. By hand."""
RECORD_S = 20.0
"""The first motion lasts so long at least [s]: enough to identify from. By hand."""
LEAST_CYCLES, MOST_CYCLES = 2, 12
SPEEDS = ((0.618, 1.0), (0.4142, 0.5), (0.2071, 0.25))
"""Of the first motion, as parts of the top speed, and how far each goes, as parts of its distance:
three speeds tell viscous friction from drag and from Coulomb friction. No round numbers: at a
whole number of counts a tick each is off by the same, which looks like an encoder's error."""
SEARCH_M_S, LATCH_M_S = 0.05, 0.01
"""Speeds of homing at most [m/s]: slow enough that a switch that is not there harms nothing."""
SEARCH_RAD_S, LATCH_RAD_S = 0.5, 0.1
"""The same of a rotary axis [rad/s]: those of a rim of 10 cm. By hand."""
HOME_SHARE = 0.05
"""Of the travel, from its lower end: where a home switch or an index mark is taken to be."""


def axis_keys(numbers: AxisNumbers) -> tuple[dict[str, Any], dict[Path, str]]:
    """Return the keys of an axis, and comments by their paths below the axis."""
    known, gains = numbers.known, numbers.gains
    units = known.units
    keys: dict[str, Any] = {"kind": "rotary"} if units.kind == "rotary" else {}
    keys |= {
        "driver": driver_key(known.driver),
        "channel": known.channel,
    }
    beside: dict[Path, str] = {}
    if numbers.skew is not None:
        of_both, beside = dual_drive_keys(known, numbers.skew)
        keys |= of_both
    keys |= {
        "encoder": {
            "resolution_m": known.resolution_m,
            "counter_bits": known.counter_bits,
            "direction": 1,
        },
        "limits": {
            "travel_m": list(known.travel_m),
            "max_velocity_m_s": known.max_velocity_m_s,
            "max_acceleration_m_s2": numbers.acceleration_m_s2,
            "max_jerk_m_s3": numbers.jerk_m_s3,
            "max_voltage_v": known.max_voltage_v,
            "following_error": {
                "minimum_m": numbers.error_m,
                "per_velocity_s": numbers.error_per_velocity_s,
                "filter_time_s": numbers.error_filter_s,
            },
            "stop": {
                "acceleration_m_s2": numbers.acceleration_m_s2,
                "jerk_m_s3": numbers.jerk_m_s3,
            },
        },
        "gains": {
            "k1_1_s": gains.k1_1_s,
            "ks_v_s_m": gains.ks_v_s_m,
            "gamma_d": gains.gamma_d,
            "d_hat_max_v": numbers.d_hat_max_v,
        },
    }
    told: dict[Path, str] = beside | {
        ("kind",): "in radians: every key that is named in metres is in rad, rad/s, rad/s^2",
        ("encoder",): f"{'radians' if units.kind == 'rotary' else 'metres'} a count; "
        "direction: 1 where counts rise with positive volts, else -1",
        ("limits", "travel_m"): "soft limits, in force once the axis is homed",
        ("limits", "max_velocity_m_s"): "1.2 times as much trips the axis",
        ("limits", "max_acceleration_m_s2"): _acceleration_words(numbers),
        ("limits", "max_jerk_m_s3"): "the acceleration rises within "
        f"{numbers.acceleration_m_s2 / numbers.jerk_m_s3 * 1e3:.3g} ms",
        ("limits", "max_voltage_v"): "the full command, that of the amplifier's input"
        + (", of each motor" if known.second else ""),
        ("limits", "following_error"): "trips beyond it: as far as the full command pulls the axis "
        f"against ks k1 = {gains.ks_v_s_m * gains.k1_1_s:.3g} V/m, within counts and travel",
        ("limits", "stop"): "the ramp of `stop`: as hard as any motion",
        ("gains",): _gains_words(numbers),
    }
    keys["model"], comments = _model(numbers)
    told |= {("model", *path): words for path, words in comments.items()}
    told["model",] = "initial: where the estimate begins; bounds: where it may go"
    keys["adaptation"] = {
        "forgetting_1_s": 0.5,
        "normalisation": 0.01,
        "filter_rad_s": numbers.filter_rad_s,
        "gate_velocity_m_s": numbers.gate_velocity_m_s,
        "gate_acceleration_m_s2": numbers.gate_acceleration_m_s2,
    }
    told["adaptation",] = "learns above this speed or this acceleration"
    keys["homing"], told["homing",] = homing(known)
    keys["program"] = program_name(known)
    told["program",] = "what `start` follows; remove it to hold"
    return keys, {path: units.words(text) for path, text in told.items() if path[0] in keys}


def _acceleration_words(numbers: AxisNumbers) -> str:
    known = numbers.known
    needed = numbers.acceleration_m_s2 * numbers.inertia
    if known.max_acceleration_m_s2 is not None:
        return f"takes {needed:.3g} V of {known.max_voltage_v:g} V"
    if needed < 0.9 * COMMAND_SHARE * (known.max_voltage_v - 2.0 * numbers.friction):
        return f"reaches the top speed soon enough; takes {needed:.3g} V"
    return f"{COMMAND_SHARE:.0%} of the full command, {needed:.3g} V; friction needs some besides"


def _gains_words(numbers: AxisNumbers) -> str:
    gains = numbers.gains
    delay = f" and {numbers.delay_s * 1e3:g} ms of delay" if numbers.delay_s else ""
    return (
        f"{gains.margins_in_words} "
        f"at {1.0 / numbers.period_s:g} Hz{delay}; k1 is no higher as {gains.bound_by}. "
        "`motorctl tune` chooses them anew from a log"
    )


def _model(numbers: AxisNumbers) -> tuple[dict[str, Any], dict[Path, str]]:
    known, basic = numbers.known, basic_effects()
    mass, viscous = basic["acceleration"].name, basic["velocity"].name
    coulomb, constant = basic["direction"].name, basic["one"].name
    slope_s_m = friction_slope_s_m(known)
    slope = {} if slope_s_m is None else {"slope_s_m": slope_s_m}
    model: dict[str, Any] = {
        mass: _parameter(numbers.inertia, numbers.inertia_bounds, numbers.covariances[0]),
        viscous: _parameter(numbers.viscous, numbers.viscous_bounds, numbers.covariances[1]),
        coulomb: _parameter(numbers.friction, numbers.friction_bounds) | slope,
        constant: _parameter(0.0, numbers.offset_bounds),
    }
    units, rotary = known.units, known.units.kind == "rotary"
    friction = f"friction of {ROLLING_FRICTION:.0%} of the weight, a guess for a rail"
    if rotary:
        friction = f"friction of {ROTARY_FRICTION:.0%} of the full command, a guess for a bearing"
    if known.friction_n is not None:
        which = "torque" if rotary else "force"
        friction = f"{known.friction_n:g} {units.force} over the {which} constant"
    inertia = f"{known.mass_kg:.4g} {units.inertia}"
    told: dict[Path, str] = {
        (mass,): "V*s^2/m: "
        + (known.inertia_said or f"{inertia} / {known.force_constant_n_v:.4g} {units.force}/V"),
        (viscous,): "V*s/m: at the top speed as much as Coulomb friction, a guess",
        (coulomb,): f"V: {friction}",
        (constant,): "V: a cable, a constant torque"
        if rotary
        else "V: a slope, a cable; a vertical axis has its weight here",
    }
    delay = delay_effect(numbers.delay_s)
    if delay is not None:
        model[delay.name] = delay.options.model_dump()
        told[delay.name,] = "a command acts so much later, by the bus"
    return model, told


def _parameter(
    initial: float, bounds: tuple[float, float], covariance: float | None = None
) -> dict[str, Any]:
    keys: dict[str, Any] = {"initial": initial, "bounds": list(bounds)}
    return keys if covariance is None else keys | {"covariance": covariance}


def delay_effect(delay_s: float) -> Effect | None:
    """Return the effect that delays a command, None for no delay."""
    if not delay_s:
        return None
    forms = (cls.delaying(delay_s) for cls in known_effects().values())
    return next(form for form in forms if form is not None)


def home_position_m(known: AxisKnown) -> float:
    """Return where the home switch or the index mark is, as it was told, or near the lower end."""
    if known.home_position_m is not None:
        return known.home_position_m
    low, high = known.travel_m
    digits = 3 - math.floor(math.log10(high - low))  # a short travel may lie far from zero
    return round(low + HOME_SHARE * (high - low), digits)


def homing(known: AxisKnown) -> tuple[dict[str, Any], str]:
    """Return the keys of an axis' homing, and what they rest on."""
    if known.homing == "absolute":
        return {"method": "absolute"}, "the encoder knows its position at power-on"
    low, high = known.travel_m
    rotary = known.units.kind == "rotary"
    fast, slow = (SEARCH_RAD_S, LATCH_RAD_S) if rotary else (SEARCH_M_S, LATCH_M_S)
    search = float(f"{min(fast, known.max_velocity_m_s / 5.0):.2g}")
    latch = float(f"{min(slow, search / 2.0):.2g}")
    slowest = latch if known.homing == "index" else min(search, latch)
    timeout_s = math.ceil(5.0 * (high - low) / slowest + 5.0)
    keys: dict[str, Any] = {"method": known.homing}
    if known.homing != "index":
        keys["search_velocity_m_s"] = -search
    keys |= {
        "latch_velocity_m_s": latch,
        "home_position_m": home_position_m(known),
        "timeout_s": float(timeout_s),
    }
    words = {
        "switch": "down to the home switch, then its edge upwards",
        "switch_index": "down to the home switch, then the next index mark upwards",
        "index": "the next index mark upwards",
    }[known.homing]
    if known.home_position_m is None:
        words += "; home_position_m is a guess"
    return keys, words


def program_name(known: AxisKnown) -> str:
    """Return the name of the first motion of an axis."""
    return f"shuttle_{known.name}"


def program(numbers: AxisNumbers) -> dict[str, Any]:
    """Return the first motion: there and back at several speeds, far from every limit.

    The slower ones go less far, so that it does not last for minutes.
    """
    known = numbers.known
    low, high = known.travel_m
    start = float(f"{low + 0.5 * (1.0 - PROGRAM_SHARE) * (high - low):.4g}")
    distance = float(f"{PROGRAM_SHARE * (high - low):.3g}")
    moves: list[dict[str, float]] = []
    for speed, way in SPEEDS:
        limits = {
            "max_velocity_m_s": float(f"{speed * known.max_velocity_m_s:.4g}"),
            "max_acceleration_m_s2": _rounded(PROGRAM_SHARE * numbers.acceleration_m_s2),
            "max_jerk_m_s3": _rounded(PROGRAM_SHARE * numbers.jerk_m_s3),
            "dwell_s": DWELL_S,
        }
        there = float(f"{start + way * distance:.4g}")
        moves += [{"target_m": there, **limits}, {"target_m": start, **limits}]
    keys = {"kind": "moves", "axis": known.name, "start_m": start, "moves": moves}
    planned = Moves.model_validate(keys | {"name": "first", "moves": tuple(moves)})
    once = planned.trajectories()[known.name].duration_s
    return keys | {"cycles": min(max(math.ceil(RECORD_S / once), LEAST_CYCLES), MOST_CYCLES)}


def _rounded(value: float) -> float:
    return float(f"{value:.3g}")
