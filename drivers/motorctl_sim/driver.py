"""The driver of the simulated gantry: the physics behind the doors of `motorctl.hal.Driver`."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from motorctl.hal import (
    LIMIT_SWITCHES,
    Channel,
    Driver,
    DriverOptions,
    FirstAxis,
    FirstOptions,
    FoundDevice,
    Inputs,
    Outputs,
    RateBudget,
    Status,
    Way,
    kernels_cached,
    specialise,
    unseen_limit_switches,
)
from motorctl_sim import compose
from motorctl_sim.first_options import first_options, look
from motorctl_sim.options import SimOptions
from motorctl_sim.pace import Pace
from motorctl_sim.way import way

with kernels_cached():
    from motorctl_sim.physics import advance as physics

# Measured on one core of a virtual machine (1.5 us and 60 ns with the published plants), rounded
# up for slower machines and for more effects.
CALL_COST_S = 2e-6
AXIS_SUBSTEP_COST_S = 0.1e-6
SHARE_OF_PERIOD = 0.25
HIGHEST_RATE_HZ = 20e3


@dataclass(frozen=True)
class TrueState:
    """What no encoder shows, an entry a channel."""

    time_s: float
    position_m: NDArray[np.float64]
    velocity_m_s: NDArray[np.float64]
    acceleration_m_s2: NDArray[np.float64]
    current_v: NDArray[np.float64]
    """The command behind converter, dead zone, delay and lag."""
    thrust_v: NDArray[np.float64]
    """Newtons over the force constant."""


class SimDriver(Driver):
    """A gantry of coupled axes with the effects of real ones; see `SimOptions`.

    In virtual time `advance` lets exactly one period pass, the same for the same seed. On the
    wall clock the plant moves by itself: each `read` catches up by the periods since the last,
    with the voltage of the last `write`.
    """

    Options: ClassVar[type[DriverOptions]] = SimOptions
    supports_virtual_time: ClassVar[bool] = True
    simulated: ClassVar[bool] = True
    watchdog_s: float | None = math.inf

    def __init__(
        self, options: DriverOptions, channels: Sequence[Channel], period_s: float
    ) -> None:
        super().__init__(options, channels, period_s)
        assert isinstance(options, SimOptions)
        self._sim = options
        self._clock = compose.make_clock(options, period_s)
        self._plants = compose.make_plants(options, channels, self._clock)
        self._faults = compose.make_faults(options, channels, period_s)
        self._beams = compose.make_beams(options, channels)
        self._pace = Pace(period_s)
        self._move: Callable[..., None] = physics.advance
        self._deliver: Callable[..., None] = physics.deliver
        self._accept: Callable[..., None] = physics.accept
        self._virtual = False
        self._running = False
        self._reset()

    def _reset(self) -> None:
        self._states = compose.make_states(self._sim, self.channels)

    @classmethod
    def first_options(cls, axes: Sequence[FirstAxis], period_s: float) -> FirstOptions:
        """Return a simulated machine of what is known, and of nothing else."""
        return first_options(axes)

    @classmethod
    def look(cls, options: Mapping[str, Any]) -> FoundDevice:
        """Return the plants that these options make."""
        return look(options)

    def rate_budget(self) -> RateBudget:
        """Compute the rate at which the simulation takes a quarter of the period."""
        axes, substeps = len(self.channels), int(self._clock["substeps"][0])
        cost = CALL_COST_S + axes * substeps * AXIS_SUBSTEP_COST_S
        rate = min(HIGHEST_RATE_HZ, SHARE_OF_PERIOD / cost)
        arithmetic = (
            f"no bus; the simulation itself takes {CALL_COST_S * 1e6:.0f} us + {axes} axes x "
            f"{substeps} substeps x {AXIS_SUBSTEP_COST_S * 1e6:.1f} us = {cost * 1e6:.1f} us a "
            f"period, and may take {SHARE_OF_PERIOD:.0%} of one; at most "
            f"{HIGHEST_RATE_HZ / 1e3:.0f} kHz"
        )
        return RateBudget(rate, arithmetic)

    def problems(self) -> Sequence[tuple[tuple[str | int, ...], str]]:
        """Return which beams end at a channel that no axis uses."""
        numbers = {channel.number for channel in self.channels}
        return [
            (("beams", k, "channels", end), f"found {channel}, which no axis uses")
            for k, beam in enumerate(self._sim.beams)
            for end, channel in enumerate(beam.channels)
            if channel not in numbers
        ]

    def advice(self) -> Sequence[str]:
        """Tell whose plants have no limit switches."""
        plants = {channel.axis: self._sim.plant(channel.number) for channel in self.channels}
        return tuple(
            unseen_limit_switches(
                {
                    axis: LIMIT_SWITCHES if plant.limit_switches_m else ()
                    for axis, plant in plants.items()
                }
            )
        )

    def switches(self) -> Sequence[Status]:
        """Tell which switches and marks the plants have."""
        found = []
        for channel in self.channels:
            plant, told = self._sim.plant(channel.number), Status(0)
            if plant.home_switch:
                told |= Status.HOME_SWITCH
            if plant.encoder.index_marks_m:
                told |= Status.INDEX_LATCHED
            if plant.limit_switches_m:
                told |= Status.LIMIT_NEGATIVE | Status.LIMIT_POSITIVE
            found.append(told)
        return found

    def ways(self) -> Sequence[Way | None]:
        """Tell where the plants' end stops, switches and marks are; none of reversed encoders."""
        plants = [self._sim.plant(channel.number) for channel in self.channels]
        return [None if plant.encoder.reversed else way(plant) for plant in plants]

    def start_virtual_time(self) -> None:
        """Let time pass in `advance` only."""
        self._virtual = True

    def prepare(self) -> None:
        """Compile the physics, or take it from the cache."""
        physics.start(self._clock, self._plants, self._states, self._faults)
        records = (self._clock, self._plants, self._states, self._faults)
        self._move = specialise(physics.advance, *records, self._beams, 0)
        seen, asked = Inputs(len(self.channels)), Outputs(len(self.channels))
        shown = (seen.counts, seen.index_counts, seen.status)
        self._deliver = specialise(physics.deliver, self._states, *shown)
        self._accept = specialise(physics.accept, self._states, asked.volts, asked.enable)

    def open(self) -> None:
        """Power the machine on: time 0, carriages at their places."""
        self._reset()
        self.prepare()
        self._pace.restart()
        self._running = True

    def close(self) -> None:
        """Power the machine off; time stands still."""
        self.safe()
        self._running = False

    def read(self, inputs: Inputs) -> None:
        """Fill `inputs` with what the machine shows now."""
        if self._running and not self._virtual:
            periods = self._pace.periods(time.monotonic_ns())
            self._let_pass(periods)
        self._deliver(self._states, inputs.counts, inputs.index_counts, inputs.status)

    def write(self, outputs: Outputs) -> None:
        """Set the amplifiers' commands, held until the next write."""
        self._accept(self._states, outputs.volts, outputs.enable)

    def safe(self) -> None:
        """Zero and disable every amplifier."""
        self._states["command"] = 0.0
        self._states["enable"] = 0
        self.safe_sent = True

    def advance(self) -> None:
        """Let one period pass in virtual time."""
        self._let_pass(1)

    def _let_pass(self, periods: int) -> None:
        records = (self._clock, self._plants, self._states, self._faults)
        self._move(*records, self._beams, periods)

    def true_state(self) -> TrueState:
        """Return a copy of the true motion, for tests and demonstrations, never for the loop."""
        states = self._states
        return TrueState(
            float(self._clock["tick"][0] * self._clock["period"][0]),
            states["position"].copy(),
            states["velocity"].copy(),
            states["acceleration"].copy(),
            states["current"].copy(),
            states["thrust"].copy(),
        )
