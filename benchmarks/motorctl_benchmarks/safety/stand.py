"""A machine on the test stand: the loop's own tick, moved on by hand in virtual time."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from types import TracebackType
from typing import cast

import numpy as np
from numpy.typing import NDArray

from motorctl.config.machine import MOST_PARAMETERS, Machine
from motorctl.config.metadata import log_metadata
from motorctl.errors import RunError
from motorctl.log import LogAxis, LogWriter, read_recording
from motorctl.log.sample import AxisState
from motorctl.loop import LoopMemory, Reply, Verb
from motorctl.loop.tick import Tick
from motorctl.motion import Trajectory
from motorctl_benchmarks.safety.faulty_gantry import FaultyGantry

DRAIN_TICKS = 1000
"""Between two looks into the ring; it holds several seconds."""
PATIENCE_S = 5.0
"""For an axis to come to rest, or to be found at home; homing has this on top of its timeout."""


class Stand:
    """Steps the tick of the wall clock; the driver is in virtual time, so nothing waits.

    The campaign plays clock and supervisor: it says how many periods passed, whether the last tick
    overran, and whether there was a sign of life. What it sees is what a supervisor sees: status,
    replies, and rows, which are kept in a log where one is asked for.
    """

    def __init__(
        self,
        machine: Machine,
        log: Path | None = None,
        learned: Mapping[str, list[float]] | None = None,
    ) -> None:
        self.machine = machine
        self.names = list(machine.axes)
        self.memory = LoopMemory.create(self.names, MOST_PARAMETERS, machine.rate_hz)
        self._tick = Tick(machine, self.memory, learned=learned)
        (driver,) = self._tick.drivers.values()
        self.device = cast(FaultyGantry, driver)
        self.steps = 0
        self.number = -1
        """Of the last tick."""
        self.keeps_rows = True
        self.ring_lost = 0
        self._chunks: list[NDArray[np.void]] = []
        self._drained = 0
        self._writer = _writer(machine, log) if log is not None else None
        self._log = log
        self._tick.open(virtual=True)

    def __enter__(self) -> Stand:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._tick.close()
        self.memory.close()

    def step(self, elapsed: int = 1, *, overran: bool = False, beat: bool = True) -> bool:
        """Do one tick, `elapsed` periods after the last; return whether the loop may end."""
        if self.number >= 0:
            for _ in range(elapsed):
                self.device.advance()
        self.number += elapsed
        if beat:
            self.memory.beat()
        may_end = self._tick.step(self.number, elapsed, overran, 0, 0)
        self.steps += 1
        if self.steps - self._drained >= DRAIN_TICKS:
            self.drain()
        return may_end

    def advance(self, ticks: int) -> None:
        """Do so many ticks."""
        for _ in range(ticks):
            self.step()

    def until(self, number: int) -> None:
        """Tick until this is the number of the last tick."""
        self.advance(number - self.number)

    def drain(self) -> None:
        """Take the rows from the ring, as the recorder does."""
        ticks, samples, lost = self.memory.drain()
        self.ring_lost += lost
        self._drained = self.steps
        if self._writer is not None:
            self._writer.append(ticks, samples)
        if self.keeps_rows:
            self._chunks.append(samples)

    def rows(self) -> NDArray[np.void]:
        """Return the rows so far, (steps, axes)."""
        self.drain()
        return np.concatenate(self._chunks)

    def rows_lost(self) -> int:
        """Close the log, read it, and return how many ticks have no row in it."""
        self.drain()
        if self._writer is None or self._log is None:
            raise RunError("there is no log")
        self._writer.close()
        kept = len(read_recording(self._log, gaps="keep").time_s)
        self._writer = None
        return self.steps - kept

    def ask(
        self, verb: Verb, axis: str, *, slot: int = 0, tick: int = 0, program: int = 0
    ) -> Reply:
        """Give a command, and return the answer of the tick that took it."""
        index = self.names.index(axis)
        number = self.memory.post(verb, index, slot=slot, tick=tick, program=program)
        self.step()
        reply = self.memory.reply(number)
        if reply is None:
            raise RunError(f"axis {axis}: {verb.name.lower()}: no answer")
        return reply

    def order(self, verb: Verb, axis: str) -> None:
        """Give a command that has to be obeyed. Raises RunError where it is not."""
        reply = self.ask(verb, axis)
        if reply is not Reply.OK:
            raise RunError(f"axis {axis}: {verb.name.lower()}: {reply.name.lower()}")

    def follow(self, trajectories: Mapping[str, Trajectory], *, together: bool = False) -> int:
        """Let axes follow trajectories, and return the tick from which on they do.

        Raises RunError where an axis refuses.
        """
        begin = self.number + len(trajectories) + 2
        program = self.memory.program_number() if together else 0
        for name, trajectory in trajectories.items():
            slot = self.memory.load_program(self.names.index(name), trajectory.segments)
            reply = self.ask(Verb.FOLLOW, name, slot=slot, tick=begin, program=program)
            if reply is not Reply.OK:
                raise RunError(f"axis {name}: follow: {reply.name.lower()}")
        return begin

    def status(self, axis: str) -> np.void:
        """Return the status record of an axis."""
        status: np.void = self.memory.axis_status[self.names.index(axis)]
        return status

    def state(self, axis: str) -> AxisState:
        """Return the state of an axis."""
        return AxisState(int(self.status(axis)["state"]))

    def leave(self, axis: str, state: AxisState, timeout_s: float = PATIENCE_S) -> None:
        """Tick until an axis is in another state. Raises RunError where that takes too long."""
        for _ in range(round(timeout_s * self.machine.rate_hz)):
            if self.state(axis) is not state:
                return
            self.step()
        raise RunError(f"axis {axis} is {state.name.lower()} for more than {timeout_s:g} s")


def _writer(machine: Machine, log: Path) -> LogWriter:
    axes = [LogAxis(name, axis.model.parameter_names) for name, axis in machine.axes.items()]
    return LogWriter(log, log_metadata(machine), axes)
