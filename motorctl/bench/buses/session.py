"""One transport measured: the loop process against the device's, beside the direct simulation."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from motorctl.bench.buses.device import device_running
from motorctl.bench.buses.machines import device_file, direct, machine_on
from motorctl.bench.buses.transports import AXES, Transport
from motorctl.bench.interleave import Progress, part_of
from motorctl.bench.latency.loop_run import run_loop
from motorctl.config.hardware import Exchange, ask_exchange, channels_of, wiring_of
from motorctl.config.machine import Machine
from motorctl.insight.measures import Measures, Timing, measure_axis, measure_timing
from motorctl.log import read_recording
from motorctl.log.sample import SampleFlag
from motorctl.loop.simulation import simulate

DIRECT_SHARE = 0.1
"""Of the progress."""


@dataclass(frozen=True)
class Measured:
    """What one transport showed."""

    transport: Transport
    max_rate_hz: float
    arithmetic: str
    delay_s: float
    over_bus: Mapping[str, Measures]
    direct: Mapping[str, Measures]
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
    """Run C2 over the transport for so long. Raises RunError where it fails or an axis trips."""
    log, beside = folder / "bus.parquet", folder / "direct.parquet"
    with device_running(device_file(transport), folder) as endpoint:
        options = transport.driver(endpoint)
        machine = machine_on(transport, options, 0.0, duration_s)
        exchange = _exchange(machine)
        if exchange.delay_s:
            machine = machine_on(transport, options, exchange.delay_s, duration_s)
        run = run_loop(
            machine, log, duration_s, moving=True, progress=part_of(progress, 0, 1 - DIRECT_SHARE)
        )
    simulate(
        direct(transport, exchange.delay_s, duration_s),
        beside,
        duration_s=duration_s,
        progress=part_of(progress, 1 - DIRECT_SHARE, 1),
    )
    recording, directly = read_recording(log), read_recording(beside)
    flags = [axis.flags for axis in recording.axes.values() if axis.flags is not None]
    held = np.mean([np.mean((flag & SampleFlag.HELD) > 0) for flag in flags])
    assert exchange.budget is not None
    return Measured(
        transport,
        exchange.budget.max_rate_hz,
        exchange.budget.arithmetic,
        exchange.delay_s,
        {name: measure_axis(recording, name).measures for name in AXES},
        {name: measure_axis(directly, name).measures for name in AXES},
        measure_timing(recording),
        float(held),
        run.skipped_periods / max(1, run.last_tick - run.first_tick),
        tuple(run.refusals),
    )


def _exchange(machine: Machine) -> Exchange:
    setup = machine.drivers["gantry"]
    channels = channels_of("gantry", [wiring_of(axis) for axis in machine.axes.values()])
    return ask_exchange(setup, channels, machine.period_s)
