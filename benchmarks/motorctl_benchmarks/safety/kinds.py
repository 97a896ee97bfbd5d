"""The faults to order: in which states, with which settings, and how each is brought about."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from motorctl.hal import Status
from motorctl_benchmarks.safety.end_kinds import END_FAULTS
from motorctl_benchmarks.safety.fault_kind import (
    BOTH,
    ENABLED,
    EVERY,
    MOVING,
    TWO,
    Draw,
    FaultKind,
    Numbers,
    ahead,
    jump,
    reports,
    shift,
)
from motorctl_benchmarks.safety.faulty_gantry import DeviceFault
from motorctl_benchmarks.safety.setting import Setting


def _noise(rng: np.random.Generator, case: Setting) -> Numbers:
    """Draw noise whose second difference is q times the limit, in the mean square."""
    rms_m = {0.2e-3: 5e-6, 0.5e-3: 25e-6, 1e-3: 80e-6}[round(case.limits.period_s, 7)]
    ticks = 500.0
    q = float(rng.uniform(4.0, 5.0))
    return {
        "rms_m": rms_m,
        "times_square": q,
        "filter_ticks": ticks,
        "filter_s": ticks * case.limits.period_s,
        "noise_m": rms_m * (q / 6.0) ** 0.5,
    }


def _push(low: float, high: float, push_s: float, *, side: float = 0.0) -> Draw:
    """Draw a push between two accelerations; side: along the motion (1), against it (-1), any."""

    def draw(rng: np.random.Generator, case: Setting) -> Numbers:
        sign = side * case.direction if side else float(rng.choice((-1.0, 1.0)))
        thrust = case.plant.full_thrust_v / case.plant.inertia
        return {"push_m_s2": sign * (thrust + rng.uniform(low, high)), "push_s": push_s}

    return draw


def _shove(rng: np.random.Generator, case: Setting) -> Numbers:
    """Draw a push that the motor cannot hold, and that does not make the axis too fast before."""
    slow = case.limits.error_filter_s > 0.005
    low, high, push_s = (15.0, 22.0, 0.036) if slow else (40.0, 80.0, 0.012)
    return _push(low, high, push_s, side=-1.0)(rng, case)


def _knock(rng: np.random.Generator, case: Setting) -> Numbers:
    """Draw a push for two milliseconds that moves the axis by less than half of what it may."""
    push = rng.uniform(0.2, 0.5) * case.limits.error_minimum_m / (2e-3) ** 2
    return {"push_m_s2": float(min(push, 60.0) * rng.choice((-1.0, 1.0))), "push_s": 2e-3}


def _overload(rng: np.random.Generator, case: Setting) -> Numbers:
    """Draw a push that is a little more than the motor's full thrust."""
    excess = rng.uniform(0.6, 1.2) / case.plant.inertia
    thrust = case.plant.full_thrust_v / case.plant.inertia
    sign = float(rng.choice((-1.0, 1.0)))
    return {"push_m_s2": sign * (thrust + excess), "push_s": 0.2, "time_s": 0.05}


def _heat(rng: np.random.Generator, case: Setting) -> Numbers:
    force = rng.uniform(2.0, 3.0)
    sign = float(rng.choice((-1.0, 1.0)))
    return {
        "push_m_s2": sign * force / case.plant.inertia,
        "push_s": 0.5,
        "continuous_v": 1.0,
        "constant_s": 0.5,
    }


def _search(_rng: np.random.Generator, _case: Setting) -> Numbers:
    """Return the way from where the stage starts, 0.03 m, to its limit switch at -0.1 m."""
    return {"search_m_s": 0.05, "to_limit_m": 0.13}


def _pause(rng: np.random.Generator, case: Setting) -> Numbers:
    """Draw a pause of more than 0.1 s."""
    return {"skipped": float(round(case.limits.ticks(rng.uniform(0.102, 0.25))))}


def _short_pause(rng: np.random.Generator, _case: Setting) -> Numbers:
    return {"skipped": float(rng.integers(1, 4))}


def _patient(_drawn: Numbers) -> dict[str, Any]:
    """Return limits of an axis that may be far from its reference, and stand still."""
    return {
        "limits": {"following_error": {"minimum_m": 0.05}},
        "guards": {"encoder_stuck": None},
    }


def _behind(case: Setting) -> DeviceFault:
    bit = Status.LIMIT_NEGATIVE if case.direction > 0 else Status.LIMIT_POSITIVE
    return DeviceFault(bits=int(bit))


FAULTS: Mapping[str, FaultKind] = {
    "encoder_lost": FaultKind(
        "the encoder's signal is lost, the driver says so",
        EVERY,
        device=reports(Status.ENCODER_LOST, freezes=True),
    ),
    "amplifier_fault": FaultKind(
        "the amplifier reports a fault and switches off",
        EVERY,
        device=reports(Status.AMPLIFIER_FAULT, off=True),
    ),
    "estop": FaultKind(
        "the emergency-stop chain opens", EVERY, device=reports(Status.ESTOP, off=True)
    ),
    "device_lost": FaultKind(
        "the device is lost, the driver says so",
        EVERY,
        device=reports(Status.COMMUNICATION_LOST, freezes=True, off=True),
    ),
    "encoder_blinks": FaultKind(
        "the encoder's signal is lost for one sample",
        ENABLED,
        device=reports(Status.ENCODER_LOST, once=True),
    ),
    "silence": FaultKind(
        "no new sample comes any more",
        ENABLED,
        device=reports(Status.STALE, freezes=True),
    ),
    "short_silence": FaultKind(
        "as many samples are missing as may be", ("hold", "cruise", "dwell")
    ),
    "encoder_jump": FaultKind(
        "the count jumps, for good",
        (*ENABLED, "stop", "reaction"),
        draw=jump,
        device=lambda case: DeviceFault(offset_counts=shift(case)),
    ),
    "encoder_glitch": FaultKind(
        "one sample is far off",
        ENABLED,
        draw=jump,
        device=lambda case: DeviceFault(offset_counts=shift(case), once=True),
    ),
    "encoder_stuck": FaultKind(
        "the count stands still, nobody says so",
        ("hold", *MOVING),
        device=lambda _case: DeviceFault(freezes=True),
    ),
    "encoder_noise": FaultKind(
        "the count trembles",
        ("hold", "dwell"),
        TWO,
        draw=_noise,
        device=lambda case: DeviceFault(noise_counts=case.drawn["noise_m"] / case.limits.count_m),
        axis_keys=lambda drawn: {
            "guards": {
                "encoder_noise": {"rms_m": drawn["rms_m"], "filter_time_s": drawn["filter_s"]}
            }
        },
    ),
    "limit_switch": FaultKind(
        "the limit switch ahead is pressed",
        MOVING,
        guard="limit_switch",
        reactions=BOTH,
        device=ahead,
    ),
    "limit_switch_behind": FaultKind(
        "the limit switch behind is pressed", ("cruise",), device=_behind
    ),
    "limit_switch_at_rest": FaultKind(
        "a limit switch is pressed at rest", ("hold", "dwell"), device=ahead
    ),
    "dead_output": FaultKind(
        "the output stage gives nothing, nobody says so",
        ("cruise",),
        TWO,
        clean=True,
        device=lambda _case: DeviceFault(gain=0.0),
    ),
    "reversed_motor": FaultKind(
        "the motor pulls the other way",
        ("cruise",),
        TWO,
        clean=True,
        device=lambda _case: DeviceFault(gain=-1.0),
    ),
    "full_output": FaultKind(
        "the output stage gives its full voltage: runaway",
        ("hold", "cruise", "dwell"),
        TWO,
        clean=True,
        draw=lambda rng, _case: {"output_v": float(rng.choice((-10.0, 10.0)))},
        device=lambda case: DeviceFault(output_v=case.drawn["output_v"]),
    ),
    "shove": FaultKind(
        "a push that the motor cannot hold",
        ("hold", "cruise", "dwell"),
        TWO,
        "following_error",
        BOTH,
        clean=True,
        draw=_shove,
        pushes=True,
    ),
    "knock": FaultKind(
        "a short push", ("hold", "cruise", "dwell"), TWO, clean=True, draw=_knock, pushes=True
    ),
    "push_too_fast": FaultKind(
        "a push makes the axis too fast",
        ("cruise",),
        TWO,
        "overspeed",
        BOTH,
        clean=True,
        draw=_push(110.0, 140.0, 0.016, side=1.0),
        axis_keys=lambda _drawn: {"limits": {"max_velocity_m_s": 0.7}},
        pushes=True,
    ),
    "push_out_of_travel": FaultKind(
        "a push carries the axis out of its travel",
        ("end",),
        TWO,
        "soft_limit",
        BOTH,
        clean=True,
        draw=_push(40.0, 80.0, 0.02, side=1.0),
        pushes=True,
    ),
    "overload": FaultKind(
        "a load that the full command does not move",
        ("hold",),
        TWO,
        "saturation",
        BOTH,
        clean=True,
        draw=_overload,
        axis_keys=lambda drawn: {
            **_patient(drawn),
            "guards": {"encoder_stuck": None, "saturation": {"time_s": drawn["time_s"]}},
        },
        pushes=True,
    ),
    "overheating": FaultKind(
        "a load beyond the motor's continuous force",
        ("hold",),
        TWO,
        "thermal",
        ("quick_stop", "disable"),
        clean=True,
        draw=_heat,
        axis_keys=lambda drawn: {
            "guards": {
                "saturation": None,
                "thermal": {
                    "continuous_voltage_v": drawn["continuous_v"],
                    "time_constant_s": drawn["constant_s"],
                },
            },
        },
        pushes=True,
    ),
    "obstacle": FaultKind("the carriage runs against an obstacle", ("cruise",), TWO, clean=True),
    "host_pause": FaultKind(
        "the computer stands still for more than 0.1 s",
        ENABLED,
        guard="host_frozen",
        reactions=BOTH,
        draw=_pause,
    ),
    "short_pause": FaultKind(
        "the computer skips one to three periods", ("hold", "cruise", "dwell"), draw=_short_pause
    ),
    "late_ticks": FaultKind(
        "ten ticks in a row overrun",
        ENABLED,
        guard="late_ticks",
        reactions=("quick_stop", "disable"),
        top_keys={"loop": {"overrun_policy": "leaky_bucket", "bucket_size": 10}},
    ),
    "late_now_and_then": FaultKind(
        "every other tick overruns",
        ("cruise",),
        top_keys={"loop": {"overrun_policy": "leaky_bucket", "bucket_size": 10}},
    ),
    "supervisor_dead": FaultKind(
        "the supervisor gives no sign of life",
        ENABLED,
        guard="supervisor_lost",
        reactions=("quick_stop", "disable"),
        restarts=False,
    ),
    "supervisor_slow": FaultKind("the supervisor is silent for 0.45 s", ("hold", "cruise")),
    "estop_command": FaultKind("`motorctl estop`", EVERY),
    "learned_nan": FaultKind("a learned parameter is no number", ("start",), restarts=False),
    "law_nan": FaultKind("the law computes no number", ("cruise",), ("gantry",), restarts=False),
    "no_home_switch": FaultKind(
        "the home switch is never seen",
        ("search",),
        ("stage",),
        draw=_search,
        device=lambda _case: DeviceFault(masks=int(Status.HOME_SWITCH)),
    ),
    **END_FAULTS,
}
