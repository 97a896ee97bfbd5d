"""One transport measured: the loop process against the device's, beside the direct simulation."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from motorctl.config.exchange import Exchange, ask_exchange
from motorctl.config.hardware import channels_of, wirings_of
from motorctl.config.machine import Machine
from motorctl.identify.compare.measures import Measures, Timing, measure_axis, measure_timing
from motorctl.latency.loop_run import run_loop
from motorctl.latency.progress import Progress, part_of
from motorctl.log import Recording, read_recording
from motorctl.log.sample import SampleFlag
from motorctl.loop.simulation import simulate
from motorctl_benchmarks.buses.device import device_running
from motorctl_benchmarks.buses.machines import device_file, direct, machine_on
from motorctl_benchmarks.buses.transports import AXES, Transport

BUS_SHARE, WALL_SHARE = 0.45, 0.45
"""Of the progress."""
SETTLING_PERIODS = 1
"""The gantry behind a bus has rolled into a hollow of its cogging before it is switched on; the
direct one stands where its program begins."""


@dataclass(frozen=True)
class Measured:
    """What one transport showed."""

    transport: Transport
    max_rate_hz: float
    arithmetic: str
    delay_s: float
    over_bus: Mapping[str, Measures]
    direct: Mapping[str, Measures]
    """Without a bus, in virtual time."""
    direct_wall: Mapping[str, Measures]
    """Without a bus, on the wall clock: with the pauses of this computer."""
    timing: Timing
    held_share: float
    """Of the ticks, those that found no new sample."""
    skipped_share: float
    refusals: tuple[str, ...]

    @property
    def used(self) -> float:
        """The rate over the budget's."""
        return self.transport.rate_hz / self.max_rate_hz


def measure_transport(
    transport: Transport, duration_s: float, folder: Path, progress: Progress
) -> Measured:
    """Run C2 over a transport, and the same machine simulated directly beside it.

    Parameters
    ----------
    transport
        The bus to measure.
    duration_s
        Length of each run [s].
    folder
        Where device file and logs are written.
    progress
        Called with the share done, 0 to 1.

    Raises
    ------
    RunError
        A run fails, or an axis trips.
    """
    log, wall, virtual = (folder / f"{name}.parquet" for name in ("bus", "wall", "virtual"))
    with device_running(device_file(transport), folder) as endpoint:
        options = transport.driver(endpoint)
        machine = machine_on(transport, options, 0.0, duration_s)
        exchange = exchange_of(machine)
        if exchange.delay_s:
            machine = machine_on(transport, options, exchange.delay_s, duration_s)
        run = run_loop(
            machine, log, duration_s, moving=True, progress=part_of(progress, 0, BUS_SHARE)
        )
    beside = direct(transport, exchange.delay_s, duration_s)
    run_loop(
        beside,
        wall,
        duration_s,
        moving=True,
        progress=part_of(progress, BUS_SHARE, BUS_SHARE + WALL_SHARE),
    )
    simulate(
        beside,
        virtual,
        duration_s=duration_s,
        progress=part_of(progress, BUS_SHARE + WALL_SHARE, 1),
    )
    recording = read_recording(log)
    flags = [axis.flags for axis in recording.axes.values() if axis.flags is not None]
    held = np.mean([np.mean((flag & SampleFlag.HELD) > 0) for flag in flags])
    assert exchange.budget is not None
    return Measured(
        transport,
        exchange.budget.max_rate_hz,
        exchange.budget.arithmetic,
        exchange.delay_s,
        _measures(recording),
        _measures(read_recording(virtual)),
        _measures(read_recording(wall)),
        measure_timing(recording),
        float(held),
        run.skipped_periods / max(1, run.last_tick - run.first_tick),
        tuple(run.refusals),
    )


def _measures(recording: Recording) -> dict[str, Measures]:
    return {
        name: measure_axis(recording, name, settling_periods=SETTLING_PERIODS).measures
        for name in AXES
    }


def exchange_of(machine: Machine) -> Exchange:
    """Return how the gantry's driver exchanges, and how late its commands act for that."""
    setup = machine.drivers["gantry"]
    channels = channels_of("gantry", wirings_of(machine.axes.values()))
    return ask_exchange(setup, channels, machine.period_s)
