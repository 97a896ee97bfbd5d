"""How long one exchange takes: the drivers' own cost, and round trips to a device's process."""

from __future__ import annotations

import os
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from motorctl.hal import Channel, Driver, Inputs, Outputs, Status, driver_class
from motorctl.latency.figure import Figure, Target
from motorctl.latency.progress import Progress, part_of
from motorctl.loop.realtime import hold_shallow_idle
from motorctl.loop.tick import make_drivers
from motorctl_benchmarks.buses.device import device_running
from motorctl_benchmarks.buses.machines import device_file, machine_on
from motorctl_benchmarks.buses.transports import AXES, Transport, frames, transports

Array = NDArray[np.float64]

EXCHANGES = 4000
WARM_UP = 200
PAUSE_S = 0.3e-3
"""Between two exchanges, as in a loop; without it the device is always awake."""
PATIENCE_S = 0.02
STALE = int(Status.STALE)
CAN_TARGET = Target("value", "<", 60.0)
ROUND_TRIP_TARGET = Target("value", "<", 150.0)


def exchange_figures(progress: Progress) -> tuple[list[Figure], list[str]]:
    """Time write and read of each driver; return figures and notes."""
    figures = _timed("can_virtual", "CAN codec and python-can, virtual", _can_virtual(), CAN_TARGET)
    chosen = {t.name: t for t in transports()}
    for k, (name, title) in enumerate(
        (("serial poll", "serial over a pty, round trip"), ("modbus tcp", "Modbus TCP, round trip"))
    ):
        part = part_of(progress, k / 2, (k + 1) / 2)
        times = _round_trips(chosen[name], part)
        figures += _timed(name.replace(" ", "_"), title, times, ROUND_TRIP_TARGET)
    notes = [
        f"Exchanges: {EXCHANGES} of each, {1e3 * PAUSE_S:g} ms apart; the device is a process of "
        "its own but for CAN virtual, where only the driver's write and read are timed, "
        f"{len(AXES)} axes each."
    ]
    return figures, notes


def _timed(key: str, title: str, times: Array, target: Target) -> list[Figure]:
    median, p99 = np.percentile(1e6 * times, [50, 99])
    return [
        Figure(f"{key}_median", f"{title}: median", float(median), "us", target=target),
        Figure(f"{key}_p99", f"{title}: p99", float(p99), "us"),
    ]


def _can_virtual() -> Array:
    """Time the driver's write and read; the state frame is put on the bus in between."""
    import can

    cls = driver_class("can")
    channel = "motorctl-bench"
    options = cls.Options.model_validate(
        {"interface": "virtual", "channel": channel, "frames": frames()}
    )
    channels = [Channel(axis, k, 0.5e-6, 28, 10.0) for k, axis in enumerate(AXES)]
    driver = cls(options, channels, 2e-4)
    peer = can.Bus(channel, interface="virtual")
    state = can.Message(arbitration_id=0x180, is_extended_id=False, data=bytearray(8))
    inputs, outputs = Inputs(len(AXES)), Outputs(len(AXES))
    times = np.empty(EXCHANGES)
    try:
        driver.prepare()
        peer.send(state)
        _open_beside(driver, lambda: peer.send(state))
        for k in range(-WARM_UP, EXCHANGES):
            state.data[7] = (state.data[7] + 1) & 0xFF
            began = time.perf_counter()
            driver.write(outputs)
            sent = time.perf_counter() - began
            while peer.recv(0) is not None:
                pass
            peer.send(state)
            began = time.perf_counter()
            driver.read(inputs)
            if k >= 0:
                times[k] = sent + time.perf_counter() - began
    finally:
        driver.safe()
        driver.close()
        peer.shutdown()
    return times


def _open_beside(driver: Driver, beat: Callable[[], None]) -> None:
    """Open a driver while something goes on in a thread that it waits for."""
    done = threading.Event()

    def beating() -> None:
        while not done.wait(0.01):
            beat()

    thread = threading.Thread(target=beating)
    thread.start()
    try:
        driver.open()
    finally:
        done.set()
        thread.join()


@contextmanager
def _shallow_idle() -> Iterator[None]:
    """Let the CPUs wake as fast as they do beside the loop, where that is allowed."""
    try:
        fd = hold_shallow_idle()
    except OSError:
        yield
        return
    try:
        yield
    finally:
        os.close(fd)


def _round_trips(transport: Transport, progress: Progress) -> Array:
    """Time from asking to a fresh sample, the device in a process of its own."""
    times = np.empty(EXCHANGES)
    inputs, outputs = Inputs(len(AXES)), Outputs(len(AXES))
    with (
        _shallow_idle(),
        tempfile.TemporaryDirectory(prefix="motorctl-") as folder,
        device_running(device_file(transport), Path(folder)) as endpoint,
    ):
        machine = machine_on(transport, transport.driver(endpoint), 0.0, 1.0)
        driver = make_drivers(machine)["gantry"]
        driver.prepare()
        driver.open()
        try:
            for k in range(-WARM_UP, EXCHANGES):
                time.sleep(PAUSE_S)
                began = time.perf_counter()
                if driver.exchange_delay_periods:
                    driver.write(outputs)
                driver.read(inputs)
                while inputs.status[0] & STALE and time.perf_counter() - began < PATIENCE_S:
                    driver.read(inputs)
                if k >= 0:
                    times[k] = time.perf_counter() - began
                    progress((k + 1) / EXCHANGES)
        finally:
            driver.safe()
            driver.close()
    return times
