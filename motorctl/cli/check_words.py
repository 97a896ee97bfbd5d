"""What a checked machine is told in: numbers and short sentences."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rich.markup import escape

Part = Mapping[str, Any]


def recording_words(recording: Part) -> str:
    """Return in words how much is recorded, and how long it is kept."""
    told = [
        f"{recording['row_bytes']} bytes a row, {recording['recorded_mb_h']:,.0f} MB an hour while "
        f"recorded, about {recording['closed_mb_h']:,.0f} closed "
        f"({recording['closed_gb_year']:,.0f} GB a year)"
    ]
    if recording["while_off"] == "pause":
        told.append("none while every axis is off")
    if recording["log_h"] is not None:
        told.append(
            f"a new log after {number(round(recording['log_h'] * 60, 1))} min or "
            f"{recording['largest_log_mb']:,.0f} MB"
        )
    kept, free = recording["kept_days"], recording["retention"]["min_free_mb"]
    if kept is not None:
        told.append(f"the oldest are removed after about {number(round(kept, 1))} days")
    if free is not None:
        told.append(f"the oldest are removed while less than {free:,.0f} MB are free")
    if kept is None and free is None:
        told.append("none is ever removed")
    return "; ".join(told)


def together_words(groups: list[list[str]] | None) -> str:
    """Return in words which axes stop when one trips."""
    if groups is None:
        return "the other axes of its running program are ramped down"
    if not groups:
        return "no other axis is stopped"
    return f"those of its group are ramped down: {'; '.join(' + '.join(g) for g in groups)}"


def late_words(late: Part) -> str:
    """Return in words what happens in ticks without a new sample, until the axes trip."""
    ticks = late["hold_ticks"]
    if not ticks:
        return "trip"
    meant = "predict" if late["predict"] else "hold"
    return f"{meant} {ticks} tick{'s' if ticks > 1 else ''}"


def dual_drive_words(dual: Part) -> str:
    """Return in words how the two ends are held together, and squared."""
    skew, apart_m = dual["skew"], dual["max_out_of_square_m"]
    return (
        f"skew held by k1 {number(skew['k1_1_s'])} 1/s, ks {number(skew['ks_v_s_m'])} V*s/m, "
        f"gamma_d {number(skew['gamma_d'])} V/m with at most {number(skew['max_voltage_v'])} V, "
        f"squared at {number(skew['squaring_velocity_m_s'] * 1e3)} mm/s"
        + (f", homed within {number(apart_m * 1e3)} mm" if apart_m else "")
    )


def guard_words(guards: Part) -> str:
    """Return in words how far each guard lets the axis go."""
    stuck, noise, saturation, thermal = (
        guards[name] for name in ("encoder_stuck", "encoder_noise", "saturation", "thermal")
    )
    told = []
    if stuck:
        told.append(f"encoder stuck over {number(stuck['distance_m'] * 1e3)} mm")
    if noise:
        told.append(f"encoder noise {number(noise['rms_m'] * 1e6)} um rms")
    if saturation:
        told.append(f"saturated for {number(saturation['time_s'])} s")
    if thermal:
        told.append(
            f"I2t {number(thermal['continuous_voltage_v'])} V over "
            f"{number(thermal['time_constant_s'])} s"
        )
    if guards["skew"]:
        told.append(f"skew {number(guards['skew']['limit_m'] * 1e3)} mm")
    frozen_s = guards["host_frozen"]["time_s"]
    if frozen_s is None:
        told.append("computer frozen: never, its time waits")
    else:
        told.append(f"computer frozen for {number(frozen_s)} s")
    told.append(f"supervisor silent for {number(guards['supervisor_lost']['time_s'])} s")
    return ", ".join(told)


def quick_stop_words(guards: Part) -> str:
    """Return in words for which guards the axis is ramped down; the others let it go at once."""
    names = [name for name, guard in guards.items() if guard and guard["reaction"] == "quick_stop"]
    return f"on {', '.join(names) or 'nothing'}; else zero volts and disable"


def effect_words(effects: Part) -> str:
    """List the effects, in the order of theta, each with the options that it runs with."""
    told = []
    for name, options in effects.items():
        given = (f"{key} {_option(value)}" for key, value in options.items() if value is not None)
        text = ", ".join(given)
        told.append(f"{name} ({text})" if text else name)
    return escape("; ".join(told))


def _option(value: Any) -> str:
    if isinstance(value, list):
        return " ".join(_option(item) for item in value)
    return number(value) if isinstance(value, int | float) else str(value)


def adaptation_words(adaptation: Part) -> str:
    """Return in words how parameters are learned."""
    if not adaptation["enabled"]:
        return "off"
    return (
        f"alpha {number(adaptation['forgetting_1_s'])} 1/s, nu "
        f"{number(adaptation['normalisation'])}, filter {number(adaptation['filter_rad_s'])} "
        f"rad/s, above {number(adaptation['gate_velocity_m_s'])} m/s or "
        f"{number(adaptation['gate_acceleration_m_s2'])} m/s^2, input delay "
        f"{number(adaptation['input_delay_s'] * 1e3)} ms"
    )


def homing_words(homing: Part) -> str:
    """Return in words how the zero is found."""
    if homing["method"] == "absolute":
        return "absolute encoder"
    search = homing["search_velocity_m_s"]
    return (
        f"{homing['method']}: "
        + (f"search at {number(search)} m/s, " if search else "")
        + f"latch at {number(homing['latch_velocity_m_s'])} m/s, home at "
        f"{number(homing['home_position_m'])} m, within {number(homing['timeout_s'])} s"
    )


def inverse(value: float | None) -> float | None:
    """Return 1/value; None where there is none."""
    return 1.0 / value if value else None


def number(value: float | None, digits: int = 6) -> str:
    """Return a number with at most so many digits; None stands for infinity."""
    if value is None:
        return "inf"
    rounded = round(value, 12)
    return f"{rounded or 0.0:.{digits}g}"


def limit_words(limits: Part) -> str:
    """Return in words how far, fast and hard an axis may go."""
    low, high = limits["travel_m"]
    return (
        f"travel {number(low)} to {number(high)} m, {number(limits['max_velocity_m_s'])} m/s, "
        f"{number(limits['max_acceleration_m_s2'])} m/s^2, {number(limits['max_jerk_m_s3'])} "
        f"m/s^3, {number(limits['max_voltage_v'])} V"
    )


def following_error_words(error: Part) -> str:
    """Return in words which following error trips an axis."""
    return (
        f"{number(error['minimum_m'] * 1e3)} mm + {number(error['per_velocity_s'] * 1e3)} ms x |v| "
        f"for {number(error['filter_time_s'] * 1e3)} ms"
    )


def wiring_words(axis: Part) -> str:
    """Return in words what law an axis runs, and where it is connected."""
    dual = axis["dual_drive"]
    channels = f"channels {axis['channel']} + {dual['channel']}" if dual else ""
    channels = channels or f"channel {axis['channel']}"
    return f"{axis['controller']} on {axis['driver']} {channels}"
