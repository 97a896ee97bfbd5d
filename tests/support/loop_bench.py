"""A bench for tests of the loop: the published gantry in virtual time, changed as a test needs.

Every machine here has the same two lists of effects, so that they share one compiled tick.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from law_bench import multisine
from pydantic import BaseModel

from motorctl.config import load
from motorctl.config.axis_keys import Homing
from motorctl.config.machine import MOST_PARAMETERS, Axis, DriverSetup, Machine
from motorctl.hal import Channel, Driver, DriverOptions, Inputs, Outputs, RateBudget
from motorctl.log.sample import AxisState, FaultCause
from motorctl.loop import LoopMemory, Reply, Verb, VirtualMachine
from motorctl.loop.tick import Tick
from motorctl.motion import Trajectory, point_to_point
from motorctl_sim import SimDriver, SimOptions

TS = 0.2e-3


@cache
def gantry() -> Machine:
    """Return the machine as it is shipped, but as little patient as one of metal."""
    machine = load("published_gantry")
    loop = machine.loop.model_copy(update={"without_realtime": "degrade"})
    return dataclasses.replace(machine, loop=loop)


def changed(part: Any, **changes: Any) -> Any:
    """Return frozen keys with changes, nested ones as keys of changes."""
    for key, value in changes.items():
        before = getattr(part, key)
        if isinstance(value, dict) and isinstance(before, BaseModel):
            changes[key] = changed(before, **value)
    if isinstance(part, BaseModel):
        return part.model_copy(update=changes)
    return dataclasses.replace(part, **changes)


def with_axes(machine: Machine, names: Sequence[str] = ("x", "y"), **changes: Any) -> Machine:
    """Change axes: ``with_axes(machine, ["x"], limits={"max_velocity_m_s": 1.0})``."""
    axes: dict[str, Axis] = {
        name: changed(axis, **changes) if name in names else axis
        for name, axis in machine.axes.items()
    }
    return dataclasses.replace(machine, axes=axes)


def with_sim(machine: Machine, **options: Any) -> Machine:
    """Put the machine on a simulated plant with these options of its driver."""
    data = {"preset": "published_gantry_clean", **options}
    setup = DriverSetup("gantry", "sim", SimDriver, SimOptions.model_validate(data))
    return dataclasses.replace(machine, drivers={"gantry": setup})


def with_driver(machine: Machine, cls: type[Driver]) -> Machine:
    """Put the machine on a driver of the test's own."""
    setup = DriverSetup("gantry", "own", cls, DriverOptions())
    return dataclasses.replace(machine, drivers={"gantry": setup})


def homed_by(method: str, **values: Any) -> Homing:
    """Describe homing towards the negative end."""
    usual = {
        "search_velocity_m_s": -0.05,
        "latch_velocity_m_s": 0.01,
        "home_position_m": 0.0,
        "timeout_s": 20.0,
    }
    return Homing(method=method, **usual | values)


class Still(Driver):
    """A device whose counts stand where the test puts them; keeps what was written."""

    supports_virtual_time = True

    def __init__(
        self, options: DriverOptions, channels: Sequence[Channel], period_s: float
    ) -> None:
        super().__init__(options, channels, period_s)
        self.counts = np.zeros(len(channels), np.int64)
        self.index_counts = np.zeros(len(channels), np.int64)
        self.status = np.zeros(len(channels), np.uint32)
        self.volts = np.zeros(len(channels))
        self.enable = np.zeros(len(channels), np.uint8)
        self.calls: list[str] = []

    def rate_budget(self) -> RateBudget:
        return RateBudget(1e9, "no bus")

    def open(self) -> None:
        self.calls.append("open")

    def close(self) -> None:
        self.calls.append("close")

    def read(self, inputs: Inputs) -> None:
        inputs.counts[:] = self.counts
        inputs.index_counts[:] = self.index_counts
        inputs.status[:] = self.status

    def write(self, outputs: Outputs) -> None:
        self.volts[:] = outputs.volts
        self.enable[:] = outputs.enable

    def safe(self) -> None:
        self.volts[:] = 0.0
        self.enable[:] = 0
        self.calls.append("safe")

    def start_virtual_time(self) -> None:
        pass

    def advance(self) -> None:
        pass


class Rig(VirtualMachine):
    """A machine in virtual time that keeps its rows."""

    def __init__(self, machine: Machine, **arguments: Any) -> None:
        self.chunks: list[tuple[np.ndarray, np.ndarray]] = []
        super().__init__(machine, lambda *rows: self.chunks.append(rows), **arguments)

    @property
    def driver(self) -> Any:
        """The one driver."""
        return self.tick.drivers["gantry"]

    @property
    def ticks_seen(self) -> np.ndarray:
        """Rows of TICK_SAMPLE (N,)."""
        return np.concatenate([ticks for ticks, _ in self.chunks])

    def rows(self, axis: str) -> np.ndarray:
        """Return all rows of an axis (N,)."""
        number = self.names.index(axis)
        return np.concatenate([samples[:, number] for _, samples in self.chunks])

    def last(self, axis: str) -> np.void:
        """Return the newest row of an axis."""
        return self.chunks[-1][1][-1, self.names.index(axis)]

    def seconds(self, duration_s: float) -> None:
        """Let time pass."""
        self.advance(round(duration_s * self.machine.rate_hz))

    def ask(self, verb: Verb, axis: str = "x", **arguments: int) -> Reply | None:
        """Post a command, and return the answer to it a tick later."""
        number = self.memory.post(verb, self.names.index(axis), **arguments)
        self.advance(1)
        return self.memory.reply(number)

    def state_of(self, axis: str) -> AxisState:
        return AxisState(int(self.state(axis)["state"]))

    def fault_of(self, axis: str) -> FaultCause:
        return FaultCause(int(self.state(axis)["fault"]))

    def move(self, axis: str, to_m: float, velocity_m_s: float = 0.5) -> None:
        """Let an axis begin to move."""
        here = float(self.state(axis)["reference_m"])
        self.follow({axis: point_to_point(here, to_m, velocity_m_s, 5.0, 500.0)})

    def wait_until(self, reached: Callable[[], bool], timeout_s: float = 30.0) -> None:
        """Let time pass until something is so, looking every tenth of a second."""
        for _ in range(round(timeout_s * 10)):
            if reached():
                return
            self.seconds(0.1)
        raise AssertionError("did not come about in time")


class Hand:
    """The tick of the wall clock, moved on by hand; its driver is in virtual time."""

    def __init__(self, machine: Machine) -> None:
        self.names = list(machine.axes)
        self.memory = LoopMemory.create(self.names, MOST_PARAMETERS, machine.rate_hz)
        self.tick = Tick(machine, self.memory)
        self.driver: Any = self.tick.drivers["gantry"]
        self.number = -1
        self.may_end = False
        self.tick.open(virtual=True)

    def __enter__(self) -> Hand:
        return self

    def __exit__(self, *_: object) -> None:
        self.tick.close()
        self.memory.close()

    def step(self, elapsed: int = 1, *, overran: bool = False, beat: bool = True) -> None:
        """Do one tick, `elapsed` periods after the one before."""
        if self.number >= 0:
            for _ in range(elapsed):
                self.driver.advance()
        self.number += elapsed
        if beat:
            self.memory.beat()
        self.may_end = self.tick.step(self.number, elapsed, overran, 0, 0)

    def steps(self, ticks: int, **arguments: Any) -> None:
        """Do several."""
        for _ in range(ticks):
            self.step(**arguments)

    def ask(self, verb: Verb, axis: str = "x", **arguments: int) -> Reply | None:
        """Post a command, and return the answer to it a tick later."""
        number = self.memory.post(verb, self.names.index(axis), **arguments)
        self.step()
        return self.memory.reply(number)

    def follow(self, axis: str, trajectory: Trajectory, tick: int = 0) -> None:
        """Let an axis follow a trajectory, at once or from a tick on."""
        slot = self.memory.load_program(self.names.index(axis), trajectory.segments)
        assert self.ask(Verb.FOLLOW, axis, slot=slot, tick=tick) is Reply.OK

    def status(self, axis: str = "x") -> np.void:
        """Return the status record of an axis."""
        status: np.void = self.memory.axis_status[self.names.index(axis)]
        return status

    def row(self, axis: str = "x") -> np.void:
        """Return the newest row of an axis."""
        newest = (int(self.memory.status["ring_head"][0]) - 1) % self.memory.ring_rows
        row: np.void = self.memory.samples[newest, self.names.index(axis)]
        return row


def random_moves(
    seed: int, duration_s: float, low_m: float, high_m: float, velocity: float, acceleration: float
) -> Trajectory:
    """Join moves between random places at random speeds and accelerations."""
    rng = np.random.default_rng(seed)
    here = low_m
    whole = Trajectory.at_rest(here, 0.05)
    while whole.duration_s < duration_s:
        there = rng.uniform(low_m, high_m)
        v, a = velocity * rng.uniform(0.3, 1.0), acceleration * rng.uniform(0.4, 1.0)
        whole = whole.then(point_to_point(here, there, v, a, a / 0.006)).hold(0.03)
        here = there
    return whole


def rich_points(path: Path, duration_s: float, **peaks_m_s2: float) -> Path:
    """Write points of several sines at once around 0.2 m, from rest to rest, for each axis."""
    period_s = 1e-3
    time_s = np.arange(int(duration_s / period_s)) * period_s
    left = np.minimum(time_s[::-1], 1.0)
    fade_out = left**3 * (10 - 15 * left + 6 * left**2)
    columns = [
        0.2 + fade_out * multisine(duration_s, period_s, peak_m_s2=peak)[:, 0]
        for peak in peaks_m_s2.values()
    ]
    table = np.column_stack([time_s, *columns])
    header = ",".join(["time_s", *(f"{axis}_m" for axis in peaks_m_s2)])
    np.savetxt(path, table, delimiter=",", header=header, comments="")
    return path
