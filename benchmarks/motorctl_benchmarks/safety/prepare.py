"""A drawn case made ready: the machine runs, and the next tick is that of the fault."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from motorctl.log.sample import AxisState
from motorctl.loop import Verb
from motorctl.loop.plan import plan_program
from motorctl.motion import Trajectory, point_to_point
from motorctl_benchmarks.safety.broken_map import ENDS_M
from motorctl_benchmarks.safety.cases import CaseKey
from motorctl_benchmarks.safety.machines import KINDS
from motorctl_benchmarks.safety.plan import (
    ACCELERATION_M_S2,
    DWELL_S,
    HOLD_S,
    JERK_M_S3,
    MOVE_M,
    OBSTACLE_M,
    SEARCH_M_S,
    START_TICK,
    Plan,
)
from motorctl_benchmarks.safety.setting import Limits, Setting
from motorctl_benchmarks.safety.stand import Stand


@dataclass
class Ready:
    """A machine in the state that its fault shall find, a tick before it."""

    key: CaseKey
    stand: Stand
    axis: str
    setting: Setting
    seed: int
    broken: tuple[int, ...]
    """Which of the device's channels the fault meets."""
    move: Trajectory | None = None
    """Begun by the fault's act, where the axis has to move for the fault to show."""

    @property
    def channels(self) -> tuple[int, ...]:
        """Which of the device's channels are the axis'."""
        axis = self.stand.machine.axes[self.axis]
        second = () if axis.dual_drive is None else (axis.dual_drive.channel,)
        return (axis.channel, *second)


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
        made = Ready(key, stand, axis, plan.setting, plan.seed, plan.broken)
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
        back = point_to_point(move.end_m, move.start_m, 0.3, ACCELERATION_M_S2, JERK_M_S3)
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
        while stand.device.places_m[made.channels[0]] < OBSTACLE_M:
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
        first_s = float(
            there[np.argmax(np.abs(move.sample(there)[0] - MOVE_M[key.machine][1]) < 1e-9)]
        )
        return round(limits.ticks(first_s + (0.1 + 0.5 * share) * DWELL_S))
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
    plan = plan_program(machine, program, standing)
    plans, approach_s = plan.trajectories, plan.approach_s
    own = plan.duration_s - approach_s
    begin = stand.follow(plans, together=True)
    tick = begin + round((approach_s + rng.uniform(0.15, 0.6) * own) * machine.rate_hz)
    stand.until(tick - 1)
    made.setting = _on_the_way(made.setting, plans[made.axis], begin, tick, made.setting.limits)
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
