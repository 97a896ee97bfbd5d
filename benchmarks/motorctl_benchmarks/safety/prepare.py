"""A case made ready: the machine, the motion, and the tick in which the fault begins."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from motorctl.config.machine import Machine
from motorctl.log.sample import AxisState
from motorctl.loop import Verb
from motorctl.loop.plan import plan_program
from motorctl.motion import Trajectory, point_to_point
from motorctl_benchmarks.buses.transports import merged
from motorctl_benchmarks.safety.broken_map import ENDS_M
from motorctl_benchmarks.safety.cases import ONE_AXIS, CaseKey
from motorctl_benchmarks.safety.machines import KINDS, machine_of, resolved
from motorctl_benchmarks.safety.setting import Limits, Plant, Setting
from motorctl_benchmarks.safety.stand import Stand
from motorctl_sim import SimOptions

START_TICK = 10
HOLD_S = 0.1
"""From the start to the motion, or about to the fault at rest."""
MOVE_M = {"gantry": (0.02, 0.40), "serial": (0.02, 0.40), "modbus": (0.02, 0.40), "stage": (-0.06, 0.06)}
ACCELERATION_M_S2, JERK_M_S3 = 8.0, 800.0
SPEEDS_M_S = {"gantry": (0.25, 0.6), "serial": (0.25, 0.5), "modbus": (0.25, 0.5), "stage": (0.2, 0.4)}
SEARCH_M_S = -0.05
DWELL_S = 0.4
NEAR_END_M = 0.2e-3
STAGE_START_M = -0.07
"""Near its index mark, so that homing is short where it is not what is tried."""
OBSTACLE_M = 0.22


@dataclass
class Ready:
    """A machine in the state that its fault shall find, a tick before it."""

    key: CaseKey
    stand: Stand
    axis: str
    setting: Setting
    seed: int
    move: Trajectory | None = None
    """Begun by the fault's act, where the axis has to move for the fault to show."""

    @property
    def channel(self) -> int:
        """Which of the device's channels is the axis'."""
        return self.stand.machine.axes[self.axis].channel


@dataclass(frozen=True)
class Plan:
    """A case as drawn, before there is a machine."""

    key: CaseKey
    axis: str
    machine: Machine
    setting: Setting
    move: Trajectory | None
    """Nominal: from the exact place."""
    fault_tick: int | None
    """Where it is known before."""
    seed: int


def draw(key: CaseKey) -> Plan:
    """Draw a case from its key."""
    rng = key.random()
    data = resolved(KINDS[key.machine].config, key.controller)
    axis = str(rng.choice(list(data["axes"])))
    keys = data["axes"][axis]
    if key.fault == "law_nan":
        axis = "x"
    direction = int(rng.choice((-1, 1)))
    if key.fault in ("obstacle", "law_nan") or key.machine == ONE_AXIS:
        direction = 1
    (driver,) = data["drivers"].values()
    limits = limits_of(keys, data["rate_hz"], driver)
    of = KINDS[key.machine]
    sim = SimOptions.model_validate({"preset": of.clean or of.plant})
    setting = Setting(
        key.fault, key.state, limits, plant_of(sim, keys["channel"]), direction, 0.0, lambda _: 0.0
    )
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
    return _planned(key, axis, setting, start, move, tick, rng)


def _planned(
    key: CaseKey,
    axis: str,
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
        broken = {"type": "motorctl_benchmarks.safety.broken_map:BrokenMap", "initial": 0.0}
        keys = merged(keys, {"model": {"broken_map": broken}})
    top = dict(key.kind.top_keys)
    if key.state == "reaction":
        top = merged(top, {"loop": {"overrun_policy": "stop"}})
    data = resolved(KINDS[key.machine].config, key.controller)
    changes = {name: keys if name == axis else {} for name in data["axes"]}
    if key.kind.guard in ("host_frozen", "late_ticks", "supervisor_lost"):
        changes = dict.fromkeys(data["axes"], keys)
    channel = data["axes"][axis]["channel"]
    plant: dict[str, Any] = {"initial_position_m": start}
    if key.machine == ONE_AXIS:
        plant = {} if key.state in ("homing", "search") else {"initial_position_m": STAGE_START_M}
    if key.fault == "obstacle":
        plant["travel_m"] = [-0.07, OBSTACLE_M]
    sim: dict[str, Any] = {"plants": {channel: plant}}
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
    (driver,) = machine.resolved["drivers"].values()
    limits = limits_of(machine.resolved["axes"][axis], machine.rate_hz, driver)
    options = next(iter(machine.drivers.values())).options
    assert isinstance(options, SimOptions)
    own = plant_of(options, channel)
    drawn = dict(setting.drawn)
    if key.fault == "obstacle":
        end = options.plant(channel).end_stop
        drawn["rubber_rad_s"] = (end.stiffness_v_m / own.inertia) ** 0.5
    setting = replace(setting, limits=limits, plant=own, drawn=drawn)
    return Plan(key, axis, machine, setting, move, tick, seed)


def _fault_tick(
    key: CaseKey, limits: Limits, move: Trajectory, speed: float, share: float
) -> int | None:
    """Return the tick in which the fault begins; None where that shows as the machine runs."""
    if key.machine == ONE_AXIS or key.state in ("ring", "reaction", "stop"):
        return None
    held = START_TICK + round(limits.ticks(HOLD_S))
    if key.state not in ("cruise", "accelerate", "dwell"):
        return held + 2 + round(100 * share)
    begin = held + 3
    ramp_s = speed / ACCELERATION_M_S2 + ACCELERATION_M_S2 / JERK_M_S3
    after_s = {
        "accelerate": (0.3 + share) * ramp_s,
        "cruise": ramp_s + share * (move.duration_s - 2.0 * ramp_s),
        "dwell": move.duration_s + (0.2 + share) * DWELL_S,
    }[key.state]
    return begin + round(limits.ticks(after_s))


@contextmanager
def ready(plan: Plan) -> Iterator[Ready]:
    """Bring a machine into the state that the fault shall find; the next tick is the fault's."""
    key, axis = plan.key, plan.axis
    learned = None
    if key.fault == "learned_nan":
        count = len(plan.machine.axes[axis].model.parameter_names)
        learned = {axis: [float("nan")] * count}
    with (
        tempfile.TemporaryDirectory(prefix="motorctl-campaign-") as folder,
        Stand(plan.machine, Path(folder) / "case.parquet", learned) as stand,
    ):
        made = Ready(key, stand, axis, plan.setting, plan.seed)
        stand.until(START_TICK - 1)
        _bring(plan, made)
        yield made


def _bring(plan: Plan, made: Ready) -> None:
    stand, key, axis = made.stand, plan.key, plan.axis
    rng = np.random.default_rng(plan.seed)
    limits = plan.setting.limits
    held = START_TICK + round(limits.ticks(HOLD_S))
    state = key.state
    if state in ("off", "start"):
        stand.until(held)
        return
    for name in stand.names:
        if KINDS[key.machine].homes:
            _home(plan, made, rng)
        else:
            stand.order(Verb.START, name)
    if state in ("homing", "search"):
        return
    if not KINDS[key.machine].homes:
        stand.until(held)
    if state == "fault":
        stand.order(Verb.ESTOP, axis)
        stand.advance(round(limits.ticks(0.05)))
        return
    if state in ("hold", "end"):
        if plan.fault_tick is not None:
            stand.until(plan.fault_tick - 1)
        _at_rest(made)
        if key.fault == "encoder_stuck":  # nobody can see it before the axis moves
            made.move, begin = _move(plan, stand), stand.number + 3
            made.setting = _on_the_way(made.setting, made.move, begin, begin, limits)
        return
    if state == "ring":
        _ring(made, rng)
        return
    move = _move(plan, stand)
    if state == "dwell":
        back = point_to_point(
            move.end_m, move.start_m, 0.3, ACCELERATION_M_S2, JERK_M_S3
        )
        move = move.hold(DWELL_S).then(back)
    begin = stand.follow({axis: move})
    tick = plan.fault_tick
    if tick is None:
        nominal = _fault_tick_on(key, limits, move, made, rng)
        tick = begin + nominal
    if key.fault == "law_nan":
        ticks = np.arange(0, round(limits.ticks(move.duration_s)))
        tick = begin + int(np.argmax(move.sample(ticks * limits.period_s)[0] > ENDS_M))
    if key.fault == "obstacle":
        while stand.device.places_m[made.channel] < OBSTACLE_M:
            stand.step()
        tick = stand.number + 1
    stand.until(tick - 1)
    made.setting = _on_the_way(made.setting, move, begin, tick, limits)
    if state == "stop":
        stand.order(Verb.STOP, axis)
        stand.advance(round(limits.ticks(rng.uniform(0.003, 0.01))))
    elif state == "reaction":
        stand.step(overran=True)
        stand.advance(round(limits.ticks(rng.uniform(0.003, 0.01))))


def _fault_tick_on(
    key: CaseKey, limits: Limits, move: Trajectory, made: Ready, rng: np.random.Generator
) -> int:
    speed = float(np.abs(move.sample(np.linspace(0.0, move.duration_s, 400))[1]).max())
    ramp_s = speed / ACCELERATION_M_S2 + ACCELERATION_M_S2 / JERK_M_S3
    share = rng.uniform(0.05, 0.3)
    first_s = move.duration_s
    if key.state == "dwell":
        there = np.linspace(0.0, move.duration_s, 4000)
        first_s = float(there[np.argmax(np.abs(move.sample(there)[0] - MOVE_M[key.machine][1]) < 1e-9)])
        return round(limits.ticks(first_s + (0.2 + share) * DWELL_S))
    if key.state == "accelerate":
        return round(limits.ticks((0.3 + share) * ramp_s))
    return round(limits.ticks(ramp_s + share * (first_s - 2.0 * ramp_s)))


def _move(plan: Plan, stand: Stand) -> Trajectory:
    """Plan the move from where the axis stands; its target and its speed are those drawn."""
    assert plan.move is not None
    here = float(stand.status(plan.axis)["reference_m"])
    there = plan.move.end_m
    speed = plan.move.peaks().max_velocity_m_s
    return point_to_point(here, there, speed, ACCELERATION_M_S2, JERK_M_S3)


def _on_the_way(
    setting: Setting, move: Trajectory, begin: int, tick: int, limits: Limits
) -> Setting:
    def reference(after: int) -> float:
        return float(move.sample(max(0.0, (tick + after - begin) * limits.period_s))[0])

    speed = float(move.sample(max(0.0, (tick - begin) * limits.period_s))[1])
    return replace(setting, reference=reference, speed_m_s=speed)


def _at_rest(made: Ready) -> None:
    here = float(made.stand.status(made.axis)["reference_m"])
    made.setting = replace(made.setting, reference=lambda _after: here)


def _ring(made: Ready, rng: np.random.Generator) -> None:
    stand, machine = made.stand, made.stand.machine
    program = machine.programs["ring"]
    standing = {name: float(stand.status(name)["reference_m"]) for name in program.axes}
    plans = plan_program(machine, program, standing)
    own = next(iter(program.trajectories().values())).duration_s
    approach_s = plans[made.axis].duration_s - own
    begin = stand.follow(plans, together=True)
    tick = begin + round((approach_s + rng.uniform(0.15, 0.6) * own) * machine.rate_hz)
    stand.until(tick - 1)
    made.setting = _on_the_way(
        made.setting, plans[made.axis], begin, tick, made.setting.limits
    )
    made.setting = replace(made.setting, direction=1 if made.setting.speed_m_s > 0 else -1)


def _home(plan: Plan, made: Ready, rng: np.random.Generator) -> None:
    stand, axis, limits = made.stand, plan.axis, plan.setting.limits
    if plan.key.state == "search":
        stand.order(Verb.START, axis)
        stand.advance(round(limits.ticks(HOLD_S)))
        return
    stand.order(Verb.START, axis)
    stand.order(Verb.HOME, axis)
    if plan.key.state == "homing":
        stand.advance(round(limits.ticks(rng.uniform(0.2, 0.8))))
        here = float(stand.status(axis)["reference_m"])
        step = SEARCH_M_S * limits.period_s
        made.setting = replace(
            made.setting,
            direction=-1,
            speed_m_s=SEARCH_M_S,
            reference=lambda after: here + step * (after + 1),
        )
        return
    stand.leave(axis, AxisState.HOMING, 30.0)
    stand.advance(round(limits.ticks(HOLD_S)))


def limits_of(keys: Mapping[str, Any], rate_hz: float, driver: Mapping[str, Any]) -> Limits:
    """Take an axis' numbers from the configuration as plain data."""
    limits, gains = keys["limits"], keys["gains"]
    error, stop = limits["following_error"], limits["stop"]
    late = driver.get("late") or {}
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
    )


def plant_of(options: SimOptions, channel: int) -> Plant:
    """Take a carriage's numbers from the simulated gantry's options."""
    plant = options.plant(channel)
    return Plant(
        plant.inertia_v_s2_m,
        plant.coulomb_friction_v,
        plant.viscous_friction_v_s_m,
        plant.offset_v,
        plant.em_quadratic_1_v,
        plant.em_cubic_1_v2,
    )

