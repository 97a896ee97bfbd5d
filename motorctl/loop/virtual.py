"""A machine in virtual time, in this process: the same tick, as fast as it goes."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from types import TracebackType

import numpy as np
from numpy.typing import NDArray

from motorctl.config.machine import MOST_PARAMETERS, Machine
from motorctl.errors import RunError, UsageError
from motorctl.log.sample import AxisState, FaultCause
from motorctl.loop.excitation import Excitation
from motorctl.loop.faults import fault_message
from motorctl.loop.learned_feedforward import LearnedFeedforward
from motorctl.loop.other_models import other_models
from motorctl.loop.plan import plan_program
from motorctl.loop.runner import VirtualRun
from motorctl.loop.shared import LoopMemory
from motorctl.loop.succession import Succession
from motorctl.loop.tick import Tick
from motorctl.loop.vocabulary import Reply, Verb
from motorctl.motion import Trajectory

Rows = Callable[[NDArray[np.void], NDArray[np.void]], None]
"""Takes ticks (N,) and samples (N, axes) as they come."""

CHUNK_TICKS = 2000
"""Ticks between two looks into the ring."""


def require_virtual_time(machine: Machine) -> None:
    """Raise UsageError where a driver does not support virtual time."""
    for setup in machine.drivers.values():
        if not setup.cls.supports_virtual_time:
            raise UsageError(
                f"driver '{setup.name}' ({setup.type}) does not support virtual time; "
                "`motorctl run` runs it in wall-clock time"
            )


class VirtualMachine:
    """Drives every axis of a machine through virtual time.

    Raises UsageError where a driver does not support virtual time.
    """

    def __init__(
        self,
        machine: Machine,
        on_rows: Rows,
        *,
        learned: Mapping[str, Sequence[float]] | None = None,
    ) -> None:
        require_virtual_time(machine)
        self.machine = machine
        self.names = list(machine.axes)
        self.memory = LoopMemory.create(self.names, MOST_PARAMETERS, machine.rate_hz)
        self.tick = Tick(machine, self.memory, virtual=True, learned=learned)
        self._run = VirtualRun(self.tick)
        self._on_rows = on_rows
        self._turnarounds: list[NDArray[np.float64]] = []
        self.notes: list[str] = []
        """Why what was learned for programs is not used, a sentence each."""

    def __enter__(self) -> VirtualMachine:
        self.tick.open(virtual=True)
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.tick.close()
        self.memory.close()

    @property
    def turnaround_s(self) -> NDArray[np.float64]:
        """Wall-clock times of every tick so far, (ticks, 4): turnaround, read, compute, write."""
        return np.concatenate(self._turnarounds) if self._turnarounds else np.zeros((0, 4))

    @property
    def ticks(self) -> int:
        """Ticks that have passed."""
        return self._run.number

    def advance(self, ticks: int) -> None:
        """Let so many ticks pass and hand on their rows."""
        while ticks > 0:
            chunk = min(ticks, CHUNK_TICKS)
            first = int(self.memory.status["ring_head"][0])
            self._run.advance(chunk)
            last = int(self.memory.status["ring_head"][0])  # a shutdown may end it early
            rows = np.arange(first, last) % self.memory.ring_rows
            self._turnarounds.append(self.tick.measured_s[rows])
            new_ticks, samples, _ = self.memory.drain()
            self._on_rows(new_ticks, samples)
            ticks -= chunk

    def change_models(self, machine: Machine) -> str | None:
        """Let other models take axes over that hold or are off, within a tick.

        Parameters
        ----------
        machine
            The same machine with other models.

        Returns
        -------
        str or None
            Why the old models go on; None where the new ones run.
        """
        succession = Succession(self.tick, other_models(self.machine, machine))
        self.tick.successor = succession
        self.advance(1)
        if succession.outcome.refused is None:
            self.tick, self.machine = succession.after, machine
        return succession.outcome.refused

    def order(
        self, verb: Verb, axis: str, *, slot: int = 0, tick: int = 0, program: int = 0
    ) -> None:
        """Post one command and let the tick pass that takes it.

        Parameters
        ----------
        verb, axis
            What to do, and the name of the axis.
        slot, tick, program
            As of `LoopMemory.post`.

        Raises
        ------
        RunError
            Where the loop refuses it, with the reason.
        """
        index = self.names.index(axis)
        number = self.memory.post(verb, index, slot=slot, tick=tick, program=program)
        self.advance(1)
        reply = self.memory.reply(number)
        if reply != Reply.OK:
            refusal = reply.name.lower().replace("_", " ") if reply else "no answer"
            raise RunError(f"axis {axis}: {verb.name.lower()} refused: {refusal}")

    def start(self) -> None:
        """Enable every axis, and home those that need it."""
        for name in self.names:
            self.order(Verb.START, name)
        for name, axis in self.machine.axes.items():
            if axis.homing.method != "absolute":
                self.order(Verb.HOME, name)
                timeout = round((axis.homing.timeout_s or 0.0) * self.machine.rate_hz)
                self._wait_for(name, AxisState.HOMING, timeout)

    def follow(
        self,
        trajectories: Mapping[str, Trajectory],
        programs: Mapping[str, int] | None = None,
        learned: Mapping[str, LearnedFeedforward] | None = None,
    ) -> None:
        """Let axes follow trajectories from where they stand, all from the same tick on.

        programs has a number for each axis that the axes of one program share, learned what axes
        add meanwhile to their commands.
        """
        tick = int(self.memory.status["tick"][0]) + len(trajectories) + 1
        for name, trajectory in trajectories.items():
            added = (learned or {}).get(name)
            slot = self.memory.load_program(self.names.index(name), trajectory.segments, added)
            program = (programs or {}).get(name, 0)
            self.order(Verb.FOLLOW, name, slot=slot, tick=tick, program=program)

    def excite(self, axis: str, excitation: Excitation) -> None:
        """Begin to excite an axis that holds or follows.

        Raises UsageError where its limits do not allow it, RunError where the loop refuses it.
        """
        limits, period_s = self.machine.axes[axis].limits, self.machine.period_of(axis)
        if problem := excitation.problem(limits, period_s):
            raise UsageError(f"axis {axis}: {problem}")
        if self.state(axis)["excitation_left"] == 0:
            self.memory.load_excitation(self.names.index(axis), excitation)
        self.order(Verb.EXCITE, axis)

    def follow_programs(self, programs: Sequence[str]) -> float:
        """Start the named programs and return how long the longest takes with its approach [s]."""
        trajectories: dict[str, Trajectory] = {}
        numbers: dict[str, int] = {}
        learned: dict[str, LearnedFeedforward] = {}
        for name in programs:
            program = self.machine.programs[name]
            standing = {axis: self.state(axis)["reference_m"] for axis in program.axes}
            plan = plan_program(self.machine, program, standing)
            trajectories |= plan.trajectories
            learned |= plan.learned
            self.notes += plan.notes
            numbers |= dict.fromkeys(program.axes, self.memory.program_number())
        self.follow(trajectories, numbers, learned)
        return max((t.duration_s for t in trajectories.values()), default=0.0)

    def state(self, axis: str) -> np.void:
        """Return the axis' status record."""
        status: np.void = self.memory.axis_status[self.names.index(axis)]
        return status

    def raise_faults(self) -> None:
        """Raise RunError, telling cause, value and limit, where an axis is in FAULT."""
        # An axis that was stopped for its partner says less than the partner.
        statuses = self.memory.axis_status
        named = sorted(
            zip(self.names, statuses, strict=True),
            key=lambda pair: int(pair[1]["fault"]) == FaultCause.PARTNER,
        )
        for name, status in named:
            if status["state"] == AxisState.FAULT:
                cause = FaultCause(int(status["fault"]))
                message = fault_message(
                    cause,
                    float(status["fault_value"]),
                    float(status["fault_limit"]),
                    float(status["fault_time_s"]),
                    period_s=self.machine.period_of(name),
                    status=int(status["fault_status"]),
                    units=self.machine.axes[name].units,
                )
                raise RunError(f"axis {name} tripped ({cause.name.lower()}): {message}")

    def _wait_for(self, axis: str, leaving: AxisState, ticks: int) -> None:
        for _ in range(0, ticks + CHUNK_TICKS, CHUNK_TICKS):
            if self.state(axis)["state"] != leaving:
                break
            self.advance(CHUNK_TICKS)
        self.raise_faults()
