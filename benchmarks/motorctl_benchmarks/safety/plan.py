"""A case as it is drawn from its key: machine, motion, amounts, and when the fault begins."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from motorctl.config.machine import Machine
from motorctl.motion import Trajectory, point_to_point
from motorctl_benchmarks.buses.transports import merged
from motorctl_benchmarks.safety.cases import CaseKey
from motorctl_benchmarks.safety.machines import KINDS, machine_of, plant_options, resolved
from motorctl_benchmarks.safety.setting import Limits, Setting
from motorctl_benchmarks.safety.two_ends import beam_of, plant_of
from motorctl_sim import SimOptions

START_TICK = 10
HOLD_S = 0.1
"""From the start to the motion, or about to the fault at rest."""
MOVE_M = {
    "gantry": (0.02, 0.40),
    "serial": (0.02, 0.40),
    "modbus": (0.02, 0.40),
    "can": (0.02, 0.40),
    "stage": (-0.06, 0.06),
    "dual": (-0.06, 0.40),
}
ACCELERATION_M_S2, JERK_M_S3 = 8.0, 800.0
SPEEDS_M_S = {
    "gantry": (0.25, 0.6),
    "serial": (0.25, 0.5),
    "modbus": (0.25, 0.5),
    "can": (0.25, 0.5),
    "stage": (0.2, 0.4),
    "dual": (0.4, 0.6),
}
SEARCH_M_S = -0.05
DWELL_S = 1.5
NEAR_END_M = 0.2e-3
OBSTACLE_M = 0.22


@dataclass(frozen=True)
class Plan:
    """A case as drawn, before there is a machine."""

    key: CaseKey
    axis: str
    machine: Machine
    setting: Setting
    broken: tuple[int, ...]
    """Which of the device's channels the fault meets: all of the axis', or one end's."""
    move: Trajectory | None
    """Nominal: from the exact place."""
    fault_tick: int | None
    """Where it is known before."""
    seed: int


def draw(key: CaseKey) -> Plan:
    """Draw a case from its key."""
    rng = key.random()
    data: dict[str, Any] = dict(resolved(KINDS[key.machine].config, key.controller))
    axis = str(rng.choice(list(data["axes"])))
    keys = data["axes"][axis]
    if key.fault == "law_nan":
        axis = "x"
    direction = int(rng.choice((-1, 1)))
    if key.fault in ("obstacle", "law_nan") or KINDS[key.machine].homes:
        direction = 1
    (driver,) = data["drivers"].values()
    limits = limits_of(keys, data["rate_hz"], driver)
    sim = SimOptions.model_validate(plant_options(key.machine, clean=True))
    setting = Setting(
        key.fault, key.state, limits, plant_of(sim, keys["channel"]), direction, 0.0, lambda _: 0.0
    )
    broken = channels_of(keys)
    if key.kind.one_end:
        end = int(rng.integers(len(broken)))
        broken = broken[end : end + 1]
        setting = replace(setting, beam=beam_of(sim, keys, end))
    speed = float(rng.uniform(*SPEEDS_M_S[key.machine]))
    share = float(rng.uniform(0.05, 0.3))
    setting = replace(setting, drawn=key.kind.draw(rng, setting))
    low, high = MOVE_M[key.machine]
    start, target = (low, high) if direction > 0 else (high, low)
    if key.state == "end":
        side = 1 if setting.drawn["push_m_s2"] > 0 else 0
        start = limits.travel_m[side] - direction * NEAR_END_M
    if key.fault == "push_too_fast":
        speed = max(speed, 0.5)
    move = point_to_point(start, target, speed, ACCELERATION_M_S2, JERK_M_S3)
    tick = _fault_tick(key, limits, move, speed, share)
    return _planned(key, axis, broken, setting, start, move, tick, rng)


def _planned(
    key: CaseKey,
    axis: str,
    broken: tuple[int, ...],
    setting: Setting,
    start: float,
    move: Trajectory,
    tick: int | None,
    rng: np.random.Generator,
) -> Plan:
    seed = int(rng.integers(1, 2**31))
    keys: dict[str, Any] = {}
    if key.kind.axis_keys is not None:
        keys = dict(key.kind.axis_keys(dict(setting.drawn)))
    if key.reaction:
        keys = merged(keys, {"guards": {key.kind.guard: {"reaction": key.reaction}}})
    if key.fault == "law_nan":
        nan_map = {"type": "motorctl_benchmarks.safety.broken_map:BrokenMap", "initial": 0.0}
        keys = merged(keys, {"model": {"broken_map": nan_map}})
    top = dict(key.kind.top_keys)
    if key.state == "reaction":
        top = merged(top, {"loop": {"overrun_policy": "stop"}})
    data = resolved(KINDS[key.machine].config, key.controller)
    changes = {name: keys if name == axis else {} for name in data["axes"]}
    if key.kind.guard in ("host_frozen", "late_ticks", "supervisor_lost"):
        changes = dict.fromkeys(data["axes"], keys)
    channel = data["axes"][axis]["channel"]
    near_home_m = KINDS[key.machine].near_home_m
    starts = {channel: start} if near_home_m is None else near_home_m
    if near_home_m is not None and key.state in ("homing", "search"):
        starts = {}
    plants: dict[int, Any] = {k: {"initial_position_m": place} for k, place in starts.items()}
    if key.fault == "obstacle":
        plants[channel]["travel_m"] = [-0.07, OBSTACLE_M]
    sim: dict[str, Any] = {"plants": plants}
    if key.kind.pushes and tick is not None:
        sim["faults"] = [
            {
                "kind": "force_step",
                "at_s": tick * setting.limits.period_s,
                "duration_s": setting.drawn["push_s"],
                "channel": channel,
                "force_v": setting.drawn["push_m_s2"] * setting.plant.inertia,
            }
        ]
    machine = machine_of(
        key.machine,
        key.controller,
        seed=seed,
        sim=sim,
        axes=changes,
        top=top,
        programs=("ring",) if key.state == "ring" else (),
        clean=key.kind.clean,
    )
    made: dict[str, Any] = dict(machine.resolved)
    (driver,) = made["drivers"].values()
    limits = limits_of(made["axes"][axis], machine.rate_hz, driver)
    options = next(iter(machine.drivers.values())).options
    assert isinstance(options, SimOptions)
    own = plant_of(options, channel)
    drawn = dict(setting.drawn)
    if key.fault == "obstacle":
        end = options.plant(channel).end_stop
        drawn["rubber_rad_s"] = (end.stiffness_v_m / own.inertia) ** 0.5
    setting = replace(setting, limits=limits, plant=own, drawn=drawn)
    return Plan(key, axis, machine, setting, broken, move, tick, seed)


def _fault_tick(
    key: CaseKey, limits: Limits, move: Trajectory, speed: float, share: float
) -> int | None:
    """Return the tick in which the fault begins; None where that shows as the machine runs."""
    if KINDS[key.machine].homes or key.state in ("ring", "reaction", "stop"):
        return None
    held = START_TICK + round(limits.ticks(HOLD_S))
    if key.state not in ("cruise", "accelerate", "dwell"):
        return held + 2 + round(100 * share)
    begin = held + 3
    ramp_s = speed / ACCELERATION_M_S2 + ACCELERATION_M_S2 / JERK_M_S3
    after_s = {
        "accelerate": (0.3 + share) * ramp_s,
        "cruise": ramp_s + share * (move.duration_s - 2.0 * ramp_s),
        "dwell": move.duration_s + (0.1 + 0.5 * share) * DWELL_S,
    }[key.state]
    return begin + round(limits.ticks(after_s))


def limits_of(keys: Mapping[str, Any], rate_hz: float, driver: Mapping[str, Any]) -> Limits:
    """Take an axis' numbers from the configuration as plain data."""
    limits, gains = keys["limits"], keys["gains"]
    error, stop = limits["following_error"], limits["stop"]
    late = driver.get("late") or {}
    dual = keys.get("dual_drive")
    return Limits(
        period_s=1.0 / rate_hz,
        count_m=keys["encoder"]["resolution_m"],
        counter_bits=keys["encoder"]["counter_bits"],
        top_speed_m_s=limits["max_velocity_m_s"],
        error_minimum_m=error["minimum_m"],
        error_per_velocity_s=error["per_velocity_s"],
        error_filter_s=error["filter_time_s"],
        hold_ticks=late.get("hold_ticks", 3),
        predicts=late.get("predict", False),
        travel_m=tuple(limits["travel_m"]),
        full_v=limits["max_voltage_v"],
        k1_1_s=gains["k1_1_s"],
        ks_v_s_m=gains["ks_v_s_m"],
        stop_acceleration_m_s2=stop["acceleration_m_s2"],
        stop_jerk_m_s3=stop["jerk_m_s3"],
        squaring_m_s=dual["skew"]["squaring_velocity_m_s"] if dual else 0.0,
    )


def channels_of(keys: Mapping[str, Any]) -> tuple[int, ...]:
    """Return the device's channels of an axis: one, or one for each motor of its beam."""
    dual = keys.get("dual_drive")
    return (keys["channel"], dual["channel"]) if dual else (keys["channel"],)
