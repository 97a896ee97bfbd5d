"""A real daemon against a device's process over a bus, with faults ordered."""

from __future__ import annotations

import json
import select
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import real_time
import yaml
from daemon_rig import Daemon, bench_config, ended_with_the_tests
from gantry_device_bench import MODBUS
from gantry_device_frames import FRAMES, SYNC_ID
from numpy.typing import NDArray

from motorctl.daemon.client import DaemonRefusedError
from motorctl.log import Recording, read_recording
from motorctl.log.info import LogInfo, describe
from motorctl.log.sample import AxisState, SampleFlag
from motorctl_devices.prompt_ptys import can_be_prompt

Options = dict[str, Any]

AXES = ("x", "y")
HOLD_S = 0.15
"""How long an axis may go without a sample: well above the pauses of a busy machine."""
WATCHDOG_S = 0.25
"""The device's own; well above HOLD_S, so that it is clear who took the volts away."""
SLACK_S = 0.02
"""From an event to its effect at the other end, beside the pauses that both sides measured."""
END_S = 8.0
"""Every process has to end within that."""
MULTICAST = "239.74.163.7"
MAIN = "from motorctl.cli import main; main()"


@dataclass(frozen=True)
class Bus:
    """A transport with the gantry at its other end."""

    name: str
    rate_hz: float
    serve: Callable[[int], Options]
    """Returns the device's key `serve` for a free UDP port."""
    driver: Callable[[str, int], Options]
    """Returns the driver's options for the device's endpoint and the UDP port."""
    counter_bits: int = 32

    @property
    def hold_ticks(self) -> int:
        return round(HOLD_S * self.rate_hz)


def _serial(mode: str) -> Bus:
    def driver(endpoint: str, _port: int) -> Options:
        box = {"port": endpoint, "baud": None, "mode": mode, "watchdog_s": WATCHDOG_S}
        return {"type": "serial", **box}

    return Bus(f"serial {mode}", 250.0, lambda _: {"serial": {}}, driver)


def _can() -> Bus:
    def bus(port: int) -> Options:
        return {"interface": "udp_multicast", "channel": MULTICAST, "port": port, "frames": FRAMES}

    def driver(_endpoint: str, port: int) -> Options:
        sync = {"id": SYNC_ID, "wait_s": 2.4e-3}
        return {"type": "can", **bus(port), "sync": sync, "watchdog_s": WATCHDOG_S}

    def serve(port: int) -> Options:
        return {"can": {**bus(port), "sync": {"id": SYNC_ID}}}

    return Bus("can udp_multicast", 250.0, serve, driver, 24)


def _slcan() -> Bus:
    bus: Options = {"interface": "slcan", "frames": FRAMES}

    def driver(endpoint: str, _port: int) -> Options:
        adapter = {"channel": endpoint.rsplit(maxsplit=1)[-1], "tty_baudrate": 4_000_000}
        sync = {"id": SYNC_ID, "wait_s": 2.4e-3}
        return {"type": "can", **bus, **adapter, "sync": sync, "watchdog_s": WATCHDOG_S}

    return Bus("slcan", 250.0, lambda _: {"can": {**bus, "sync": {"id": SYNC_ID}}}, driver, 24)


def _canopen() -> Bus:
    drives = [{"node": number, "rated_torque_v": 8.0} for number in (1, 2)]

    def bus(port: int) -> Options:
        return {"interface": "udp_multicast", "channel": MULTICAST, "port": port}

    def driver(_endpoint: str, port: int) -> Options:
        nodes = dict(zip(AXES, drives, strict=True))
        sync = {"sync": {"wait_s": 2.4e-3}, "watchdog_s": WATCHDOG_S, "heartbeat_s": 0.1}
        return {"type": "canopen", **bus(port), "nodes": nodes, **sync}

    return Bus("canopen", 250.0, lambda port: {"canopen": {**bus(port), "nodes": drives}}, driver)


def _tcp() -> Bus:
    def driver(endpoint: str, _port: int) -> Options:
        host, _, port = endpoint.rpartition(":")
        return {"type": "modbus", "tcp": {"host": host, "port": int(port)}, **MODBUS}

    return Bus("modbus tcp", 250.0, lambda _: {"modbus": {"tcp": {"port": 0}, **MODBUS}}, driver)


def _rtu() -> Bus:
    def driver(endpoint: str, _port: int) -> Options:
        line = {"port": endpoint, "baud": 1_000_000, "parity": "none"}
        return {"type": "modbus", "rtu": line, **MODBUS}

    return Bus("modbus rtu", 125.0, lambda _: {"modbus": {"rtu": {}, **MODBUS}}, driver)


BUSES = {
    bus.name: bus
    for bus in (
        *(_serial(mode) for mode in ("poll", "exchange", "stream")),
        _can(),
        _slcan(),
        _canopen(),
        _tcp(),
        _rtu(),
    )
}


def device_file(bus: Bus, port: int, faults: Sequence[Options] = ()) -> Options:
    """Return the file of the device at the other end of a bus."""
    channel = {"resolution_m": 0.5e-6, "counter_bits": bus.counter_bits, "max_voltage_v": 10.0}
    return {
        "gantry": {"preset": "published_gantry", "seed": 1},
        "channels": [{"axis": axis, **channel} for axis in AXES],
        "rate_hz": 4 * bus.rate_hz,
        "watchdog_s": WATCHDOG_S,
        "serve": bus.serve(port),
        "faults": list(faults),
    }


def host_file(bus: Bus, options: Options, offsets_m: tuple[float, float] = (0.0, 0.0)) -> str:
    """Return the configuration of two axes that are always on their way."""
    data = yaml.safe_load(bench_config("shuttle", "shuttle_y"))
    data["rate_hz"] = bus.rate_hz
    data["drivers"] = {"gantry": {**options, "late": {"hold_ticks": bus.hold_ticks,
                                                      "predict": True}}}  # fmt: skip
    shuttle = data["programs"]["shuttle"] | {"start_m": 0.0, "distance_m": 0.06, "period_s": 1.52}
    data["programs"] = {"shuttle": shuttle, "shuttle_y": shuttle | {"axis": "y"}}
    for axis, offset_m in zip(data["axes"].values(), offsets_m, strict=True):
        axis["encoder"] |= {"counter_bits": bus.counter_bits, "offset_m": offset_m}
    return yaml.safe_dump(data)


class DeviceProcess:
    """`motorctl gantry-device` in a process of its own."""

    def __init__(self, folder: Path, file: Options, link: Path | None = None) -> None:
        path = folder / "device.yaml"
        path.write_text(yaml.safe_dump(file))
        options = ["--link", str(link)] if link else []
        if can_be_prompt():  # what is ordered shall be the only fault
            options.append("--raise-workers")
        real_time.begins()
        self._process = subprocess.Popen(
            [
                sys.executable,
                "-c",
                ended_with_the_tests(MAIN),
                "gantry-device",
                str(path),
                "--json",
                *options,
            ],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        self.report: dict[str, Any] = {}
        self.ended_in_s = 0.0
        self.endpoint = ""

    def __enter__(self) -> DeviceProcess:
        assert self._process.stderr is not None
        heard, _, _ = select.select([self._process.stderr], [], [], 120.0)
        line = self._process.stderr.readline() if heard else ""
        assert line.startswith("ready: "), (line, self._process.poll())
        self.endpoint = line.removeprefix("ready: ").strip()
        return self

    def __exit__(self, *_: object) -> None:
        if self._process.poll() is None:
            self._process.kill()
        self._process.communicate()

    def end(self) -> None:
        """End it as a user does, and take its report."""
        began = time.monotonic()
        self._process.send_signal(signal.SIGTERM)
        out, errors = self._process.communicate(timeout=END_S)
        self.ended_in_s = time.monotonic() - began
        assert (self._process.returncode, errors) == (0, ""), errors
        self.report = json.loads(out)


@dataclass(frozen=True)
class Outcome:
    """What a run over a bus left behind."""

    bus: Bus
    status: dict[str, Any]
    """As `status` told it before the daemon was ended."""
    said: str
    """On the daemon's standard error."""
    exit_status: int
    ended_in_s: float
    report: dict[str, Any]
    """The device's."""
    log: Recording
    info: LogInfo
    """What `motorctl log info` tells of it."""

    def flag(self, axis: str, flag: SampleFlag) -> NDArray[np.bool_]:
        flags = self.log.axes[axis].flags
        assert flags is not None
        return (flags & int(flag)) > 0

    @property
    def began_s(self) -> float:
        """When an axis was enabled first: the zero of the faults' clock, in the log's time."""
        enabled = np.zeros(len(self.log.time_s), bool)
        for axis in self.log.axes.values():
            assert axis.state is not None
            enabled |= axis.state != AxisState.OFF
        return float(self.log.time_s[np.flatnonzero(enabled)[0]])

    def window(self, begin_s: float, end_s: float) -> slice:
        """Return the rows between two times of the faults' clock."""
        t = self.log.time_s - self.began_s
        first, last = np.searchsorted(t, (begin_s, end_s))
        return slice(int(first), int(last))


def run_with(
    folder: Path,
    bus: Bus,
    faults: Sequence[Options],
    *,
    run_s: float,
    offsets_m: tuple[float, float] = (0.0, 0.0),
) -> Outcome:
    """Move both axes over a bus for `run_s` while faults happen."""
    port = free_port()
    with DeviceProcess(folder, device_file(bus, port, faults)) as device:
        config = host_file(bus, bus.driver(device.endpoint, port), offsets_m)
        with Daemon(folder / "daemon", config) as daemon:
            for axis in AXES:
                start(daemon, axis)
            time.sleep(run_s)
            status = daemon.ask("status")
            began = time.monotonic()
            exit_status = daemon.end()
            ended_in_s = time.monotonic() - began
            said, log = daemon.said, read_recording(daemon.log(), gaps="keep")
            info = describe(daemon.log())
        device.end()
        assert device.ended_in_s < END_S
    return Outcome(bus, status, said, exit_status, ended_in_s, device.report, log, info)


def start(daemon: Daemon, axis: str) -> None:
    """Let an axis follow its program, as soon as it stands."""
    for last in (False, False, True):
        try:
            daemon.ask_when_it_stands("start", axis)
        except DaemonRefusedError as no:
            # A supervisor that got no CPU in time says so.
            if last or not no.args[0].endswith("try again"):
                raise
        else:
            return


def free_port() -> int:
    """Return a UDP port that nobody uses."""
    with closing(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) as free:
        free.bind(("", 0))
        return int(free.getsockname()[1])
