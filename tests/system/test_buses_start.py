"""`motorctl run` where something is wrong with the device: one clear message, and another try."""

from __future__ import annotations

import os
import struct
import threading
import time
import tty
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from buses_bench import BUSES, Bus, DeviceProcess, device_file, free_port, host_file
from daemon_rig import START_TIMEOUT_S, Daemon
from gantry_device_bench import from_wire, to_wire

from motorctl.config import load
from motorctl.errors import RunError
from motorctl.hal import Status
from motorctl.loop.faults import device_message
from motorctl.loop.tick import make_drivers

pytestmark = [pytest.mark.slow, pytest.mark.wall_clock(lanes=3)]

NOBODY = "/dev/nothing-here"
ABSENT = {
    "serial poll": (NOBODY, f"port {NOBODY}: No such file or directory"),
    "slcan": (NOBODY, f"slcan channel '{NOBODY}' cannot be opened: No such file or directory"),
    "modbus tcp": ("127.0.0.1:1", "tcp.host: cannot connect to 127.0.0.1:1"),
    "modbus rtu": (NOBODY, f"rtu.port: there is no port {NOBODY}"),
    "can udp_multicast": ("", "no state frame 'state' (0x180, 8 B) within open_timeout_s = 1 s"),
}
FEW = ("serial poll", "can udp_multicast")
"""A port that is not there, and a bus on which nobody answers; each driver's own tests have its
words."""


def _refused(folder: Path, config: str) -> str:
    """Return the last line of a daemon that does not start."""
    daemon = Daemon(folder, config)
    with pytest.raises(AssertionError):
        daemon.wait_until_running()
    assert daemon.process.wait(START_TIMEOUT_S) == 1
    assert "Traceback" not in daemon.said
    assert "zeroed" not in daemon.said  # nobody can know
    return daemon.said.strip().splitlines()[-1]


@pytest.mark.parametrize(
    "bus_name", [bus if bus in FEW else pytest.param(bus, marks=pytest.mark.long) for bus in ABSENT]
)
def test_a_device_that_is_not_there_is_one_message_and_exit_status_1(tmp_path, bus_name) -> None:
    bus, (endpoint, words) = BUSES[bus_name], ABSENT[bus_name]
    assert words in _refused(tmp_path, host_file(bus, bus.driver(endpoint, free_port())))


@contextmanager
def _of_another_version() -> Iterator[str]:
    """Yield the port of a box that answers every HELLO with ERROR: versions 2 to 3."""
    master, slave = os.openpty()
    tty.setraw(slave)

    def serve() -> None:
        came, number = b"", 0
        while True:
            came += os.read(master, 4096)
            *frames, came = came.split(b"\0")
            if frames and frames[-1] == b"end":
                return
            for body in (from_wire(frame + b"\0") for frame in frames if frame):
                if body is not None and body[0] == 0x01:
                    fields = struct.pack("<BBBH", 1, 1, body[1], 2 | 3 << 8)
                    os.write(master, to_wire(bytes((0x83, number & 255)) + fields))
                    number += 1

    thread = threading.Thread(target=serve)
    thread.start()
    try:
        yield os.ttyname(slave)
    finally:
        os.write(slave, b"\0end\0")
        thread.join()
        os.close(slave)
        os.close(master)


def test_a_box_that_speaks_another_version_is_one_message(tmp_path) -> None:
    """Of the driver; what a daemon makes of such a message is told above."""
    bus, config = BUSES["serial poll"], tmp_path / "host.yaml"
    with _of_another_version() as port:
        config.write_text(host_file(bus, bus.driver(port, 0)))
        (driver,) = make_drivers(load(config)).values()
        with pytest.raises(RunError) as refused:
            driver.open()
    said = str(refused.value)
    assert "speaks versions 2 to 3 of the protocol, this driver speaks version 1" in said
    assert "\n" not in said


@contextmanager
def _served(folder: Path, bus: Bus, *faults: dict[str, object]) -> Iterator[str]:
    """Serve a device and give the host's configuration, good for a port that comes back too."""
    link = None if bus.name == "modbus tcp" else folder / "link"
    with DeviceProcess(folder, device_file(bus, 0, faults), link) as device:
        yield host_file(bus, bus.driver(str(link or device.endpoint), 0))
        device.end()


@pytest.mark.parametrize(
    ("bus_name", "words"),
    [
        pytest.param("serial poll", "in use by another program", marks=pytest.mark.long),
        ("modbus tcp", "driven by another program on this machine"),
        pytest.param("slcan", "in use by another program", marks=pytest.mark.long),
        pytest.param("modbus rtu", "in use by another program", marks=pytest.mark.long),
    ],
)
def test_a_second_daemon_on_one_device_is_refused_and_the_first_goes_on(
    tmp_path, bus_name, words
) -> None:
    with _served(tmp_path, BUSES[bus_name]) as config, Daemon(tmp_path / "first", config) as first:
        assert words in _refused(tmp_path / "second", config)
        first.ask("start", axis="x")
        time.sleep(0.3)
        assert first.state("x") == "running"
        assert first.end() == 0


def test_what_keeps_an_axis_from_starting_is_named() -> None:
    assert device_message(0) == ""
    told = device_message(int(Status.ENCODER_LOST | Status.DEVICE_RESTARTED))
    assert told.startswith("the encoder's signal is lost; the device restarted")
    assert told.endswith("once the device is back, `motorctl reset` opens it anew")
    assert device_message(int(Status.STALE)) == "no new sample arrives"
