"""Plan motion for axes at rest: a move, or the approach to a program and the program."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from motorctl.config.analysis import required_command
from motorctl.config.learned_file import look_up
from motorctl.config.machine import Axis, Machine
from motorctl.config.programs import mixed_kinds
from motorctl.errors import UsageError
from motorctl.loop.layout import PROGRAM_SEGMENTS
from motorctl.loop.learned_feedforward import LearnedFeedforward
from motorctl.loop.shared import LoopMemory
from motorctl.motion import (
    PointToPoint,
    Program,
    Trajectory,
    check_program,
    point_to_point,
)
from motorctl.motion.program import LEAST

UNASKED_SPEED = 0.25
"""Share of the top speed of a move that names none, and of the way to a program [1]."""


def plan_move(
    machine: Machine,
    axis_name: str,
    from_m: float,
    to_m: float,
    velocity_m_s: float | None = None,
    acceleration_m_s2: float | None = None,
) -> Trajectory:
    """Plan a move from rest to rest; an axis outside its travel may be moved back into it.

    Parameters
    ----------
    machine
        Whose limits hold.
    axis_name
        The axis that moves.
    from_m, to_m
        Where it stands and where it shall come to rest [m].
    velocity_m_s, acceleration_m_s2
        Lower limits for this move [m/s, m/s^2]; None: UNASKED_SPEED of the axis' velocity, the
        acceleration of its stop ramp.

    Raises
    ------
    UsageError
        Where the target or a limit is beyond the axis' own; it names value and limit.
    """
    axis = machine.axes[axis_name]
    for key, value, unit in (
        ("max_velocity_m_s", velocity_m_s, "m/s"),
        ("max_acceleration_m_s2", acceleration_m_s2, "m/s^2"),
    ):
        limit: float = getattr(axis.limits, key)
        if value is not None and not LEAST < value <= limit:
            own = axis.units.words(unit)
            raise UsageError(
                f"{key.split('_')[1]} {value:g} {own}: must be above {LEAST:g} and at most "
                f"{limit:g} {own}, limits.{key}"
            )
    move = PointToPoint(
        name="move",
        axis=axis_name,
        start_m=from_m,
        target_m=to_m,
        max_velocity_m_s=velocity_m_s or UNASKED_SPEED * axis.limits.max_velocity_m_s,
        max_acceleration_m_s2=acceleration_m_s2 or _approach_acceleration(axis),
        max_jerk_m_s3=_approach_jerk(axis),
    )
    low, high = axis.limits.travel_m
    if not low <= to_m <= high:
        raise UsageError(
            axis.units.words(
                f"target {to_m:g} m: must lie within the travel {low:g} to {high:g} m, "
                "limits.travel_m"
            )
        )
    _check(machine, move, from_m)
    return move.trajectories()[axis_name]


@dataclass(frozen=True)
class ProgramPlan:
    """A program as its axes will follow it."""

    trajectories: dict[str, Trajectory]
    """Of each axis the approach, a wait, and the program with all its cycles: as long as that of
    every other one."""
    approach_s: float
    """When the program itself begins."""
    period_s: float | None
    """Duration of one cycle where the program is periodic."""
    learned: dict[str, LearnedFeedforward] = field(default_factory=dict)
    """By axis: what is added meanwhile."""
    notes: tuple[str, ...] = ()
    """Why what was learned is not used, a sentence each."""

    @property
    def duration_s(self) -> float:
        """Approach and program together."""
        return max(trajectory.duration_s for trajectory in self.trajectories.values())


def plan_program(
    machine: Machine,
    program: Program,
    references_m: Mapping[str, float],
    learned_files: Mapping[str, Path] | None = None,
    models_row: int | None = None,
) -> ProgramPlan:
    """Plan the approach from where the axes stand, then the program with all its cycles.

    Where the program moves several axes, those that arrive first wait, so that all begin it in
    the same tick. A long list of moves takes seconds: whoever must not wait calls it in a thread,
    and asks the program itself for no motion.

    Parameters
    ----------
    machine
        Whose limits hold.
    program
        What to follow.
    references_m
        Where each of the program's axes stands [m].
    learned_files
        Where axes that learn have what they learned; else as the configuration says.
    models_row
        The loop's, of the machine's models; None: those that run.

    Returns
    -------
    ProgramPlan
        What each axis follows.

    Raises
    ------
    UsageError
        Where a limit would be exceeded, or the program has too many segments.
    """
    _check(machine, program)  # before the approach, so that messages speak of the program itself
    motions = program.trajectories()
    approaches = {
        name: plan_approach(machine.axes[name], references_m[name], motion.start_m)
        for name, motion in motions.items()
    }
    longest = max(approach.duration_s for approach in approaches.values())
    plans = {}
    for name, motion in motions.items():
        wait = longest - approaches[name].duration_s
        plans[name] = approaches[name].hold(wait).then(motion)
        needed = len(plans[name].segments)
        if needed > PROGRAM_SEGMENTS:
            raise UsageError(
                f"program '{program.name}' needs {needed} segments for axis {name}; "
                f"limit {PROGRAM_SEGMENTS}. Use fewer cycles or fewer points"
            )
    for name, approach in approaches.items():
        _check(machine, _Approach(program.name, name, approach), references_m[name])
    learned, notes = _learned(machine, program, longest, learned_files or {}, models_row)
    return ProgramPlan(plans, longest, program.period_s, learned, notes)


def _learned(
    machine: Machine,
    program: Program,
    lead_s: float,
    files: Mapping[str, Path],
    models_row: int | None,
) -> tuple[dict[str, LearnedFeedforward], tuple[str, ...]]:
    """Return what axes of a program have learned for it, and why what is there is not used."""
    learned, notes = {}, []
    for name in program.axes:
        looked = look_up(machine, name, program, files.get(name))
        if looked.why_not:
            notes.append(looked.why_not)
        if (entry := looked.entry) is not None:
            cycle = entry.values, lead_s, entry.period_s, program.cycles
            learned[name] = LearnedFeedforward(*cycle, models_row)
    return learned, tuple(notes)


def load_plan(memory: LoopMemory, axes: Sequence[str], plan: ProgramPlan) -> dict[str, int]:
    """Write a plan into the loop's program slots; return which slot each axis has.

    axes are all of the machine's, in their order.
    """
    return {
        name: memory.load_program(axes.index(name), path.segments, plan.learned.get(name))
        for name, path in plan.trajectories.items()
    }


@dataclass(frozen=True)
class _Approach:
    """The way to a program's start, as a program that can be checked."""

    program: str
    axis: str
    trajectory: Trajectory
    cycles: int = 1
    period_s: float | None = None

    @property
    def name(self) -> str:
        return f"approach to {self.program}"

    @property
    def axes(self) -> tuple[str, ...]:
        return (self.axis,)

    def trajectories(self) -> dict[str, Trajectory]:
        return {self.axis: self.trajectory}


def plan_approach(axis: Axis, from_m: float, to_m: float) -> Trajectory:
    """Plan the move to a program's start: nobody drew it, so it is slow and gentle.

    It keeps to the shares of `experiments`, where the axis has them: a motion that is allowed
    shall not fail by the way to its start.
    """
    limits, allowed = axis.limits, axis.experiments
    speed_share, acceleration = UNASKED_SPEED, _approach_acceleration(axis)
    if allowed is not None:
        speed_share = min(speed_share, allowed.max_velocity_share)
        most = allowed.max_acceleration_share * limits.max_acceleration_m_s2
        acceleration = min(acceleration, most)
    speed = speed_share * limits.max_velocity_m_s
    return point_to_point(from_m, to_m, speed, acceleration, _approach_jerk(axis))


def _approach_acceleration(axis: Axis) -> float:
    return min(axis.limits.stop.acceleration_m_s2, axis.limits.max_acceleration_m_s2)


def _approach_jerk(axis: Axis) -> float:
    return min(axis.limits.stop.jerk_m_s3, axis.limits.max_jerk_m_s3)


def _check(machine: Machine, program: Program, from_m: float | None = None) -> None:
    if why_not := mixed_kinds(program, {name: a.units for name, a in machine.axes.items()}):
        raise UsageError(f"program '{program.name}': {why_not}")
    limits, voltages = {}, {}
    for name, axis in machine.axes.items():
        low, high = axis.limits.travel_m
        if from_m is not None:
            low, high = min(low, from_m), max(high, from_m)
        limits[name] = axis.limits.for_motion((low, high))
        if name not in program.axes:
            continue
        need = required_command(axis.model, axis.theta_initial, axis.limits.max_voltage_v)
        voltages[name] = need
    violations = check_program(program, limits, voltages)
    if violations:
        told = (machine.axes[v.axis].units.words(str(v)) for v in violations)
        raise UsageError("\n".join(f"program '{program.name}': {words}" for words in told))
